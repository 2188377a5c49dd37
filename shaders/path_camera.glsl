// path_camera: one camera ray per sample, and the first vertex of each path (shaders/path/path.glsl).
#include "path/known_hit.glsl"
#include "path/camera.glsl"
#include "common/frame.glsl"

// Where it has been traced for the G-buffer, or where paths begin at points of surfaces.
Hit known_hit(uint index) {
    BlockParams p = BlockParams(push.pass);
    if (!in_block(p, block_pixel(p, path_cell(index)))) return miss();
    if (WITH_SURFACE_POINTS) return hit_of_point(path_point(p, index));
    uvec2 pixel = path_pixel(p, index);
    if (any(greaterThanEqual(pixel, p.image_size))) return miss();
    PathFrameParams f = path_frame_params();
    return load_known_hit(f.known_hits, image_index(FrameParams(f.frame), pixel));
}

Ray ray(uint index) {
    return camera_sample(BlockParams(push.pass), index);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    uint k = index - push.first;
    Ray r = camera_sample(p, index);
    if (!is_ray(r)) {
        store_quad(path_params().radiance, k, vec4(0.0));
        return;
    }
    PathParams path = path_params();
    if (WITH_SIGNAL) clear_signal(path, k);
    PathState state = camera_state(p, path, index, r.direction);
    if (HAS_COVERAGE) next_ray_seed = ray_seed(p.seed, path_pixel(p, index), path_sample(index), 1u);
    vec3 seen = path_vertex(p, k, state, r, hit);
    float covered = is_hit(hit) ? 1.0 : 0.0;
    if (WITH_SIGNAL) {
        store_signal(path, k, SIGNAL_DIRECT, vec4(seen, covered));
        seen = vec3(0.0);
    }
    store_quad(path.radiance, k, vec4(seen, covered));
}
