// The compute tracer's kernel without a BVH: every ray against every primitive of every instance. For tests, as the simplest implementation,
// and to show what a BVH saves. generate.glsl has made the rays, and deliver.glsl passes the hits on.
#ifndef TRACE_BRUTE
#define TRACE_BRUTE
#include "scene/scene.glsl"
#include "trace/launch.glsl"
#include "trace/primitive.glsl"
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

// The host rejects scenes whose loops would have more iterations than any driver runs (src/tracer/brute.rs).
void main() {
    uint k = ray_of_dispatch();
    if (k >= ray_count()) return;
    SceneRoot root = SceneRoot(push.scene);
    uvec2 primitives = root.primitives;
    Ray world = load_ray(push.rays, k);
    float best = world.tmax;
    uint best_instance = INVALID;
    uint best_primitive = INVALID;
    vec2 best_uv = vec2(0.0);

    // without a BVH, `root` is the number of instances, and `nodes` has the range of primitives of each
    uint instances = is_ray(world) ? root.root : 0u;
    for (uint instance = 0u; instance < instances; instance++) {
        uvec2 range = LOAD_PAIR(root.nodes, instance);
        vec3 origin = world.origin;
        vec3 direction = world.direction;
        if (!SINGLE_LEVEL) {
            InstanceRecord record = InstanceRecords(root.instances).v[instance];
            direction = transform_vector(record.world_to_group, world.direction);
            origin = transform_point(record.world_to_group, world.origin);
        }
        Shear shear = make_shear(direction);
        for (uint i = range.x; i < range.y; i++) {
            uint primitive;
            float t;
            vec2 uv;
            bool met = meets_record(primitives, i, instance, shear, origin, direction, world.tmin, best, primitive, t, uv);
            if (met) {
                best = t;
                best_instance = instance;
                best_primitive = primitive;
                best_uv = uv;
            }
#ifdef STREAM_ANY
            if (met) break;
#endif
        }
#ifdef STREAM_ANY
        if (best_primitive != INVALID) break;
#endif
    }
    bool met = best_primitive != INVALID;
#ifdef STREAM_ANY
    store_any(root.launch_hits, k, met);
#else
    store_closest(root.launch_hits, k, met ? best : INFINITY, best_instance, best_primitive, best_uv);
#endif
}

#endif
