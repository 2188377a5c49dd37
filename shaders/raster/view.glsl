// The rasterized geometry and its view. In a draw `push.pass` is a RasterParams, `push.rays` and `push.queued` are the group's vertices (or
// spheres) and indices, `push.first` the TLAS instance.
#ifndef RASTER_VIEW
#define RASTER_VIEW
#include "common/camera.glsl"
#include "interface/raster.glsl"
#include "scene/scene.glsl"

// Clip-space position of a point relative to the eye.
vec4 to_clip(vec3 d) {
    vec4 rows[4] = RasterParams(push.pass).clip;
    return vec4(dot(rows[0].xyz, d) + rows[0].w, dot(rows[1].xyz, d) + rows[1].w, dot(rows[2].xyz, d) + rows[2].w,
        dot(rows[3].xyz, d) + rows[3].w);
}

// A point of the group, relative to the eye. The translations are subtracted first, so that points near the eye keep their precision.
vec3 seen_from_eye(vec3 p) {
    vec3 eye = RasterParams(push.pass).eye;
    if (SINGLE_LEVEL) return p - eye;
    vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[push.first].group_to_world;
    return transform_vector(rows, p) + (vec3(rows[0].w, rows[1].w, rows[2].w) - eye);
}

// The exact ray through a fragment's pixel.
Ray pixel_ray(vec2 fragment) {
    RasterParams params = RasterParams(push.pass);
    BlockParams p = BlockParams(params.block);
    return camera_ray(p, vec2(uvec2(fragment) + p.block_origin) + params.at);
}

#endif
