// primary: one camera ray per sample, jittered within its pixel; where it meets the scene, the occlusion ray that leaves from
// there is appended to the queue (ao/sample.glsl). A sample without a hit has no further cost.
#include "ao/hemisphere.glsl"
#include "ao/sample.glsl"
#include "common/pixel_filter.glsl"
#include "common/warp.glsl"

// The index is that of the block.
Ray camera_sample(BlockParams p, uint index) {
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return no_ray();
    pixel += p.block_origin;
    vec2 u = sample_2d(p.seed, pixel, sample_index(index), CAMERA_FILM);
    if (p.pixel_filter != FILTER_BOX) u = 0.5 + filter_offset(p.pixel_filter, u);
    return camera_ray(p, vec2(pixel) + u);
}

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = camera_sample(p, index);
    dump_ray(p.ray_dump, index, r);
    return r;
}

Ray sample_occlusion(BlockParams p, uint index, Surface s) {
    Hemisphere h = hemisphere_at(p, s);
    uvec2 pixel = block_pixel(p, pixel_index(index)) + p.block_origin;
    vec3 w = to_world(h.axis, cosine_hemisphere(sample_2d(p.seed, pixel, sample_index(index), AO_DIRECTION)));
    return occlusion_ray(s.position, s.offset, h.ng, w, p.radius);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    if (!is_hit(hit)) {
        dump_ray(p.occlusion_dump, index, no_ray());
        return;
    }
    // the point on a triangle follows from its corners; only a sphere needs the ray again
    Surface s = surface_at(HAS_SPHERES ? camera_sample(p, index) : no_ray(), hit);
    Ray r = sample_occlusion(p, index, s);
    dump_ray(p.occlusion_dump, index, r);
    append_ray(p.queue, r, index - push.first);
}
