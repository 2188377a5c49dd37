// path_reflection: the G-buffer's rays behind mirrors and glass (shaders/path/guide.glsl).
#include "path/guide.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    SurfacesParams q = SurfacesParams(behind_block(0u));
    guide_vertex(p, Words(q.tags).v[index], load_guide_ray(q, index), load_ray(push.rays, index - push.first), hit);
}
