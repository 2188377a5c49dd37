// Last step of a launch of the fast kernel: delivers the hits to the stream.
#ifndef TRACE_DELIVER
#define TRACE_DELIVER
#include "trace/callback.glsl"
#include "trace/launch.glsl"
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = ray_of_dispatch();
    if (k >= ray_count()) return;
    SceneRoot root = SceneRoot(push.scene);
    if (!is_finished(root, k)) {
        deliver_miss(push.first + k);
        return;
    }
#ifdef STREAM_ANY
    any(push.first + k, load_any(root, k));
#else
    closest(push.first + k, load_closest(root, k));
#endif
}

#endif
