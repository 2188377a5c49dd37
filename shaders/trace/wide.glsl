// The compute tracer's fast kernel: one ray per lane through a seven-wide hierarchy of 64-byte blocks (src/bvh/wide.rs), each a node with
// quantised boxes (after Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017)
// or a leaf.
//
// What makes it fast where vectors are wide and gathers dear (CPU drivers): in every turn of the loop a lane fetches one block,
// a cache line, through the same eight loads, whatever it is; a lane that is done takes its next ray at once; and the upper end of
// the stack is in registers. Rays and results are in memory (generate.glsl, deliver.glsl), so that the stream's own code runs with all
// lanes busy.
#ifndef TRACE_WIDE
#define TRACE_WIDE
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/block.glsl"
#include "trace/records.glsl"
#include "trace/slab.glsl"
#include "trace/triangle.glsl"
#include "trace/launch.glsl"

layout(local_size_x = LANES) in;

// What the scene's trees need at most beyond the entries in registers: a node visit pushes at most the rest of one group of
// children; entering an entry of the top level pushes that and the way back. The host counts it.
layout(constant_id = 3) const uint SPILLED = 64;
layout(constant_id = 4) const uint RAYS_PER_LANE = 1;
// A lane that has taken so many turns takes no further ray; 0: no bound. For drivers that leave any loop after 65,535 turns: with
// one ray per lane of a work-group each ray is taken nevertheless, because a lane that stops has had one.
layout(constant_id = 8) const uint MOST_TURNS = 0;

// Entries of the stack in registers. A CPU driver writes to an array element by element, about ninety instructions; moving all of
// these takes one each.
const uint TOP = 6u;

#define SET_RAY(o, d)                                                                                          \
    origin = (o);                                                                                              \
    direction = (d);                                                                                           \
    inverse = safe_inverse(direction);                                                                         \
    shear = make_shear(direction, inverse);                                                                    \
    negative = lessThan(inverse, vec3(0.0));                                                                   \
    octant = 7u - ((negative.x ? 4u : 0u) | (negative.y ? 2u : 0u) | (negative.z ? 1u : 0u));

#define PUSH(b, g)                                                          \
    if (SPILLED > 0u) {                                                     \
        if (depth >= TOP) {                                                 \
            spilled_base[depth - TOP] = top_base[TOP - 1u];                 \
            spilled_group[depth - TOP] = top_group[TOP - 1u];               \
        }                                                                   \
    }                                                                       \
    [[unroll]] for (uint s = TOP - 1u; s > 0u; s--) {                       \
        top_base[s] = top_base[s - 1u];                                     \
        top_group[s] = top_group[s - 1u];                                   \
    }                                                                       \
    top_base[0] = (b);                                                      \
    top_group[0] = (g);                                                     \
    depth++;

#define POP                                                                 \
    base = top_base[0];                                                     \
    group = top_group[0];                                                   \
    [[unroll]] for (uint s = 0u; s < TOP - 1u; s++) {                       \
        top_base[s] = top_base[s + 1u];                                     \
        top_group[s] = top_group[s + 1u];                                   \
    }                                                                       \
    depth--;                                                                \
    if (SPILLED > 0u) {                                                     \
        if (depth >= TOP) {                                                 \
            top_base[TOP - 1u] = spilled_base[depth - TOP];                 \
            top_group[TOP - 1u] = spilled_group[depth - TOP];               \
        }                                                                   \
    }

Ray take_ray(uint k) {
    Block4 b = Block4(offset_address(push.rays, 32u * k));
    vec2 x = uintBitsToFloat(PAIR(b.q0)), y = uintBitsToFloat(PAIR(b.q1)), z = uintBitsToFloat(PAIR(b.q2)), w = uintBitsToFloat(PAIR(b.q3));
    return Ray(vec3(x, y.x), y.y, vec3(z, w.x), w.y);
}

// The lane's next ray. What is no ray meets nothing: no box and no primitive lies before it.
#define NEXT_RAY                                                                                        \
    index = begin + atomicAdd(LaunchFlags(root.launch_counters).v[gl_WorkGroupID.x], 1u);               \
    if (index >= end) return;                                                                           \
    world = take_ray(index);                                                                            \
    if (!is_ray(world)) world = no_ray();

// What the ray met last, with the weights of the second and third corner as the mesh has them.
#ifdef STREAM_ANY
#define ACCEPT best_primitive = id & NUMBER;
#else
#define ACCEPT                        \
    best = t;                         \
    best_uv = uv;                     \
    best_instance = instance;         \
    best_primitive = id & NUMBER;
#endif

// A triangle is met at `t` with barycentric `weights`: unless its alpha says otherwise, take it.
#define OFFER(turn)                                                                                                  \
    vec2 uv = vec2(pick_weight(weights, (turn)), pick_weight(weights, (turn) >> 2));                                 \
    bool met = true;                                                                                                 \
    if (HAS_ALPHA) {                                                                                                 \
        if ((id & ALPHA_TESTED) != 0u) met = alpha_passes(instance, id & NUMBER, uv);                                \
    }                                                                                                                \
    if (met) {                                                                                                       \
        ACCEPT                                                                                                       \
    }

// One triangle of a pair: its number, the places of its second and third corner, corners as they lie and as the ray sees them, edges.
#define TEST_TRIANGLE(id_, turn, v0_, v1_, v2_, a, b, c, e)                                                     \
    {                                                                                                                    \
        uint id = (id_);                                                                                                 \
        float t;                                                                                                         \
        vec3 weights;                                                                                                    \
        if (meets_between(shear, origin, direction, v0_, v1_, v2_, a, b, c, e, world.tmin, best, t, weights)) { \
            OFFER(turn)                                                                                                  \
        }                                                                                                                \
    }

#define TEST_MOLLER_TRUMBORE(id_, turn, v0_, v1_, v2_)                                                      \
    {                                                                                                       \
        uint id = (id_);                                                                                    \
        float t;                                                                                            \
        vec2 vw;                                                                                            \
        if (intersect_moller_trumbore(origin, direction, v0_, v1_, v2_, world.tmin, best, t, vw)) {         \
            vec3 weights = vec3(1.0 - vw.x - vw.y, vw);                                                     \
            OFFER(turn)                                                                                     \
        }                                                                                                   \
    }

#define TEST_SPHERE(id_, center, radius)                                                             \
    {                                                                                                \
        uint id = (id_);                                                                             \
        float t = intersect_sphere(origin, direction, world.tmin, best, center, radius);             \
        vec2 uv = vec2(0.0);                                                                         \
        if (id != INVALID && t > world.tmin && t < best) {                                           \
            ACCEPT                                                                                   \
        }                                                                                            \
    }

float pick_weight(vec3 w, uint k) {
    k &= 3u;
    return k == 0u ? w.x : k == 1u ? w.y : w.z;
}

void main() {
    uint begin = gl_WorkGroupID.x * (LANES * RAYS_PER_LANE);
    uint end = min(begin + LANES * RAYS_PER_LANE, ray_count());
    SceneRoot root = SceneRoot(push.scene);
    uint index;
    uvec2 blocks = root.nodes;

    uint top_base[TOP], top_group[TOP];
    uint spilled_base[SPILLED + 1u], spilled_group[SPILLED + 1u];
    [[unroll]] for (uint s = 0u; s < TOP; s++) {
        top_base[s] = 0u;
        top_group[s] = 0u;
    }
    uint depth = 0u;

    Ray world;
    NEXT_RAY
    vec3 origin, direction, inverse;
    Shear shear;
    bvec3 negative;
    uint octant;
    SET_RAY(world.origin, world.direction)
    uint instance = 0u;
    bool in_group = SINGLE_LEVEL;
    uint block = root.root;
    // siblings yet to be visited (block.glsl)
    uint base = 0u, group = 0u;
    float best = world.tmax;
    uint best_instance = INVALID, best_primitive = INVALID;
    vec2 best_uv = vec2(0.0);

    uint turns = 0u;
    while (true) {
        turns++;
        Block8 b = Block8(offset_address(blocks, 64u * block));
        uvec2 w0 = PAIR(b.q0), w1 = PAIR(b.q1), w2 = PAIR(b.q2), w3 = PAIR(b.q3);
        uvec2 w4 = PAIR(b.q4), w5 = PAIR(b.q5), w6 = PAIR(b.q6), w7 = PAIR(b.q7);
        // the child that lies first along the ray, where distance decides and not the octant
        uint nearest = INVALID;
        if ((w7.y & LEAF) == 0u) {
            // w0, w1.x: corner; w1.y: first child; then planes, seven bytes each, and in the eighth: exponents, which children there are
            vec3 scale = uintBitsToFloat(uvec3(w2.y >> 24, w4.y >> 24, w6.y >> 24) << 23) * inverse;
            vec3 corner = (uintBitsToFloat(uvec3(w0, w1.x)) - origin) * inverse;
            uvec2 near_x = negative.x ? w3 : w2, far_x = negative.x ? w2 : w3;
            uvec2 near_y = negative.y ? w5 : w4, far_y = negative.y ? w4 : w5;
            uvec2 near_z = negative.z ? w7 : w6, far_z = negative.z ? w6 : w7;
            uint hits = 0u;
            [[unroll]] for (int k = 0; k < 7; k++) {
                vec3 n = vec3(BYTE(near_x, k), BYTE(near_y, k), BYTE(near_z, k)) * scale + corner;
                vec3 f = vec3(BYTE(far_x, k), BYTE(far_y, k), BYTE(far_z, k)) * scale + corner;
                float near = MAX(MAX(n.x, n.y), MAX(n.z, world.tmin));
                float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, best);
                bool hit = near <= far;
                hits |= hit ? 1u << k : 0u;
#ifdef STREAM_CLOSEST
                // the three lowest bits of a distance matter to no order
                nearest = min(nearest, hit ? (floatBitsToUint(near) & ~7u) | k : INVALID);
#endif
            }
            uint present = w5.y >> 24;
            hits &= present;
            if ((present >> (nearest & 7u) & 1u) == 0u) nearest = INVALID;
            if (hits != 0u) {
                if (has_siblings(group)) {
                    PUSH(base, group)
                }
                base = w1.y;
                group = make_group(hits, present, octant);
            }
        } else if (!SINGLE_LEVEL && !in_group) {
            // an entry of the top level: the transform to its own space, then its root and number
            if (has_siblings(group)) {
                PUSH(base, group)
            }
            // the way back
            PUSH(0u, 0u)
            vec4 rows[3] = vec4[3](uintBitsToFloat(uvec4(w0, w1)), uintBitsToFloat(uvec4(w2, w3)), uintBitsToFloat(uvec4(w4, w5)));
            SET_RAY(transform_point(rows, world.origin), transform_vector(rows, world.direction))
            in_group = true;
            instance = w6.y;
            base = w6.x;
            group = ROOT_GROUP;
        } else {
            if (HAS_SPHERES && (w6.x & SPHERE) != 0u) {
                TEST_SPHERE(w6.x, uintBitsToFloat(uvec3(w0, w1.x)), uintBitsToFloat(w1.y))
                TEST_SPHERE(w6.y, uintBitsToFloat(uvec3(w2, w3.x)), uintBitsToFloat(w3.y))
            } else {
                vec3 v0 = uintBitsToFloat(uvec3(w0, w1.x)), v1 = uintBitsToFloat(uvec3(w1.y, w2));
                vec3 v2 = uintBitsToFloat(uvec3(w3, w4.x)), v3 = uintBitsToFloat(uvec3(w4.y, w5));
                Corner a = make_corner(shear, origin, v0), b = make_corner(shear, origin, v1);
                Corner c = make_corner(shear, origin, v2), d = make_corner(shear, origin, v3);
                float ab = edge(b, a), bc = edge(c, b), ca = edge(a, c), cd = edge(d, c), da = edge(a, d);
                bool first = is_inside(vec3(bc, ca, ab)), second = is_inside(vec3(cd, da, -ca)) && w6.y != INVALID;
                if (!WATERTIGHT) {
                    TEST_MOLLER_TRUMBORE(w6.x, w7.x, v0, v1, v2)
                    if (w6.y != INVALID) TEST_MOLLER_TRUMBORE(w6.y, w7.x >> 4, v0, v2, v3)
                    first = second = false;
                }
                if (first) TEST_TRIANGLE(w6.x, w7.x, v0, v1, v2, a, b, c, vec3(bc, ca, ab))
                if (second) TEST_TRIANGLE(w6.y, w7.x >> 4, v0, v2, v3, a, c, d, vec3(cd, da, -ca))
            }
#ifdef STREAM_ANY
            if (best_primitive != INVALID) {
                group = 0u;
                depth = 0u;
            }
#endif
        }
        bool done = false;
        if (!has_siblings(group)) {
            done = depth == 0u;
            if (!done) {
                POP
                if (!SINGLE_LEVEL && group == 0u) {
                    // back to the top level
                    SET_RAY(world.origin, world.direction)
                    in_group = false;
                    done = depth == 0u;
                    if (!done) {
                        POP
                    }
                }
            }
            if (done) {
#ifdef STREAM_ANY
                store_any(root, index, best_primitive != INVALID);
#else
                store_closest(root, index, best_primitive != INVALID ? best : INFINITY, best_instance, best_primitive, best_uv);
#endif
                if (MOST_TURNS > 0u && turns > MOST_TURNS) return;
                NEXT_RAY
                SET_RAY(world.origin, world.direction)
                in_group = SINGLE_LEVEL;
                instance = 0u;
                base = root.root;
                group = ROOT_GROUP;
                best = world.tmax;
                best_primitive = INVALID;
                best_instance = INVALID;
            }
        }
        // the next block
        uint bit = findMSB(group | 1u);
        uint slot = (bit - 24u) ^ octant;
#ifdef STREAM_CLOSEST
        if (nearest != INVALID) {
            slot = nearest & 7u;
            bit = (slot ^ octant) + 24u;
        }
#endif
        group &= ~(1u << bit);
        block = base + bitCount((group >> 16) & 0xffu & ((1u << (slot & 31u)) - 1u));
    }
}

#endif
