// First step of a launch of the fast kernel: the stream's rays, all lanes busy.
#ifndef TRACE_GENERATE
#define TRACE_GENERATE
#include "trace/launch.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k < push.count) store_ray(SceneRoot(push.scene), k, ray(push.first + k));
}

#endif
