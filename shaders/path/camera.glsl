// Camera rays of paths, and the state with which a path begins.
#ifndef PATH_CAMERA
#define PATH_CAMERA
#include "common/pixel_filter.glsl"
#include "path/path.glsl"

// Where a ray through a lens starts, and where it goes: to the point that the ray through the lens' middle meets in the plane of focus.
Ray lens_ray(BlockParams p, Ray r, vec2 u) {
    PathParams path = path_params();
    vec4 rows[3] = p.camera_to_world;
    vec3 right = vec3(rows[0].x, rows[1].x, rows[2].x), up = vec3(rows[0].y, rows[1].y, rows[2].y), back = vec3(rows[0].z, rows[1].z, rows[2].z);
    vec2 lens = path.lens_radius * concentric_disk(u).xy;
    vec3 sharp = r.origin + r.direction * (path.focus / -dot(r.direction, back));
    r.origin += right * lens.x + up * lens.y;
    r.direction = normalize(sharp - r.origin);
    return r;
}

// What a ray straight onto a point of a surface hits.
Hit hit_of_point(BakePoint point) { return Hit(0.0, point.instance, point.primitive, point.u, point.v); }

// That ray, from the front; none where a pixel has no point.
Ray ray_onto(BakePoint point) {
    if (point.instance == INVALID) return no_ray();
    Surface s = surface_at(no_ray(), hit_of_point(point));
    return Ray(s.position, 0.0, -s.ng, INFINITY);
}

Ray camera_sample(BlockParams p, uint index) {
    if (!in_block(p, block_pixel(p, path_cell(index)))) return no_ray();
    if (WITH_SURFACE_POINTS) return ray_onto(path_point(p, index));
    uvec2 pixel = path_pixel(p, index);
    if (WITH_SIGNAL && any(greaterThanEqual(pixel, p.image_size))) return no_ray();
    vec2 u = sample_2d(p.seed, pixel, path_sample(index), CAMERA_FILM);
    // In motion all pixels of a frame have their samples at the same place, where its G-buffer has them: histories are of surfaces. At rest, where a frame has several, each has a place of its own, as in a still.
    vec2 offset = WITH_SIGNAL && p.pixel_filter == FILTER_CENTRE ? p.centre_offset : !WITH_SIGNAL && WITH_PIXEL_FILTER ? filter_offset(p.pixel_filter, u) : u - 0.5;
    Ray r = unclipped_camera_ray(p, vec2(pixel) + 0.5 + offset);
    if (HAS_COVERAGE) r.tmin = tmin_of_seed(ray_seed(p.seed, pixel, path_sample(index), 0u));
    if (WITH_LENS) r = lens_ray(p, r, sample_2d(p.seed, pixel, path_sample(index), CAMERA_LENS));
    return clip_ray(p, r);
}

// The state of a path whose camera ray has this index and direction.
PathState camera_state(BlockParams p, PathParams path, uint index, vec3 direction) {
    // divided by the albedo, so that one bounce gives ambient visibility; Russian roulette uses the throughput without this factor
    float scale = WITH_CONSTANT_ALBEDO ? path.albedo : 1.0;
    PathState state = PathState(vec3(1.0 / scale), -1.0, index, 0u, 0u, false, scale, NO_MEDIUM);
    if (WITH_MEDIA) {
        state.medium = current_medium(path.camera_media);
        // clipping planes hide surfaces, not what the camera is in
        state.throughput *= transmittance(state.medium, clipped_length(p, direction));
    }
    return state;
}

#endif
