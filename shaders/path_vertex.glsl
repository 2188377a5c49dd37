// path_vertex: traces rays of paths, and shades what they hit (shaders/path/path.glsl). The stream `path_camera` begins paths at camera rays, one per sample. The stream
// `path_bounce` traces the rays that it or the previous bounce appended to a queue. They share a shader, because nearly all of it is the code of a vertex.
#include "path/known_hit.glsl"
#include "path/camera.glsl"
#include "common/frame.glsl"

// Where a camera ray has been traced for the G-buffer, or where paths begin at points of surfaces.
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
    if (RAYS_ARE_QUEUED) return load_ray(push.rays, index - push.first);
    return camera_sample(BlockParams(push.pass), index);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    PathParams path = path_params();
    Ray r = ray(index);

    // the path's place, and its state before this vertex
    uint k;
    PathState state;
    if (RAYS_ARE_QUEUED) {
        k = Words(path.tags).v[index];
        state = load_state(path, index);
    } else {
        k = index - push.first;
        if (!is_ray(r)) {
            store_quad(path.radiance, k, vec4(0.0));
            return;
        }
        if (WITH_SIGNAL) clear_signal(path, k);
        state = camera_state(p, path, index, r.direction);
    }
    if (HAS_COVERAGE) next_ray_seed = ray_seed(p.seed, path_pixel(p, state.index), path_sample(state.index), state.depth + state.passes + 1u);

    // what the vertex adds: the first one to nothing
    vec3 share = vec3(0.0);
    if (WITH_SIGNAL && RAYS_ARE_QUEUED) share = arrived_share(path, k, hit);
    vec3 added = path_vertex(p, k, state, r, hit);
    if (RAYS_ARE_QUEUED) {
        if (WITH_SIGNAL && added * share != vec3(0.0)) add_diffuse(path, k, added * share);
        // most vertices add nothing
        if (added != vec3(0.0)) store_quad(path.radiance, k, load_quad(path.radiance, k) + vec4(added, 0.0));
    } else {
        float covered = is_hit(hit) ? 1.0 : 0.0;
        if (WITH_SIGNAL) {
            store_signal(path, k, SIGNAL_DIRECT, vec4(added, covered));
            added = vec3(0.0);
        }
        store_quad(path.radiance, k, vec4(added, covered));
    }
}
