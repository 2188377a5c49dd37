// Hit buffer of a launch of the compute tracer's fast kernel, between its steps. The rays are at push.rays.
#ifndef TRACE_LAUNCH
#define TRACE_LAUNCH
#include "interface/hierarchy.glsl"
#include "scene/scene.glsl"

layout(buffer_reference, std430, buffer_reference_align = 8) buffer LaunchHits { uvec2 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer LaunchFlags { uint v[]; };

void mark_unfinished(SceneRoot root, uint k) {
#ifdef STREAM_ANY
    LaunchFlags(root.launch_hits).v[k] = UNFINISHED;
#else
    LaunchHits(root.launch_hits).v[LAUNCH_HIT_PAIRS * k].x = UNFINISHED;
#endif
}

bool is_finished(SceneRoot root, uint k) {
#ifdef STREAM_ANY
    bool finished = LaunchFlags(root.launch_hits).v[k] != UNFINISHED;
#else
    bool finished = LaunchHits(root.launch_hits).v[LAUNCH_HIT_PAIRS * k].x != UNFINISHED;
#endif
    if (!finished) atomicAdd(LaunchFlags(root.unfinished).v[0], 1u);
    return finished;
}

// `results`: SceneRoot.launch_hits, which a loop reads once.
void store_any(uvec2 results, uint k, bool occluded) {
    LaunchFlags(results).v[k] = occluded ? 1u : 0u;
}

bool load_any(SceneRoot root, uint k) {
    return LaunchFlags(root.launch_hits).v[k] != 0u;
}

// The tracer's own ids; they are converted to scene ids on delivery.
void store_closest(uvec2 results, uint k, float t, uint instance, uint primitive, vec2 uv) {
    STORE_PAIR(results, LAUNCH_HIT_PAIRS * k, uvec2(floatBitsToUint(t), instance));
    // the other fields of a miss are not read
    if (t == INFINITY) return;
    STORE_PAIR(results, LAUNCH_HIT_PAIRS * k + 1u, uvec2(primitive, floatBitsToUint(uv.x)));
    STORE_PAIR(results, LAUNCH_HIT_PAIRS * k + 2u, uvec2(floatBitsToUint(uv.y), 0u));
}

Hit load_closest(SceneRoot root, uint k) {
    uvec2 a = LOAD_PAIR(root.launch_hits, LAUNCH_HIT_PAIRS * k);
    if (uintBitsToFloat(a.x) == INFINITY) return miss();
    uvec2 b = LOAD_PAIR(root.launch_hits, LAUNCH_HIT_PAIRS * k + 1u);
    uvec2 c = LOAD_PAIR(root.launch_hits, LAUNCH_HIT_PAIRS * k + 2u);
    return scene_hit(uintBitsToFloat(a.x), a.y, b.x, uintBitsToFloat(uvec2(b.y, c.x)));
}

#endif
