// Last step of a launch: delivers the hits to the stream. Where another pass has traced the same rays, it is the only step, and the stream finds
// their hits itself: known_hit(), by the index of a ray.
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
#ifdef KNOWN_HITS
    if (HITS_ARE_KNOWN) {
        hit = known_hit(push.first + k);
    } else
#endif
    if (is_finished(root, k)) {
        hit = load_closest(root, k);
    }
    closest(push.first + k, hit);
#endif
}

#endif
