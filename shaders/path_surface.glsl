// path_surface: one camera ray for each pixel, and the first vertex of its way to the surface that the G-buffer shows (shaders/path/guide.glsl).
#include "path/guide.glsl"

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = centre_ray(p, index);
    // where alpha is stochastic, the surface that the pixel's first sample finds
    if (HAS_COVERAGE && is_ray(r)) r.tmin = tmin_of_seed(ray_seed(p.seed, block_pixel(p, pixel_index(index)) + p.block_origin, push.sample_index, 0u));
    return r;
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return;
    guide_vertex(p, image_index(FrameParams(SurfacesParams(behind_block(0u)).frame), pixel), GUIDE_START, centre_ray(p, index), hit);
}
