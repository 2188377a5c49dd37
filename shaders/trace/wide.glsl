// The compute tracer's fast kernel: one ray per lane through a seven-wide hierarchy of 64-byte blocks (src/accel/wide.rs), each a node with
// quantised boxes (after Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017)
// or a leaf.
//
// Why it is fast where vectors are wide and gathers expensive (CPU drivers): in every iteration a lane fetches one block,
// a cache line, through the same eight loads, whether node or leaf; lanes whose rays are done take their next ones together; and the top of
// the stack is in registers. Ray and hit buffers (generate.glsl, deliver.glsl) separate it from the stream's own code, which runs with all
// lanes busy.
#ifndef TRACE_WIDE
#define TRACE_WIDE
#include "trace/block.glsl"
#include "trace/launch.glsl"
#include "trace/leaf.glsl"
#include "trace/slab.glsl"
#include "trace/spread.glsl"
#include "trace/stack.glsl"
#ifndef COUNT_VISITS
#include "trace/suspend.glsl"
#endif
#ifdef BALLOT
#include "trace/reduce.glsl"
#endif

layout(local_size_x = LANES) in;

// MAX_ITERATIONS is for drivers that leave any loop after 65,535 iterations. With one ray per lane of a work-group every ray is still traced, because each
// lane fetches at least one; what is not done when the loop is about to end is suspended (suspend.glsl).

// Storing a hit and taking the next ray cost a vector of lanes the same whether one lane does it or all. So a lane whose ray is done waits until the number of
// iterations is a multiple of this. A power of two; 4 measured best on CPUs (docs/design/tracers.md).
const uint REFILL_INTERVAL = 4u;

// On CPUs, where a lane has many rays (lane_budget in src/tracer/lane_budget.rs), the first subgroup of a work-group traces all of its rays, and counts them in a register. A counter
// in memory is changed lane by lane, and the other subgroups, which run after the first, would find nothing left.
bool traces_in_subgroup() {
#ifdef BALLOT
    return MAX_ITERATIONS == 0u && RAYS_PER_LANE > 2u && (SUBGROUP_SIZE == 8u || SUBGROUP_SIZE == 16u);
#else
    return false;
#endif
}

#define SET_RAY(o, d)                                                                                          \
    origin = (o);                                                                                              \
    direction = (d);                                                                                           \
    inverse = safe_inverse(direction);                                                                         \
    shear = make_shear(direction, inverse);                                                                    \
    negative = lessThan(inverse, vec3(0.0));                                                                   \
    octant = 7u - ((negative.x ? 4u : 0u) | (negative.y ? 2u : 0u) | (negative.z ? 1u : 0u));

Ray take_ray(uint k) {
    Block4 b = Block4(offset_address(push.rays, 32u * k));
    vec2 x = uintBitsToFloat(PAIR(b.q0)), y = uintBitsToFloat(PAIR(b.q1)), z = uintBitsToFloat(PAIR(b.q2)), w = uintBitsToFloat(PAIR(b.q3));
    return Ray(vec3(x, y.x), y.y, vec3(z, w.x), w.y);
}

#ifdef COUNT_VISITS
// For a compute pass that includes the kernel to count the nodes that rays visit: it defines the ray of an index, and stores their number. A lane has one ray.
Ray counted_ray(uint k);
void store_visits(uint k, uint nodes);
#define NEXT_RAY                                                                                        \
    index = gl_GlobalInvocationID.x;                                                                    \
    if (index >= push.count) return;                                                                    \
    world = counted_ray(push.first + index);                                                            \
    if (!is_ray(world)) world = no_ray();
#define VISIT visits++;
#else
#define VISIT
// Fetches the lane's next ray. An invalid ray hits nothing: its interval is empty.
#define NEXT_RAY                                                                                        \
    if (!in_subgroup) index = begin + atomicAdd(LaunchFlags(counters).v[part], 1u);                     \
    if (!in_subgroup && index >= end) return;                                                           \
    world = index < end ? take_ray(index) : no_ray();                                                                            \
    if (!is_ray(world)) world = no_ray();
#endif

// Fetches the lane's next ray, and starts it at the root; if there is none, the lane ends.
#define TAKE_RAY                                   \
    NEXT_RAY                                       \
    SET_RAY(world.origin, world.direction)         \
    block = top;                                   \
    base = 0u;                                     \
    group = 0u;                                    \
    best = world.tmax;                             \
    best_instance = INVALID;                       \
    best_primitive = INVALID;                      \
    instance = 0u;

// Stores the last hit: primitive `id` at `t`, with the barycentric weights of its second and third vertex in the mesh's order.
#ifdef STREAM_ANY
#define ACCEPT(id) best_primitive = (id) & NUMBER;
#else
#define ACCEPT(id)                    \
    best = t;                         \
    best_uv = uv;                     \
    best_instance = instance;         \
    best_primitive = (id) & NUMBER;
#endif

#define ACCEPT_TRIANGLE(id, turn, p0, p1, p2) ACCEPT(id)

#ifdef STREAM_ANY
#define STORE_HIT store_any(results, index, best_primitive != INVALID);
#else
#define STORE_HIT store_closest(results, index, best_primitive != INVALID ? best : INFINITY, best_instance, best_primitive, best_uv);
#endif

void main() {
    bool in_subgroup = traces_in_subgroup();
    uint part = part_of_dispatch(), begin = part * (LANES * RAYS_PER_LANE);
    uint end = min(begin + LANES * RAYS_PER_LANE, ray_count());
    SceneRoot root = SceneRoot(push.scene);
    // read once: in the loop each would be a gather of its own
    uvec2 blocks = root.nodes, counters = root.launch_counters, results = root.launch_hits;
    uint top = root.root;
    uint index;

    DECLARE_STACK

    Ray world;
    vec3 origin, direction, inverse;
    Shear shear;
    bvec3 negative;
    uint octant;
    uint instance;
    // depth of the stack when the ray entered the instance
    uint entry_depth = 0u;
    // all bits or none: the ray is in the top level
    uint at_top = SINGLE_LEVEL ? 0u : ~0u;
    // siblings not yet visited (block.glsl)
    uint block, base, group;
    float best;
    uint best_instance, best_primitive;
    vec2 best_uv = vec2(0.0);
#ifdef BALLOT
    // the next ray that no lane has taken
    uint lane = gl_SubgroupInvocationID, next = begin + SUBGROUP_SIZE;
    if (in_subgroup && gl_SubgroupID != 0u) return;
    index = begin + lane;
#endif
#ifndef COUNT_VISITS
    bool is_resumed = MAX_ITERATIONS > 0u && push.first == RESUMED;
    uvec2 suspended = MAX_ITERATIONS > 0u ? root.suspended : uvec2(0u);
    // of this lane among suspended rays, and the first of its words
    uint place = resumed_place(), state = SUSPENDED_START + SUSPENDED_STRIDE * place;
    if (is_resumed) {
        if (place >= min(LaunchFlags(suspended).v[0], SUSPENDED_RAYS) || SUSPENDED_WORD(0u) == INVALID) return;
        LOAD_SUSPENDED
    } else
#endif
    {
        TAKE_RAY
    }

    uint turns = 0u;
    bool has_ray = !in_subgroup || index < end;
#ifdef COUNT_VISITS
    uint visits = 0u;
#endif
    while (true) {
        turns++;
#ifdef BALLOT
        if (in_subgroup && turns % REFILL_INTERVAL == 0u) {
            uint waiting = or_over_lanes(has_ray ? 0u : 1u << lane);
            if (waiting != 0u) {
                if (!has_ray && index < end) { STORE_HIT }
                if (next >= end && waiting == (1u << SUBGROUP_SIZE) - 1u) return;
                index = has_ray ? index : next + bitCount(waiting & ((1u << lane) - 1u));
                next += bitCount(waiting);
                if (!has_ray && index < end) {
                    TAKE_RAY
                    has_ray = true;
                }
            }
        }
#endif
#ifndef COUNT_VISITS
        if (!in_subgroup && !has_ray && (MAX_ITERATIONS > 0u || turns % REFILL_INTERVAL == 0u)) {
            STORE_HIT
            if (MAX_ITERATIONS > 0u && (is_resumed || turns > MAX_ITERATIONS)) return;
            TAKE_RAY
            has_ray = true;
        }
        if (MAX_ITERATIONS > 0u && turns > SUSPEND_ITERATION) break;
#endif
        if (has_ray) {
            Block8 b = Block8(block_address(blocks, block));
            uvec2 w0 = PAIR(b.q0), w1 = PAIR(b.q1), w2 = PAIR(b.q2), w3 = PAIR(b.q3);
            uvec2 w4 = PAIR(b.q4), w5 = PAIR(b.q5), w6 = PAIR(b.q6), w7 = PAIR(b.q7);
            // where traversal continues when the ray leaves this space
            bool turns_to = false;
            vec3 next_origin = world.origin, next_direction = world.direction;
            // the child that the ray enters first, where the order is by distance and not by octant
            uint nearest = INVALID;
            if ((BLOCK_FLAGS & LEAF) == 0u) {
                VISIT
                vec3 scale = uintBitsToFloat(uvec3(WIDE_NODE_LOWER_X.y >> 24, WIDE_NODE_LOWER_Y.y >> 24, WIDE_NODE_LOWER_Z.y >> 24) << 23) * inverse;
                vec3 corner = (uintBitsToFloat(WIDE_NODE_CORNER(uvec3)) - origin) * inverse;
                uvec2 near_x = negative.x ? WIDE_NODE_UPPER_X : WIDE_NODE_LOWER_X, far_x = negative.x ? WIDE_NODE_LOWER_X : WIDE_NODE_UPPER_X;
                uvec2 near_y = negative.y ? WIDE_NODE_UPPER_Y : WIDE_NODE_LOWER_Y, far_y = negative.y ? WIDE_NODE_LOWER_Y : WIDE_NODE_UPPER_Y;
                uvec2 near_z = negative.z ? WIDE_NODE_UPPER_Z : WIDE_NODE_LOWER_Z, far_z = negative.z ? WIDE_NODE_LOWER_Z : WIDE_NODE_UPPER_Z;
                uint hits = 0u;
                [[unroll]] for (int k = 0; k < 7; k++) {
                    vec3 n = vec3(BYTE(near_x, k), BYTE(near_y, k), BYTE(near_z, k)) * scale + corner;
                    vec3 f = vec3(BYTE(far_x, k), BYTE(far_y, k), BYTE(far_z, k)) * scale + corner;
                    float near = MAX(MAX(n.x, n.y), MAX(n.z, world.tmin));
                    float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, best);
                    bool hit = near <= far;
                    hits |= hit ? 1u << k : 0u;
#ifdef STREAM_CLOSEST
                    // the three lowest bits of a distance do not matter for the order, so they hold the slot
                    nearest = min(nearest, hit ? (floatBitsToUint(near) & ~7u) | k : INVALID);
#endif
                }
                uint present = WIDE_NODE_UPPER_Y.y >> 24;
                hits &= present;
                if ((present >> (nearest & 7u) & 1u) == 0u) nearest = INVALID;
                if (hits != 0u) {
                    if (has_siblings(group)) {
                        PUSH(base, group)
                    }
                    base = WIDE_NODE_FIRST_CHILD;
                    group = make_group(hits, present, octant);
                }
            } else if (!SINGLE_LEVEL && at_top != 0u) {
                // a TLAS instance: the transform to its space, then its root and index
                if (has_siblings(group)) {
                    PUSH(base, group)
                }
                entry_depth = depth;
                // Lanes without an instance compute this too, on words that are often denormal as floats, which cost a CPU a
                // hundred times the cycles: theirs are zeroed, by arithmetic that no compiler recognizes as this branch's condition.
                uint mine = uint(int(BLOCK_FLAGS) >> 31) & at_top;
                vec4 rows[3] = vec4[3](uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_0(uvec4) & mine), uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_1(uvec4) & mine),
                        uintBitsToFloat(INSTANCE_LEAF_WORLD_TO_GROUP_2(uvec4) & mine));
                next_origin = transform_point(rows, world.origin);
                next_direction = transform_vector(rows, world.direction);
                turns_to = true;
                at_top = 0u;
                instance = INSTANCE_LEAF_INSTANCE;
                base = INSTANCE_LEAF_ROOT;
                group = ROOT_GROUP;
            } else {
                float t;
                vec2 uv;
                // words of lanes without a primitive are zeroed, for the same reason as those without an instance
                uint mine = uint(int(BLOCK_FLAGS) >> 31) & ~at_top;
#include "trace/meet.glsl"
#ifdef STREAM_ANY
                if (best_primitive != INVALID) {
                    group = 0u;
                    depth = 0u;
                    entry_depth = 0u;
                }
#endif
            }
            if (!has_siblings(group)) {
                if (!SINGLE_LEVEL && at_top == 0u && depth == entry_depth) {
                    // back to the top level
                    turns_to = true;
                    at_top = ~0u;
                }
                if (depth == 0u) {
#ifdef COUNT_VISITS
                    store_visits(push.first + index, visits);
                    return;
#endif
                    has_ray = false;
                } else {
                    POP(base, group)
                }
            }
            // the ray changes space, to an instance's or back to the world's: its inverse direction is computed here for both cases
            if (!SINGLE_LEVEL && turns_to) { SET_RAY(next_origin, next_direction) }
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
#ifndef COUNT_VISITS
    // after the loop, because CPU drivers go through all branches in every iteration, whether a lane takes them or not
    if (MAX_ITERATIONS > 0u && !is_null(suspended)) {
        if (!is_resumed) {
            place = suspend_new(suspended);
            state = SUSPENDED_START + SUSPENDED_STRIDE * place;
        }
        if (place < SUSPENDED_RAYS) { STORE_SUSPENDED }
    }
#endif
}

#endif
