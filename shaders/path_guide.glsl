// path_guide: finds the surface that the G-buffer shows at each pixel (shaders/path/guide.glsl). The stream `path_surface` begins its way at a camera ray; the stream
// `path_reflection` traces the rays behind mirrors and glass, which are in a queue. They share a shader.
#include "path/guide.glsl"

Ray ray(uint index) {
    if (RAYS_ARE_QUEUED) return load_ray(push.rays, index - push.first);
    BlockParams p = BlockParams(push.pass);
    Ray r = centre_ray(p, index);
    // where alpha is stochastic, the surface that the pixel's first sample finds
    if (HAS_COVERAGE && is_ray(r)) r.tmin = tmin_of_seed(ray_seed(p.seed, block_pixel(p, pixel_index(index)) + p.block_origin, push.sample_index, 0u));
    return r;
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    SurfacesParams q = SurfacesParams(behind_block(0u));

    // the pixel's place in the image, the way so far, and the ray that was traced
    uint at;
    GuideRay way = GUIDE_START;
    Ray r;
    if (RAYS_ARE_QUEUED) {
        at = Words(q.tags).v[index];
        way = load_guide_ray(q, index);
        r = load_ray(push.rays, index - push.first);
    } else {
        uvec2 pixel = block_pixel(p, pixel_index(index));
        if (!in_block(p, pixel)) return;
        at = image_index(FrameParams(q.frame), pixel);
        r = centre_ray(p, index);
    }
    guide_vertex(p, at, way, r, hit);
}
