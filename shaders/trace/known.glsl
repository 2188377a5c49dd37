// No tracer: another pass has traced the same rays. The stream finds their hits itself: known_hit(), by the index of a ray.
#ifndef TRACE_KNOWN
#define TRACE_KNOWN
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = ray_of_dispatch();
    if (k >= ray_count()) return;
    closest(push.first + k, known_hit(push.first + k));
}

#endif
