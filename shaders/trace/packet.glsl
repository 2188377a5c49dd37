// The compute tracer's kernel for coherent streams: the lanes of a subgroup traverse the BVH together, each with PACKET_RAYS rays
// (after Wald, Slusallek, Benthin, Wagner, "Interactive Rendering with Coherent Ray Tracing", EG 2001, and `wide.glsl`, whose
// blocks it reads). A block is fetched once for all and decoded once per lane, and control flow is uniform. So a visit
// costs a lane a fraction of a visit in `wide.glsl`, but the packet visits every block that any of its rays would. The nearest hits are the same.
//
// A stream may define before it includes this file: HAS_ENTRY_POINTS, with entry_list(), to start traversal elsewhere than at the root; TAKES_TRACER_HITS, to get hits with the
// tracer's own ids; APPENDS_RAYS_PER_HIT, the number of rays that each hit adds to a queue, with queue_counter() and claimed_slot.
//
// Rays are generated and hits delivered here, without ray and hit buffers. The host uses this kernel only for coherent streams,
// on devices whose subgroups have at least eight lanes, broadcasts and arithmetic.
#ifndef TRACE_PACKET
#define TRACE_PACKET
#include "scene/corners.glsl"
#include "trace/block.glsl"
#include "trace/leaf.glsl"
#include "trace/reduce.glsl"
#include "trace/slab.glsl"
#include "trace/spread.glsl"
#include "trace/stack.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) buffer Counter { uint v; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer BlockWords { WORD64 v[]; };

// Rays whose directions have the same signs and main axis form a class: near and far planes, and the axes of the triangle test,
// are then the same for all. The other rays wait.
const uint NO_CLASS = 0xffu;

uint class_of(vec3 inverse, uint axis) {
    return (inverse.x < 0.0 ? 4u : 0u) | (inverse.y < 0.0 ? 2u : 0u) | (inverse.z < 0.0 ? 1u : 0u) | (axis << 3);
}

uint all_or(uint x) { return SUBGROUP_SIZE > 16u ? subgroupOr(x) : or_over_lanes(x); }
uint all_min(uint x) { return SUBGROUP_SIZE > 16u ? subgroupMin(x) : min_over_lanes(x); }

#define FOR_RAYS [[unroll]] for (int j = 0; j < PACKET_RAYS; j++)

#define SET_RAY(j, o, d)                                        \
    origin[j] = (o);                                            \
    direction[j] = (d);                                         \
    inverse[j] = safe_inverse(direction[j]);                    \
    shear[j] = make_shear(direction[j], inverse[j]);

// Selects the next class of waiting rays: its rays are `active`, the others have an empty interval.
#define NEXT_CLASS                                                                      \
    uint least = NO_CLASS;                                                              \
    FOR_RAYS least = min(least, waiting[j] ? class_of(inverse[j], shear[j].axis) : NO_CLASS);  \
    class_ = all_min(least);                                                            \
    FOR_RAYS {                                                                          \
        bool now = waiting[j] && class_of(inverse[j], shear[j].axis) == class_;         \
        waiting[j] = waiting[j] && !now;                                                \
        limit[j] = now ? best[j] : -1.0;                                                \
    }

#ifdef STREAM_ANY
#define ACCEPT(id)                    \
    best[j] = -1.0;                   \
    limit[j] = -1.0;                  \
    best_primitive[j] = (id) & NUMBER;  \
    found = true;
#define ACCEPT_TRIANGLE(id, turn, p0, p1, p2) ACCEPT(id)
#else
// With the corners of a triangle in the mesh's order: `turn` has the positions of the second and third.
#define ACCEPT_TRIANGLE(id, turn, p0, p1, p2)                                   \
    ACCEPT(id)                                                                  \
    uint second = (turn) & 3u, third = (turn) >> 2 & 3u;                        \
    best_corners[j].p[0] = pick_corner(p0, p1, p2, 3u - second - third);        \
    best_corners[j].p[1] = pick_corner(p0, p1, p2, second);                     \
    best_corners[j].p[2] = pick_corner(p0, p1, p2, third);
#define ACCEPT(id)                    \
    best[j] = t;                      \
    limit[j] = t;                     \
    best_uv[j] = uv;                  \
    best_instance[j] = instance;      \
    best_primitive[j] = (id) & NUMBER;
#endif

// One ray of each lane against the triangles of a leaf. Text and not a loop: the optimizer unrolls a loop into copies whose `precise` arithmetic is not
// precise any more, and their rays slip through edges on devices that fuse products into sums.
#if PACKET_RAYS != 2
#error MEET_TRIANGLES is written for two rays per lane
#endif
#define MEET_TRIANGLES(RAY) \
    { \
        const int j = RAY; \
        vec3 o = origin[j], r = direction[j]; \
        if (WATERTIGHT) { \
            Shear s = Shear(axis, shear[j].s); \
            Corner a = make_corner(s, o, v0), b = make_corner(s, o, v1), c = make_corner(s, o, v2), d = make_corner(s, o, v3); \
            float ab = edge(b, a), bc = edge(c, b), ca = edge(a, c), cd = edge(d, c), da = edge(a, d); \
            vec3 first = vec3(bc, ca, ab), second = vec3(cd, da, -ca); \
            /* rays of another class compute meaningless values here */ \
            bool live = limit[j] > tmin[j]; \
            if (live && is_inside(first)) { \
                if (meets_triangle(FIRST_ID, ORDER, instance, s, o, r, v0, v1, v2, a, b, c, first, tmin[j], limit[j], t, uv)) { ACCEPT_TRIANGLE(FIRST_ID, ORDER, v0, v1, v2) } \
            } \
            if (live && is_inside(second) && SECOND_ID != INVALID) { \
                if (meets_triangle(SECOND_ID, ORDER >> 4, instance, s, o, r, v0, v2, v3, a, c, d, second, tmin[j], limit[j], t, uv)) { ACCEPT_TRIANGLE(SECOND_ID, ORDER >> 4, v0, v2, v3) } \
            } \
        } else { \
            if (meets_moller_trumbore(FIRST_ID, ORDER, instance, o, r, v0, v1, v2, tmin[j], limit[j], t, uv)) { ACCEPT_TRIANGLE(FIRST_ID, ORDER, v0, v1, v2) } \
            if (meets_moller_trumbore(SECOND_ID, ORDER >> 4, instance, o, r, v0, v2, v3, tmin[j], limit[j], t, uv)) { ACCEPT_TRIANGLE(SECOND_ID, ORDER >> 4, v0, v2, v3) } \
        } \
    }

void main() {
    SceneRoot root = SceneRoot(push.scene);
    uvec2 blocks = root.nodes;
    uint lane = gl_SubgroupInvocationID;
    uint first = (part_of_dispatch() * LANES + gl_SubgroupID * SUBGROUP_SIZE) * PACKET_RAYS + lane;
    uint count = ray_count();
    // uniform over the lanes
    if (first - lane >= count) return;

    vec3 world_origin[PACKET_RAYS], world_direction[PACKET_RAYS], origin[PACKET_RAYS], direction[PACKET_RAYS], inverse[PACKET_RAYS];
    Shear shear[PACKET_RAYS];
    // `best`: maximum distance of a ray; `limit`: the same for rays of the current class, an empty interval for the others
    float tmin[PACKET_RAYS], best[PACKET_RAYS], limit[PACKET_RAYS];
    // rays not yet traced, at this level; and the state of the top level to return to
    bool waiting[PACKET_RAYS], world_waiting[PACKET_RAYS], world_active[PACKET_RAYS];
    uint best_instance[PACKET_RAYS], best_primitive[PACKET_RAYS];
    vec2 best_uv[PACKET_RAYS];
    Corners best_corners[PACKET_RAYS];
    FOR_RAYS {
        uint k = first + uint(j) * SUBGROUP_SIZE;
        Ray r = no_ray();
        if (k < count) r = ray(push.first + k);
        world_origin[j] = r.origin;
        world_direction[j] = r.direction;
        SET_RAY(j, r.origin, r.direction)
        waiting[j] = is_ray(r);
        tmin[j] = r.tmin;
        best[j] = waiting[j] ? r.tmax : -1.0;
        best_instance[j] = INVALID;
        best_primitive[j] = INVALID;
        best_uv[j] = vec2(0.0);
        best_corners[j] = Corners(vec3[3](vec3(0.0), vec3(0.0), vec3(0.0)));
    }

    DECLARE_STACK
    uint instance = 0u, instance_root = 0u;
    bool in_group = SINGLE_LEVEL;
    uint class_;
    { NEXT_CLASS }
    uint world_class = class_;
    uint block = root.root, base = 0u, group = 0u;
    bool finished = class_ == NO_CLASS;
#ifdef HAS_ENTRY_POINTS
    // the packet's entry points (entry_points.glsl), and the number of the one below which it is
    uvec2 list = entry_list(push.first + first - lane);
    bool has_list = !is_null(list);
    uint entry = 0u, first_entry = root.root;
    if (has_list) {
        first_entry = LOAD_PAIR(list, 0u).x;
        finished = finished || first_entry == INVALID;
    }
    block = first_entry;
#else
    uint first_entry = root.root;
#endif
    // Some CPU drivers leave any loop after 65,535 turns; then `finished` is not set, and the host reports it.
    while (!finished) {
        // lane k fetches the k-th pair of words, and broadcasts it
        uvec2 own = PAIR(BlockWords(block_address(blocks, block)).v[lane & 7u]);
        uvec2 w0 = uvec2(subgroupBroadcast(own.x, 0), subgroupBroadcast(own.y, 0));
        uvec2 w1 = uvec2(subgroupBroadcast(own.x, 1), subgroupBroadcast(own.y, 1));
        uvec2 w2 = uvec2(subgroupBroadcast(own.x, 2), subgroupBroadcast(own.y, 2));
        uvec2 w3 = uvec2(subgroupBroadcast(own.x, 3), subgroupBroadcast(own.y, 3));
        uvec2 w4 = uvec2(subgroupBroadcast(own.x, 4), subgroupBroadcast(own.y, 4));
        uvec2 w5 = uvec2(subgroupBroadcast(own.x, 5), subgroupBroadcast(own.y, 5));
        uvec2 w6 = uvec2(subgroupBroadcast(own.x, 6), subgroupBroadcast(own.y, 6));
        uvec2 w7 = uvec2(subgroupBroadcast(own.x, 7), subgroupBroadcast(own.y, 7));
        uint octant = 7u - (class_ & 7u);
        uint nearest = INVALID;
        if ((BLOCK_FLAGS & LEAF) == 0u) {
            vec3 scale[PACKET_RAYS], corner[PACKET_RAYS];
            FOR_RAYS {
                scale[j] = uintBitsToFloat(uvec3(WIDE_NODE_LOWER_X.y >> 24, WIDE_NODE_LOWER_Y.y >> 24, WIDE_NODE_LOWER_Z.y >> 24) << 23) * inverse[j];
                corner[j] = (uintBitsToFloat(WIDE_NODE_CORNER(uvec3)) - origin[j]) * inverse[j];
            }
            uvec2 near_x = (class_ & 4u) != 0u ? WIDE_NODE_UPPER_X : WIDE_NODE_LOWER_X, far_x = (class_ & 4u) != 0u ? WIDE_NODE_LOWER_X : WIDE_NODE_UPPER_X;
            uvec2 near_y = (class_ & 2u) != 0u ? WIDE_NODE_UPPER_Y : WIDE_NODE_LOWER_Y, far_y = (class_ & 2u) != 0u ? WIDE_NODE_LOWER_Y : WIDE_NODE_UPPER_Y;
            uvec2 near_z = (class_ & 1u) != 0u ? WIDE_NODE_UPPER_Z : WIDE_NODE_LOWER_Z, far_z = (class_ & 1u) != 0u ? WIDE_NODE_LOWER_Z : WIDE_NODE_UPPER_Z;
            uint hits = 0u;
            [[unroll]] for (int k = 0; k < 7; k++) {
                vec3 lower = vec3(BYTE(near_x, k), BYTE(near_y, k), BYTE(near_z, k));
                vec3 upper = vec3(BYTE(far_x, k), BYTE(far_y, k), BYTE(far_z, k));
                bool any_hit = false;
                FOR_RAYS {
                    vec3 n = lower * scale[j] + corner[j];
                    vec3 f = upper * scale[j] + corner[j];
                    float near = MAX(MAX(n.x, n.y), MAX(n.z, tmin[j]));
                    float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, limit[j]);
                    bool hit = near <= far;
                    any_hit = any_hit || hit;
#ifdef STREAM_CLOSEST
                    nearest = min(nearest, hit ? (floatBitsToUint(near) & ~7u) | k : INVALID);
#endif
                }
                hits |= any_hit ? 1u << k : 0u;
            }
            uint present = WIDE_NODE_UPPER_Y.y >> 24;
            hits = all_or(hits) & present;
#ifdef STREAM_CLOSEST
            nearest = all_min(nearest);
            if ((present >> (nearest & 7u) & 1u) == 0u) nearest = INVALID;
#endif
            if (hits != 0u) {
                if (has_siblings(group)) {
                    PUSH(base, group)
                }
                base = WIDE_NODE_FIRST_CHILD;
                group = make_group(hits, present, octant);
            }
        } else if (!SINGLE_LEVEL && !in_group) {
            // a TLAS instance: the transform to its space, then its root and index
            if (has_siblings(group)) {
                PUSH(base, group)
            }
            // the return to the top level
            PUSH(0u, 0u)
            vec4 rows[3] = vec4[3](uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_0(uvec4)), uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_1(uvec4)),
                    uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_2(uvec4)));
            FOR_RAYS {
                world_waiting[j] = waiting[j];
                world_active[j] = limit[j] > tmin[j];
                waiting[j] = world_active[j];
                SET_RAY(j, transform_point(rows, world_origin[j]), transform_vector(rows, world_direction[j]))
            }
            in_group = true;
            instance = INSTANCE_LEAF_INSTANCE;
            instance_root = INSTANCE_LEAF_ROOT;
            NEXT_CLASS
            octant = 7u - (class_ & 7u);
            base = instance_root;
            group = ROOT_GROUP;
        } else {
            bool found = false;
            float t;
            vec2 uv;
            if (HAS_SPHERES && (FIRST_ID & SPHERE) != 0u) {
                vec3 center = uintBitsToFloat(SPHERE_LEAF_CENTER(uvec3));
                FOR_RAYS {
                    if (meets_sphere(origin[j], direction[j], center, uintBitsToFloat(SPHERE_LEAF_RADIUS), tmin[j], limit[j], t, uv)) { ACCEPT(FIRST_ID) }
                }
            } else {
                uint axis = class_ >> 3;
                vec3 v0 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_0(uvec3)), v1 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_1(uvec3));
                vec3 v2 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_2(uvec3)), v3 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_3(uvec3));
                MEET_TRIANGLES(0)
                MEET_TRIANGLES(1)
            }
#ifdef STREAM_ANY
            // when all rays of the class are done, the rest of the tree is skipped
            if (all_or(found ? 1u : 0u) != 0u) {
                bool looking = false;
                FOR_RAYS looking = looking || limit[j] > tmin[j];
                if (all_or(looking ? 1u : 0u) == 0u) {
                    group = 0u;
                    if (SINGLE_LEVEL) depth = 0u;
                }
            }
#endif
        }
        // the instance is done: back to the top level, or on to the waiting rays
        while (!has_siblings(group) && !finished) {
            if (depth == 0u) {
                bool has_next = false;
#ifdef HAS_ENTRY_POINTS
                if (has_list) {
                    entry++;
                    uvec2 next = LOAD_PAIR(list, entry);
                    float farthest = limit[0];
                    FOR_RAYS farthest = max(farthest, limit[j]);
                    // beyond the nearest hits of all rays are this entry and all after it
                    has_next = next.x != INVALID && all_or(farthest > uintBitsToFloat(next.y) ? 1u : 0u) != 0u;
                    base = next.x;
                }
#endif
                if (!has_next) {
                    // the tree is done for this class of rays
                    NEXT_CLASS
                    finished = class_ == NO_CLASS;
                    octant = 7u - (class_ & 7u);
                    world_class = class_;
                    base = first_entry;
#ifdef HAS_ENTRY_POINTS
                    entry = 0u;
#endif
                }
                group = ROOT_GROUP;
                nearest = INVALID;
            } else {
                POP(base, group)
                if (!SINGLE_LEVEL && group == 0u) {
                    NEXT_CLASS
                    if (class_ != NO_CLASS) {
                        // the same instance for other rays
                        PUSH(0u, 0u)
                        base = instance_root;
                        group = ROOT_GROUP;
                    } else {
                        FOR_RAYS {
                            SET_RAY(j, world_origin[j], world_direction[j])
                            waiting[j] = world_waiting[j];
                            limit[j] = world_active[j] ? best[j] : -1.0;
                        }
                        in_group = false;
                        class_ = world_class;
                    }
                    octant = 7u - (class_ & 7u);
                }
                nearest = INVALID;
            }
        }
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

    if (!finished && lane == 0u) atomicAdd(Counter(root.unfinished).v, 1u);
#ifdef APPENDS_RAYS_PER_HIT
    // Places in the stream's queue for all hits of the packet by one atomic operation. All lanes take part, so no ballot is needed: a CPU driver makes a loop over lanes of both.
    uint slots[PACKET_RAYS], claimed = 0u;
    FOR_RAYS {
        bool appends = best_primitive[j] != INVALID;
        uint before, all_hits;
        if (SUBGROUP_SIZE > 16u) {
            before = subgroupExclusiveAdd(appends ? 1u : 0u);
            all_hits = subgroupAdd(appends ? 1u : 0u);
        } else {
            uint hits = all_or(appends ? 1u << lane : 0u);
            before = bitCount(hits & ((1u << lane) - 1u));
            all_hits = bitCount(hits);
        }
        slots[j] = claimed + before;
        claimed += all_hits;
    }
    uint first_slot = 0u;
    if (lane == 0u) first_slot = atomicAdd(QueueCount(queue_counter()).v[0], claimed * APPENDS_RAYS_PER_HIT);
    first_slot = subgroupBroadcast(first_slot, 0);
#endif
    // not unrolled: the stream's code, which may be all of a path's, exists once. Places in arrays stay constants, as CPU drivers keep arrays with others in memory.
    [[dont_unroll]] for (int ray = 0; ray < PACKET_RAYS; ray++) {
        uint k = first + uint(ray) * SUBGROUP_SIZE;
        if (k < count) {
            uint hit_instance = best_instance[0], hit_primitive = best_primitive[0];
            float hit_t = best[0];
            vec2 hit_uv = best_uv[0];
            hit_corners = best_corners[0];
            FOR_RAYS {
                if (j == ray) {
                    hit_instance = best_instance[j];
                    hit_primitive = best_primitive[j];
                    hit_t = best[j];
                    hit_uv = best_uv[j];
                    hit_corners = best_corners[j];
#ifdef APPENDS_RAYS_PER_HIT
                    claimed_slot = first_slot + slots[j] * APPENDS_RAYS_PER_HIT;
#endif
                }
            }
#ifdef STREAM_ANY
            any(push.first + k, hit_primitive != INVALID);
#else
            Hit hit = miss();
#ifdef TAKES_TRACER_HITS
            if (hit_primitive != INVALID) hit = Hit(hit_t, hit_instance, hit_primitive, hit_uv.x, hit_uv.y);
#else
            if (hit_primitive != INVALID) hit = scene_hit(hit_t, hit_instance, hit_primitive, hit_uv);
#endif
            closest(push.first + k, hit);
#endif
        }
    }
}

#endif
