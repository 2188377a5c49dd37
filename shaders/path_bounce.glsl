// path_bounce: the rays that `path_camera` or the bounce before left in a queue, and the vertices that they meet (shaders/path/path.glsl).
// stream: closest
// rays: queue
#include "path/path.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void closest(uint index, Hit hit) {
    BlockParams block = BlockParams(push.pass);
    PathParams p = PathParams(block.path);
    uint k = Words(p.tags).v[index];
    path_vertex(block, k, load_state(p.states, k), load_quad(p.radiance, k), load_ray(push.rays, index - push.first), hit);
}
