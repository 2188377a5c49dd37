// path_megakernel: paths from the camera ray to their end in one kernel, for scenes of few leaves on CPU drivers. The state of a path stays in registers, where the wavefront
// (path_camera, path_bounce, path_shadow) hands it on in memory: there a store is made lane by lane.
//
// The lanes of a subgroup go on in step: each traces a ray, shades what it hits, and traces a ray to a light. A lane whose path has ended takes the next one of its
// subgroup, so that all have work. Rays are traced without a hierarchy (trace/few.glsl): in one, those of a subgroup would wait for the slowest of them (docs/design/tracers.md).
//
// A path makes the rays of the wavefront with the same numbers, and adds what they bring in the same order: images are the same to the bit.
#define KEEPS_CORNERS
#define PATH_IN_REGISTERS
#include "trace/few.glsl"
#include "trace/reduce.glsl"
#include "trace/spread.glsl"
#include "path/camera.glsl"

layout(local_size_x = LANES) in;

void main() {
    BlockParams p = BlockParams(push.pass);
    PathParams path = path_params();
    uvec2 few = path.few;
    uint few_count = path.few_count;
    uint lane = gl_SubgroupInvocationID;

    // the subgroup's paths, and the first that no lane has taken
    uint begin = (part_of_dispatch() * LANES + gl_SubgroupID * SUBGROUP_SIZE) * RAYS_PER_LANE;
    uint end = min(begin + SUBGROUP_SIZE * RAYS_PER_LANE, push.count);
    uint next = begin;

    // the path of this lane
    bool has_path = false;
    uint k = 0u;
    PathState state;
    Ray ray = no_ray();
    vec4 radiance = vec4(0.0);
    uint rays = 0u;
    uint start = INVALID;  // the flat leaf that its ray starts on
    // of all of its paths
    uint bounce_rays = 0u, shadow_rays = 0u, longest = 0u;

    while (true) {
        uint waiting = or_over_lanes(has_path ? 0u : 1u << lane);
        if (waiting != 0u) {
            if (next >= end && waiting == (1u << SUBGROUP_SIZE) - 1u) break;
            uint taken = next + bitCount(waiting & ((1u << lane) - 1u));
            next += bitCount(waiting);
            if (!has_path && taken < end) {
                k = taken;
                uint index = push.first + k;
                ray = camera_sample(p, index);
                has_path = is_ray(ray);
                if (!has_path) store_quad(path.radiance, k, vec4(0.0));
                state = camera_state(p, path, index, ray.direction);
                radiance = vec4(0.0);
                rays = 0u;
                start = INVALID;
            }
        }

        Ray traced = ray;
        if (!has_path) traced = no_ray();
        Hit hit = few_closest(few, few_count, traced, start);
        // within a volume that scatters a ray may start anywhere
        start = !HAS_SCATTERING && (path.few_flat >> hit_slot & 1u) != 0u ? hit_slot : INVALID;
        clear_left_rays();
        if (has_path) {
            if (HAS_COVERAGE) next_ray_seed = ray_seed(p.seed, path_pixel(p, state.index), path_sample(state.index), state.depth + state.passes + 1u);
            vec3 added = path_vertex(p, k, state, ray, hit);
            if (rays == 0u) radiance = vec4(added, is_hit(hit) ? 1.0 : 0.0);
            else if (added != vec3(0.0)) radiance += vec4(added, 0.0);
        }

        // a loop, so that drivers compile its body once; places in arrays stay constants
        [[dont_unroll]] for (uint i = 0u; i < LIGHT_RAYS; i++) {
            bool has_ray = i == 0u ? has_light_ray[0] : has_light_ray[1];
            Ray to_light = no_ray();
            if (has_ray) {
                if (i == 0u) to_light = light_rays[0];
                else to_light = light_rays[1];
            }
            bool occluded = few_any(few, few_count, to_light, start);
            if (has_ray) shadow_rays++;
            if (has_ray && !occluded) radiance += vec4(i == 0u ? light_contributions[0] : light_contributions[1], WITH_CATCHER && i == 0u ? light_coverage : 0.0);
        }

        if (has_path) {
            has_path = has_next_ray && rays < path.max_rays;
            if (has_path) {
                ray = next_ray;
                state = next_state;
                rays++;
                bounce_rays++;
                longest = max(longest, rays);
            } else {
                store_quad(path.radiance, k, radiance);
            }
        }
    }
    atomicAdd(QueueCount(path.counts).v[0], bounce_rays);
    atomicAdd(QueueCount(path.counts).v[1], shadow_rays);
    atomicMax(QueueCount(path.counts).v[2], longest);
}
