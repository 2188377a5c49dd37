// path_camera: one camera ray per sample, and the first vertex of each path (shaders/path/path.glsl).
// stream: closest
// rays: coherent
#include "path/path.glsl"

Ray camera_sample(BlockParams p, uint index) {
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return no_ray();
    pixel += p.block_origin;
    return camera_ray(p, vec2(pixel) + sample_2d(p.seed, pixel, sample_index(index), CAMERA_FILM));
}

Ray ray(uint index) {
    return camera_sample(BlockParams(push.pass), index);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    uint k = index - push.first;
    Ray r = camera_sample(p, index);
    if (!is_ray(r)) {
        store_quad(PathParams(p.path).radiance, k, vec4(0.0));
        return;
    }
    PathParams path = PathParams(p.path);
    // divided by the albedo, so that what one bounce brings is the accessibility; survival goes by what paths carry without that
    float scale = path.white_sky != 0u ? path.albedo : 1.0;
    PathState state = PathState(vec3(1.0 / scale), -1.0, index, 0u, scale, 0u);
    path_vertex(p, k, state, vec4(0.0, 0.0, 0.0, is_hit(hit) ? 1.0 : 0.0), r, hit);
}
