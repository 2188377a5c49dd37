// The compute tracer's simple kernel: a two-level binary BVH, one ray per lane. generate.glsl has made the rays, and
// deliver.glsl passes the hits on. The fast kernel is wide.glsl.
//
// Two orders of the children, after Coello's study (2024; docs/design/tracers.md): first the one whose box the ray enters first, or first the one
// that comes first along the sign of the ray's direction on the node's axis. Both prune by the nearest hit so far.
#ifndef TRACE_REFERENCE
#define TRACE_REFERENCE
#include "scene/scene.glsl"
#include "trace/areas.glsl"
#include "trace/launch.glsl"
#include "trace/primitive.glsl"
#include "trace/slab.glsl"
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

// STACK_SIZE is the maximum that the scene's trees need: every inner node pushes at most one child, so depth of the
// top level + 1 + depth of the deepest group can never be exceeded. See src/accel/bvh2.rs for the bound on the depth.

// References, besides those of BinaryNode.
const uint FINISHED = 0x7fffffffu;
const uint LEAVE_INSTANCE = 0x7ffffffeu;
const uint LAST_NODE = 0x7ffffff0u;

// Distance before which a ray's boxes are skipped: where it left an influence area, in whose tree all before it was found.
#define BOX_START (HAS_AREAS ? start : world.tmin)
// Share of the distance to where a ray leaves an area from which on the whole tree is traversed: far above rounding.
const float BEFORE_LEAVING = 1.0 - 1e-6;

// The tree in which a ray begins: that of an influence area, or of the whole scene.
#define BEGIN_RAY                                                                                  \
    current = is_ray(world) ? root.root : FINISHED;                                                \
    if (HAS_AREAS) {                                                                               \
        start = world.tmin;                                                                        \
        area = is_ray(world) ? area_of(areas, world.origin, world.direction) : INVALID;            \
        if (area != INVALID) {                                                                     \
            AreaRecord record = AreaRecords(areas.areas).v[area];                                  \
            current = record.root;                                                                 \
            until = leave_area(record, world.origin, world.direction);                             \
        }                                                                                          \
    }

// Distance at which the ray enters a box, or INFINITY for a miss.
float enter_box(vec3 lo, vec3 hi, vec3 origin, vec3 inverse, float tmin, float tmax) {
    vec3 t0 = (lo - origin) * inverse;
    vec3 t1 = (hi - origin) * inverse;
    vec3 n = MIN(t0, t1);
    vec3 f = MAX(t0, t1);
    float near = MAX(MAX(n.x, n.y), MAX(n.z, tmin));
    float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, tmax);
    return near <= far ? near : INFINITY;
}

void main() {
    uint part = part_of_dispatch();
    uint next = part * (LANES * RAYS_PER_LANE) + gl_LocalInvocationID.x;
    uint end = min((part + 1u) * (LANES * RAYS_PER_LANE), ray_count());
    if (next >= end) return;

    SceneRoot root = SceneRoot(push.scene);
    uvec2 nodes = root.nodes;
    uvec2 primitives = root.primitives;
    InstanceRecords instances = InstanceRecords(root.instances);
    AreasRecord areas = AreasRecord(root.areas);

    // Some CPU drivers leave any loop after 65,535 iterations. Rays that are not done when the loop ends stay unfinished: they are
    // counted where hits are delivered, and the host reports them.
    uint stack[STACK_SIZE];
#ifndef STREAM_ANY
    float stack_near[STACK_SIZE];
#endif
    uint depth = 0u;

    Ray world = load_ray(push.rays, next);
    Shear shear = make_shear(world.direction);
    vec3 origin = world.origin;
    vec3 direction = world.direction;
    vec3 inverse = safe_inverse(world.direction);
    uint instance = 0u;
    bool in_group = SINGLE_LEVEL;
    uint current;
    float best = world.tmax;
    uint best_instance = INVALID;
    uint best_primitive = INVALID;
    vec2 best_uv = vec2(0.0);

    // the influence area whose tree is traversed, if any, and where the ray leaves it
    uint area = INVALID;
    float until = 0.0, start = 0.0;
    BEGIN_RAY

    while (true) {
        if (current < LAST_NODE) {
            uint at = BINARY_NODE_PAIRS * (current & NODE_NUMBER);
            vec2 w0 = LOAD_FLOATS(nodes, at), w1 = LOAD_FLOATS(nodes, at + 1u), w2 = LOAD_FLOATS(nodes, at + 2u);
            vec2 w3 = LOAD_FLOATS(nodes, at + 3u), w4 = LOAD_FLOATS(nodes, at + 4u), w5 = LOAD_FLOATS(nodes, at + 5u);
            uvec2 w6 = LOAD_PAIR(nodes, at + 6u);
            float near0 = enter_box(BINARY_NODE_BOXES_0(vec3), BINARY_NODE_BOXES_1(vec3), origin, inverse, BOX_START, best);
            float near1 = enter_box(BINARY_NODE_BOXES_2(vec3), BINARY_NODE_BOXES_3(vec3), origin, inverse, BOX_START, best);
            bool swap;
            if (BY_DIRECTION) {
                uint axis = current >> AXIS_SHIFT;
                float along = axis == 0u ? direction.x : axis == 1u ? direction.y : direction.z;
                // a child that is missed never comes first
                swap = near1 < INFINITY && (along < 0.0 || near0 == INFINITY);
            } else {
                swap = near1 < near0;
            }
            float first = swap ? near1 : near0;
            float second = swap ? near0 : near1;
            current = first < INFINITY ? (swap ? BINARY_NODE_CHILDREN.y : BINARY_NODE_CHILDREN.x) : NEXT;
            if (second < INFINITY) {
                stack[depth] = swap ? BINARY_NODE_CHILDREN.x : BINARY_NODE_CHILDREN.y;
#ifndef STREAM_ANY
                stack_near[depth] = second;
#endif
                depth++;
            }
        }
        if ((current & LEAF) != 0u) {
            bool in_area = HAS_AREAS && area != INVALID;
            if (SINGLE_LEVEL || in_group || in_area) {
                uint i = current & NODE_NUMBER;
                vec3 own_origin = origin, own_direction = direction;
                Shear own_shear = shear;
                if (!SINGLE_LEVEL && in_area) {
                    // an area's tree is over primitives of all instances, whose tests are those of their own space
                    instance = Words(areas.instances).v[i - areas.first_primitive];
                    InstanceRecord record = instances.v[instance];
                    own_direction = transform_vector(record.world_to_group, world.direction);
                    own_origin = transform_point(record.world_to_group, world.origin);
                    own_shear = make_shear(own_direction);
                }
                uint primitive;
                float t;
                vec2 uv;
                bool met = meets_record(primitives, i, instance, own_shear, own_origin, own_direction, world.tmin, best, primitive, t, uv);
                if (met) {
                    best = t;
                    best_instance = instance;
                    best_primitive = primitive;
                    best_uv = uv;
                }
                // the next primitive of the leaf: index plus one, remaining count minus one
                current = (current & 0x78000000u) == 0u ? NEXT : current + 1u - 0x08000000u;
#ifdef STREAM_ANY
                if (met) {
                    current = FINISHED;
                    depth = 0u;
                }
#endif
            } else {
                instance = current & NODE_NUMBER;
                InstanceRecord record = instances.v[instance];
                direction = transform_vector(record.world_to_group, world.direction);
                origin = transform_point(record.world_to_group, world.origin);
                shear = make_shear(direction);
                inverse = safe_inverse(direction);
                in_group = true;
                stack[depth] = LEAVE_INSTANCE;
#ifndef STREAM_ANY
                stack_near[depth] = world.tmin;
#endif
                depth++;
                current = record.root;
            }
        }
        if (!SINGLE_LEVEL && current == LEAVE_INSTANCE) {
            origin = world.origin;
            direction = world.direction;
            inverse = safe_inverse(world.direction);
            in_group = false;
            current = NEXT;
        }
        if (current == NEXT) {
            if (depth == 0u) {
                current = FINISHED;
            } else {
                depth--;
#ifdef STREAM_ANY
                current = stack[depth];
#else
                // boxes beyond the nearest hit so far are skipped
                current = stack_near[depth] <= best ? stack[depth] : NEXT;
#endif
            }
        }
        if (HAS_AREAS && current == FINISHED && area != INVALID) {
            // within the area nothing is missing from its tree; beyond it, something may be closer than a hit out there
            bool is_done = best <= until;
#ifdef STREAM_ANY
            is_done = is_done || best_primitive != INVALID;
#endif
            area = INVALID;
            if (!is_done) {
                start = max(until * BEFORE_LEAVING, world.tmin);
                current = root.root;
            }
        }
        if (current == FINISHED) {
            bool met = best_primitive != INVALID;
#ifdef STREAM_ANY
            store_any(root.launch_hits, next, met);
#else
            store_closest(root.launch_hits, next, met ? best : INFINITY, best_instance, best_primitive, best_uv);
#endif
            next += LANES;
            if (next >= end) break;
            world = load_ray(push.rays, next);
            shear = make_shear(world.direction);
            origin = world.origin;
            direction = world.direction;
            inverse = safe_inverse(world.direction);
            instance = 0u;
            in_group = SINGLE_LEVEL;
            depth = 0u;
            best = world.tmax;
            best_primitive = INVALID;
            BEGIN_RAY
        }
    }
}

#endif
