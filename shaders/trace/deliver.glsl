// Last step of a launch of the fast kernel: delivers the hits to the stream.
#ifndef TRACE_DELIVER
#define TRACE_DELIVER
#include "trace/launch.glsl"
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = ray_of_dispatch();
    if (k >= ray_count()) return;
    SceneRoot root = SceneRoot(push.scene);
    // one call for hits and misses: the stream's code, which may be all of a path's, is compiled once for each call
#ifdef STREAM_ANY
    any(push.first + k, is_finished(root, k) && load_any(root, k));
#else
    Hit hit = miss();
    if (is_finished(root, k)) hit = load_closest(root, k);
    closest(push.first + k, hit);
#endif
}

#endif
