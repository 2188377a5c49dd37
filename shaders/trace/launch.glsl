// Rays and results of one launch of the compute tracer's fast kernel, in memory between its three steps.
#ifndef TRACE_LAUNCH
#define TRACE_LAUNCH
#include "scene/scene.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) buffer LaunchRays { uvec4 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) buffer LaunchHits { uvec2 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer LaunchFlags { uint v[]; };

void store_ray(SceneRoot root, uint k, Ray r) {
    LaunchRays rays = LaunchRays(root.launch_rays);
    rays.v[2u * k] = floatBitsToUint(vec4(r.origin, r.tmin));
    rays.v[2u * k + 1u] = floatBitsToUint(vec4(r.direction, r.tmax));
}

// Stands where a result will be. Some CPU drivers leave any loop after 65,535 turns: a ray that this happens to keeps the mark,
// and is reported instead of delivering what an earlier launch left there.
const uint UNFINISHED = 0x7fc0dead;

void mark_unfinished(SceneRoot root, uint k) {
#ifdef STREAM_ANY
    LaunchFlags(root.launch_hits).v[k] = UNFINISHED;
#else
    LaunchHits(root.launch_hits).v[3u * k].x = UNFINISHED;
#endif
}

bool is_finished(SceneRoot root, uint k) {
#ifdef STREAM_ANY
    bool finished = LaunchFlags(root.launch_hits).v[k] != UNFINISHED;
#else
    bool finished = LaunchHits(root.launch_hits).v[3u * k].x != UNFINISHED;
#endif
    if (!finished) atomicAdd(LaunchFlags(root.unfinished).v[0], 1u);
    return finished;
}

void store_any(SceneRoot root, uint k, bool occluded) {
    LaunchFlags(root.launch_hits).v[k] = occluded ? 1u : 0u;
}

bool load_any(SceneRoot root, uint k) {
    return LaunchFlags(root.launch_hits).v[k] != 0u;
}

// The tracer's own ids; scene ids are found when the hit is delivered.
void store_closest(SceneRoot root, uint k, float t, uint instance, uint primitive, vec2 uv) {
    LaunchHits hits = LaunchHits(root.launch_hits);
    hits.v[3u * k] = uvec2(floatBitsToUint(t), instance);
    hits.v[3u * k + 1u] = uvec2(primitive, floatBitsToUint(uv.x));
    hits.v[3u * k + 2u] = uvec2(floatBitsToUint(uv.y), 0u);
}

Hit load_closest(SceneRoot root, uint k) {
    LaunchHits hits = LaunchHits(root.launch_hits);
    uvec2 a = hits.v[3u * k];
    if (uintBitsToFloat(a.x) == INFINITY) return miss();
    uvec2 b = hits.v[3u * k + 1u];
    return scene_hit(uintBitsToFloat(a.x), a.y, b.x, uintBitsToFloat(uvec2(b.y, hits.v[3u * k + 2u].x)));
}

#endif
