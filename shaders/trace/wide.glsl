// The compute tracer's fast kernel: an eight-wide hierarchy of 80-byte nodes with quantised boxes (Ylitie, Karras, Laine,
// "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017), one ray per lane.
//
// Two things make it fast where vectors are wide and gathers dear (CPU drivers): in every turn of the loop a lane either
// visits a node (80 bytes) or tests two neighbouring primitives (2 x 40 bytes), through the same ten loads; and a lane that is
// done takes its next ray at once. Rays and results are in memory (generate.glsl, deliver.glsl), so that the stream's own code
// runs with all lanes busy.
#ifndef TRACE_WIDE
#define TRACE_WIDE
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/records.glsl"
#include "trace/slab.glsl"
#include "trace/triangle.glsl"
#include "trace/launch.glsl"

layout(local_size_x = LANES) in;

// What the scene's trees need at most: a node visit pushes at most the rest of one group of children; entering an entry of
// the top level pushes at most that, the rest of its leaf and the way back. The host counts it (src/bvh/cwbvh.rs).
layout(constant_id = 3) const uint STACK_SIZE = 64;
layout(constant_id = 4) const uint RAYS_PER_LANE = 1;

// A group of children: the upper 8 bits of its word say which are still to be visited. At or below this, none is.
const uint NO_CHILD = 0x00ffffffu;
// "the first child", whatever the octant: where a tree begins
const uint ROOT_GROUP = 0x80000000u;

#define BYTE(w, k) ((k) == 0 ? (w) & 0xffu : (k) == 3 ? (w) >> 24 : ((w) >> ((k) * 8)) & 0xffu)

#define SET_RAY(o, d)                                                                                          \
    origin = (o);                                                                                              \
    direction = (d);                                                                                           \
    shear = make_shear(direction);                                                                             \
    inverse = safe_inverse(direction);                                                                              \
    negative = lessThan(inverse, vec3(0.0));                                                                   \
    octant = (7u - ((negative.x ? 4u : 0u) | (negative.y ? 2u : 0u) | (negative.z ? 1u : 0u))) * 0x01010101u;

Ray take_ray(uint k) {
    vec2 a = uintBitsToFloat(LOAD_PAIR(push.rays, 4u * k)), b = uintBitsToFloat(LOAD_PAIR(push.rays, 4u * k + 1u));
    vec2 c = uintBitsToFloat(LOAD_PAIR(push.rays, 4u * k + 2u)), d = uintBitsToFloat(LOAD_PAIR(push.rays, 4u * k + 3u));
    return Ray(vec3(a, b.x), b.y, vec3(c, d.x), d.y);
}

#ifdef STREAM_ANY
#define STORE_MISS store_any(root, index, false);
#else
#define STORE_MISS store_closest(root, index, INFINITY, INVALID, INVALID, vec2(0.0));
#endif

// The lane's next ray; what is no ray has missed.
#define NEXT_RAY                              \
    while (true) {                            \
        if (index >= end) return;             \
        world = take_ray(index);        \
        if (is_ray(world)) break;             \
        STORE_MISS                            \
        index += LANES;                       \
    }

// One primitive record against the ray; the corners are a, b, c.
bool intersect_record(uint id, vec3 a, vec3 b, vec3 c, Shear shear, vec3 origin, vec3 direction, Ray world,
        uint instance, float best, out float t, out vec2 uv) {
    bool met;
    if (HAS_SPHERES && (id & SPHERE) != 0u) {
        t = intersect_sphere(origin, direction, world.tmin, best, a, b.x);
        uv = vec2(0.0);
        met = t > world.tmin && t < best;
    } else {
        met = intersect_triangle(shear, origin, direction, a, b, c, world.tmin, best, t, uv);
    }
    if (HAS_ALPHA) {
        if (met && (id & ALPHA_TESTED) != 0u) met = alpha_passes(instance, id & NUMBER, uv);
    }
    return met;
}

void main() {
    uint index = gl_WorkGroupID.x * (LANES * RAYS_PER_LANE) + gl_LocalInvocationID.x;
    uint end = min((gl_WorkGroupID.x + 1u) * (LANES * RAYS_PER_LANE), ray_count());
    if (index >= end) return;

    SceneRoot root = SceneRoot(push.scene);
    uvec2 nodes = root.nodes;
    uvec2 primitives = root.primitives;

    uint stack_base[STACK_SIZE];
    uint stack_bits[STACK_SIZE];
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
    // the group of children and the group of primitives in hand
    uint node_base = root.root, node_bits = ROOT_GROUP;
    uint primitive_base = 0u, primitive_bits = 0u;
    float best = world.tmax;
    uint best_instance = INVALID, best_primitive = INVALID;
    vec2 best_uv = vec2(0.0);

    while (true) {
        bool visit = primitive_bits == 0u;
        // the next child: the one that lies first along the ray's octant
        uint bit = findMSB(node_bits | 1u);
        uint rest = node_bits & ~(1u << bit);
        uint slot = (bit - 24u) ^ (octant & 7u);
        uint node = node_base + bitCount(rest & ((1u << (slot & 31u)) - 1u) & 0xffu);
        uint first = findLSB(primitive_bits | 0x80000000u);
        // both strides are multiples of 40 bytes: one address serves either
        uvec2 base = visit ? nodes : primitives;
        uint at = 5u * (visit ? node * 2u : primitive_base + first);
        uvec2 w0 = LOAD_PAIR(base, at), w1 = LOAD_PAIR(base, at + 1u), w2 = LOAD_PAIR(base, at + 2u), w3 = LOAD_PAIR(base, at + 3u);
        uvec2 w4 = LOAD_PAIR(base, at + 4u), w5 = LOAD_PAIR(base, at + 5u), w6 = LOAD_PAIR(base, at + 6u), w7 = LOAD_PAIR(base, at + 7u);
        uvec2 w8 = LOAD_PAIR(base, at + 8u), w9 = LOAD_PAIR(base, at + 9u);
        if (visit) {
            // w0, w1.x: corner; w1.y: exponents and inner mask; w2: first child, first primitive; w3: meta; then planes
            if (rest > NO_CHILD) {
                stack_base[depth] = node_base;
                stack_bits[depth] = rest;
                depth++;
            }
            vec3 scale = uintBitsToFloat(uvec3(w1.y & 0xffu, (w1.y >> 8) & 0xffu, (w1.y >> 16) & 0xffu) << 23) * inverse;
            vec3 corner = (uintBitsToFloat(uvec3(w0, w1.x)) - origin) * inverse;
            uint bits = 0u;
            [[unroll]] for (int half_ = 0; half_ < 2; half_++) {
                uint near_x = negative.x ? w5[half_] : w4[half_], far_x = negative.x ? w4[half_] : w5[half_];
                uint near_y = negative.y ? w7[half_] : w6[half_], far_y = negative.y ? w6[half_] : w7[half_];
                uint near_z = negative.z ? w9[half_] : w8[half_], far_z = negative.z ? w8[half_] : w9[half_];
                // which bit each child sets: inner children by octant order, leaves by the place of their primitives
                uint meta = w3[half_];
                uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
                uint place = (meta ^ (octant & (inner * 0xffu))) & 0x1f1f1f1fu;
                uint children = (meta >> 5) & 0x07070707u;
                [[unroll]] for (int k = 0; k < 4; k++) {
                    vec3 n = vec3(BYTE(near_x, k), BYTE(near_y, k), BYTE(near_z, k)) * scale + corner;
                    vec3 f = vec3(BYTE(far_x, k), BYTE(far_y, k), BYTE(far_z, k)) * scale + corner;
                    float near = MAX(MAX(n.x, n.y), MAX(n.z, world.tmin));
                    float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, best);
                    bits |= near <= far ? BYTE(children, k) << BYTE(place, k) : 0u;
                }
            }
            node_base = w2.x;
            node_bits = (bits & 0xff000000u) | (w1.y >> 24);
            primitive_base = w2.y;
            primitive_bits = bits & NO_CHILD;
        } else if (!SINGLE_LEVEL && !in_group) {
            // an entry of the top level: go in, and remember what is left outside
            primitive_bits &= ~(1u << first);
            if (node_bits > NO_CHILD) {
                stack_base[depth] = node_base;
                stack_bits[depth] = node_bits;
                depth++;
            }
            if (primitive_bits != 0u) {
                stack_base[depth] = primitive_base;
                stack_bits[depth] = primitive_bits;
                depth++;
            }
            stack_base[depth] = 0u;
            stack_bits[depth] = 0u;
            depth++;
            instance = w4.y;
            InstanceRecord record = InstanceRecords(root.instances).v[instance];
            SET_RAY(transform_point(record.world_to_group, world.origin), transform_vector(record.world_to_group, world.direction))
            in_group = true;
            node_base = record.root;
            node_bits = ROOT_GROUP;
            primitive_bits = 0u;
        } else {
            bool two = ((primitive_bits >> (first + 1u)) & 1u) != 0u;
            primitive_bits &= ~((two ? 3u : 1u) << first);
            float t;
            vec2 uv;
            if (intersect_record(w4.y, uintBitsToFloat(uvec3(w0, w1.x)), uintBitsToFloat(uvec3(w1.y, w2)), uintBitsToFloat(uvec3(w3, w4.x)),
                    shear, origin, direction, world, instance, best, t, uv)) {
                best = t;
                best_uv = uv;
                best_instance = instance;
                best_primitive = w4.y & NUMBER;
            }
            // where there is no second, the next record may be of another group: its alpha must not be asked with this instance
            if (two && intersect_record(w9.y, uintBitsToFloat(uvec3(w5, w6.x)), uintBitsToFloat(uvec3(w6.y, w7)), uintBitsToFloat(uvec3(w8, w9.x)),
                    shear, origin, direction, world, instance, best, t, uv)) {
                best = t;
                best_uv = uv;
                best_instance = instance;
                best_primitive = w9.y & NUMBER;
            }
#ifdef STREAM_ANY
            if (best_primitive != INVALID) {
                primitive_bits = 0u;
                node_bits = 0u;
                depth = 0u;
            }
#endif
        }
        if (primitive_bits == 0u && node_bits <= NO_CHILD) {
            bool done = depth == 0u;
            if (!done) {
                depth--;
                uint popped_base = stack_base[depth], popped_bits = stack_bits[depth];
                if (!SINGLE_LEVEL && popped_bits == 0u) {
                    // back to the top level
                    SET_RAY(world.origin, world.direction)
                    in_group = false;
                    done = depth == 0u;
                    if (!done) {
                        depth--;
                        popped_base = stack_base[depth];
                        popped_bits = stack_bits[depth];
                    }
                }
                if (popped_bits > NO_CHILD) {
                    node_base = popped_base;
                    node_bits = popped_bits;
                } else {
                    primitive_base = popped_base;
                    primitive_bits = popped_bits;
                }
            }
            if (done) {
#ifdef STREAM_ANY
                store_any(root, index, best_primitive != INVALID);
#else
                store_closest(root, index, best_primitive != INVALID ? best : INFINITY, best_instance, best_primitive, best_uv);
#endif
                index += LANES;
                NEXT_RAY
                SET_RAY(world.origin, world.direction)
                in_group = SINGLE_LEVEL;
                instance = 0u;
                node_base = root.root;
                node_bits = ROOT_GROUP;
                best = world.tmax;
                best_primitive = INVALID;
                best_instance = INVALID;
            }
        }
    }
}

#endif
