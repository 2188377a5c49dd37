// accessibility: the occlusion rays of a frame. From the surface of each pixel that is sampled in this frame they go over the
// cosine-weighted hemisphere (pbrt-v4's AOIntegrator). Pixels that show nothing have none, and neither have those that know enough
// while nothing moves. Built twice: with a falloff the nearest hit counts by its distance, without one any hit will do.
#include "common/occlusion.glsl"

Ray ray(uint index) {
    FrameParams f = FrameParams(push.pass);
    uvec2 pixel;
    uint at, k;
    if (is_null(f.list)) {
        pixel = tile_pixel(f, index / f.rays_per_pixel);
        k = index % f.rays_per_pixel;
        if (any(greaterThanEqual(pixel, f.size))) return no_ray();
        at = image_index(f, pixel);
        if (!has_rays(f, pixel, at)) return no_ray();
    } else {
        uint entry = Words(f.list).v[index];
        at = entry >> 4;
        k = entry & 15u;
        pixel = uvec2(at % f.size.x, at / f.size.x);
    }
    claim(f.ray_count);
    vec3 ng = surface_normal(f, at);
    vec3 w = occlusion_direction(f, pixel, at, ng, k);
    // about a shading normal some directions are below the surface: they start there, and meet its inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(surface_position(f, at) + ng * (side * spawn_offset_at(f, at)), 0.0, w, f.reach);
}

void add_sample(uint index, float accessibility) {
    FrameParams f = FrameParams(push.pass);
    if (!is_null(f.list)) {
        uint entry = Words(f.list).v[index];
        FloatImage(f.samples).v[(entry >> 4) * f.most_rays + (entry & 15u)] = accessibility;
        return;
    }
    if (f.rays_per_pixel > 1u) {
        FloatImage(f.samples).v[index - push.first] = accessibility;
        return;
    }
    uvec2 pixel = tile_pixel(f, index);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    // what is written where nothing is, nobody reads
    if (!is_sampled(f, pixel) || is_resting(f, at)) return;
    STORE_PAIR(f.current, at, pack_estimate(Estimate(accessibility, 1.0, 0.0)));
    if (!is_null(f.current_bent)) {
        store_vec3(f.current_bent, at, accessibility * occlusion_direction(f, pixel, at, surface_normal(f, at), 0u));
    }
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
