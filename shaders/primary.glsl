// primary: one camera ray per sample, jittered within its pixel; where it meets the scene, the occlusion ray that leaves from
// there is appended to the queue: one over the cosine-weighted hemisphere (pbrt-v4's AOIntegrator). A sample that meets nothing
// costs nothing from here on.
#include "common/camera.glsl"
#include "common/warp.glsl"
#include "scene/surface.glsl"

// The index is of the block.
Ray camera_sample(BlockParams p, uint index) {
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return no_ray();
    pixel += p.block_origin;
    return camera_ray(p, vec2(pixel) + sample_2d(p.seed, pixel, sample_index(index), CAMERA_FILM));
}

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = camera_sample(p, index);
    dump_ray(p.ray_dump, index, r);
    return r;
}

Ray occlusion_ray(BlockParams p, uint index, Surface s) {
    // the side that the viewer sees; ns is on the side of ng
    float facing = dot(s.ng, view_direction(p, s.position)) > 0.0 ? -1.0 : 1.0;
    vec3 ng = facing * s.ng;
    vec3 axis = p.hemisphere != 0u ? facing * s.ns : ng;
    uvec2 pixel = block_pixel(p, pixel_index(index)) + p.block_origin;
    vec3 w = to_world(axis, cosine_hemisphere(sample_2d(p.seed, pixel, sample_index(index), AO_DIRECTION)));
    // about a shading normal some directions are below the surface: they start there, and meet its inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(s.position + ng * (side * s.offset), 0.0, w, p.radius);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    if (!is_hit(hit)) {
        dump_ray(p.occlusion_dump, index, no_ray());
        return;
    }
    // the point on a triangle follows from its corners; only a sphere asks for the ray again
    Surface s = surface_at(HAS_SPHERES ? camera_sample(p, index) : no_ray(), hit);
    Ray r = occlusion_ray(p, index, s);
    dump_ray(p.occlusion_dump, index, r);
    append_ray(p.queue, r, index - push.first);
}
