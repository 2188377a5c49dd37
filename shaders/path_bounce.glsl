// path_bounce: traces the rays that `path_camera` or the previous bounce appended to a queue, and shades their hits (shaders/path/path.glsl).
#include "path/path.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void closest(uint index, Hit hit) {
    BlockParams block = BlockParams(push.pass);
    PathParams p = path_params();
    uint k = Words(p.tags).v[index];
    PathState state = load_state(p, index);
    if (HAS_COVERAGE) {
        uvec2 pixel = path_pixel(block, state.index);
        next_ray_seed = ray_seed(block.seed, pixel, path_sample(state.index), state.depth + state.passes + 1u);
    }
    vec3 share = vec3(0.0);
    if (WITH_SIGNAL) share = arrived_share(p, k, hit);
    vec3 added = path_vertex(block, k, state, load_ray(push.rays, index - push.first), hit);
    if (WITH_SIGNAL && added * share != vec3(0.0)) add_diffuse(p, k, added * share);
    // most vertices add nothing
    if (added != vec3(0.0)) store_quad(p.radiance, k, load_quad(p.radiance, k) + vec4(added, 0.0));
}
