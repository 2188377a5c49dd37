// Rays against the leaves of a scene that has few (src/accel/few.rs), without a hierarchy, as functions for kernels that do other work between their rays. First all lanes test all
// boxes: each is fetched once for the subgroup, and costs as many instructions as there are in a slab test. Then each lane tests the leaves whose boxes its ray meets, nearest first.
// All lanes of the subgroup must call these functions, with no_ray() where they have none.
#ifndef TRACE_FEW
#define TRACE_FEW
#include "scene/corners.glsl"
#include "trace/block.glsl"
#include "trace/leaf.glsl"
#include "trace/slab.glsl"

// `few`: leaves, then their boxes of eight floats; `few_count`: their number, a multiple of two, of which the last box may be empty.
const uint FEW_SLOT = 31u;

// The boxes of all leaves against the lane's ray: bits of those that it meets, but for the flat one that it starts on, and distances to the two nearest, with the leaf's number in
// the five lowest bits.
#define MEET_BOX(k)                                                                                                     \
    {                                                                                                                   \
        vec3 lower = vec3(subgroupBroadcast(own, (k)), subgroupBroadcast(own, (k) + 1), subgroupBroadcast(own, (k) + 2));         \
        vec3 upper = vec3(subgroupBroadcast(own, (k) + 3), subgroupBroadcast(own, (k) + 4), subgroupBroadcast(own, (k) + 5));     \
        vec3 t0 = (lower - origin) * inverse, t1 = (upper - origin) * inverse;                                          \
        vec3 n = MIN(t0, t1), f = MAX(t0, t1);                                                                          \
        float near = MAX(MAX(n.x, n.y), MAX(n.z, world.tmin));                                                          \
        float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, world.tmax);                                              \
        bool met = near <= far && slot != start;                                                                        \
        uint key = met ? (floatBitsToUint(near) & ~FEW_SLOT) | slot : INVALID;                                          \
        hits |= met ? 1u << slot : 0u;                                                                                  \
        second = min(second, max(first, key));                                                                          \
        first = min(first, key);                                                                                        \
        slot++;                                                                                                         \
    }

#define MEET_BOXES                                                                                                      \
    uint hits = 0u, first = INVALID, second = INVALID, slot = 0u;                                                       \
    uvec2 boxes = offset_address(few, few_count << 6);                                                                  \
    if (SUBGROUP_SIZE > 8u) {                                                                                           \
        while (slot < few_count) {                                                                                      \
            float own = Floats(boxes).v[8u * slot + (gl_SubgroupInvocationID & 15u)];                                   \
            MEET_BOX(0)                                                                                                 \
            MEET_BOX(8)                                                                                                 \
        }                                                                                                               \
    } else {                                                                                                            \
        while (slot < few_count) {                                                                                      \
            float own = Floats(boxes).v[8u * slot + (gl_SubgroupInvocationID & 7u)];                                    \
            MEET_BOX(0)                                                                                                 \
        }                                                                                                               \
    }

#define DECLARE_FEW                                                     \
    vec3 origin = world.origin, direction = world.direction;            \
    vec3 inverse = safe_inverse(direction);                             \
    Shear shear = make_shear(direction, inverse);                       \
    const uint mine = ~0u;                                              \
    float best = world.tmax;                                            \
    uint best_instance = 0u, best_primitive = INVALID, best_slot = 0u;  \
    vec2 best_uv = vec2(0.0);

// Words of a leaf, and the instance that it belongs to; all are in the world's space.
#define LOAD_LEAF(slot)                                                                                 \
    uint instance = SINGLE_LEVEL ? 0u : Words(boxes).v[8u * (slot) + 6u];                               \
    Block8 b = Block8(offset_address(few, (slot) << 6));                                                \
    uvec2 w0 = PAIR(b.q0), w1 = PAIR(b.q1), w2 = PAIR(b.q2), w3 = PAIR(b.q3);                           \
    uvec2 w4 = PAIR(b.q4), w5 = PAIR(b.q5), w6 = PAIR(b.q6), w7 = PAIR(b.q7);

#define ACCEPT(id)                    \
    best = t;                         \
    best_uv = uv;                     \
    best_instance = instance;         \
    best_slot = slot;                 \
    best_primitive = (id) & NUMBER;
#define ACCEPT_TRIANGLE(id, turn, p0, p1, p2)                                   \
    ACCEPT(id)                                                                  \
    uint second_ = (turn) & 3u, third_ = (turn) >> 2 & 3u;                      \
    hit_corners.p[0] = pick_corner(p0, p1, p2, 3u - second_ - third_);          \
    hit_corners.p[1] = pick_corner(p0, p1, p2, second_);                        \
    hit_corners.p[2] = pick_corner(p0, p1, p2, third_);

// The leaf of the closest hit.
uint hit_slot;

// The closest hit of a ray, with scene ids; sets hit_corners and hit_slot. start: the flat leaf that the ray starts on, which it cannot meet, or INVALID.
Hit few_closest(uvec2 few, uint few_count, Ray world, uint start) {
    DECLARE_FEW
    MEET_BOXES
    while (hits != 0u) {
        slot = first != INVALID ? first & FEW_SLOT : findLSB(hits);
        hits &= ~(1u << slot);
        LOAD_LEAF(slot)
        float t;
        vec2 uv;
#include "trace/meet.glsl"
        // behind the nearest hit is the second box, and all others with it
        if (second != INVALID && uintBitsToFloat(second & ~FEW_SLOT) > best) hits = 0u;
        first = second;
        second = INVALID;
    }
    Hit hit = miss();
    if (best_primitive != INVALID) hit = scene_hit(best, best_instance, best_primitive, best_uv);
    hit_slot = best_slot;
    return hit;
}

#undef ACCEPT
#undef ACCEPT_TRIANGLE
#define ACCEPT(id) best_primitive = (id) & NUMBER;
#define ACCEPT_TRIANGLE(id, turn, p0, p1, p2) ACCEPT(id)

// Whether something is in the way of a ray. start: as above.
bool few_any(uvec2 few, uint few_count, Ray world, uint start) {
    DECLARE_FEW
    MEET_BOXES
    while (hits != 0u) {
        slot = findLSB(hits);
        hits &= ~(1u << slot);
        LOAD_LEAF(slot)
        float t;
        vec2 uv;
#include "trace/meet.glsl"
        if (best_primitive != INVALID) hits = 0u;
    }
    return best_primitive != INVALID;
}

#undef ACCEPT
#undef ACCEPT_TRIANGLE

#endif
