// accessibility: the occlusion rays of a frame. From the surface of each pixel that is sampled in this frame they go over the
// cosine-weighted hemisphere (pbrt-v4's AOIntegrator). Pixels that show nothing have none, and neither have those that know enough
// while nothing moves. Built twice: with a falloff the nearest hit counts by its distance, without one any hit will do.
// stream: any closest
#include "common/frame.glsl"
#include "common/sequence.glsl"
#include "common/warp.glsl"

vec2 direction_sample(FrameParams f, uvec2 pixel, uint k) {
    // what is ordered over the image counts the pixels that are sampled, what is ordered over time the frames in which they are
    if (f.sequence == SEQUENCE_BLUE) {
        uvec2 cell = f.pattern == PATTERN_QUARTER ? pixel >> 1 : f.pattern == PATTERN_CHECKER ? uvec2(pixel.x >> 1, pixel.y) : pixel;
        return sequence_2d(f.sequence, f.seed, cell, f.frame, k, f.rays_per_pixel);
    }
    return sequence_2d(f.sequence, f.seed, pixel, f.frame >> f.pattern, k, f.rays_per_pixel);
}

Ray ray(uint index) {
    FrameParams f = FrameParams(push.pass);
    uvec2 pixel = tile_pixel(f, index / f.rays_per_pixel);
    if (any(greaterThanEqual(pixel, f.size))) return no_ray();
    uint at = image_index(f, pixel);
    if (!has_rays(f, pixel, at)) return no_ray();
    claim(f.ray_count);
    vec3 ng = surface_normal(f, at);
    vec3 axis = is_null(f.axes) ? ng : load_vec3(f.axes, at);
    vec3 w = to_world(axis, cosine_hemisphere(direction_sample(f, pixel, index % f.rays_per_pixel)));
    // about a shading normal some directions are below the surface: they start there, and meet its inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(surface_position(f, at) + ng * (side * spawn_offset_at(f, at)), 0.0, w, f.reach);
}

void add_sample(uint index, float accessibility) {
    FrameParams f = FrameParams(push.pass);
    if (f.rays_per_pixel > 1u) {
        FloatImage(f.samples).v[index - push.first] = accessibility;
        return;
    }
    uvec2 pixel = tile_pixel(f, index);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    if (has_rays(f, pixel, at)) STORE_PAIR(f.current, at, pack_estimate(Estimate(accessibility, 1.0, 0.0)));
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 0.0 : 1.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, is_hit(hit) ? 1.0 - exp2(-hit.t * FrameParams(push.pass).falloff_log2) : 1.0);
}
#endif
