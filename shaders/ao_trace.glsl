// ao_trace: the occlusion rays of a frame (ao/sample.glsl), from the surface of each pixel that is sampled in this frame. Background pixels have none, nor have pixels whose history is long enough
// in a static view. Compiled twice: with a falloff the nearest hit counts by its distance, without one any hit is enough.
#include "ao/sample.glsl"
#include "common/occlusion.glsl"

Ray ray(uint index) {
    AoTraceParams p = AoTraceParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uint place = index, k = 0u;
    // CPUs divide one lane at a time
    if (f.rays_per_pixel > 1u) {
        place = index / f.rays_per_pixel;
        k = index - place * f.rays_per_pixel;
    }
    uvec2 pixel = tile_pixel(f, place);
    if (any(greaterThanEqual(pixel, f.size))) return no_ray();
    uint at = image_index(f, pixel);
    if (!has_rays(f, pixel, at)) return no_ray();
    claim(p.ray_count);
    vec3 ng = surface_normal(f, at);
    vec3 w = occlusion_direction(f, pixel, at, ng, k);
    return occlusion_ray(surface_position(f, at), spawn_offset_at(f, at), ng, w, f.reach);
}

void add_sample(uint index, float visibility) {
    AoTraceParams p = AoTraceParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    if (f.rays_per_pixel > 1u) {
        FloatImage(p.samples).v[index - push.first] = visibility;
        return;
    }
    uvec2 pixel = tile_pixel(f, index);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    // nothing reads the values of background pixels
    if (!is_sampled(f, pixel) || is_resting(f, at)) return;
    STORE_PAIR(p.current, at, pack_estimate(Estimate(visibility, 1.0, 0.0)));
    if (!is_null(p.current_bent)) {
        store_vec3(p.current_bent, at, visibility * occlusion_direction(f, pixel, at, surface_normal(f, at), 0u));
    }
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 0.0 : 1.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, 1.0 - occlusion_of(FrameParams(AoTraceParams(push.pass).frame).falloff_log2, hit));
}
#endif
