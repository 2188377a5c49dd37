// seen: how many of the surfaces that another image shows, mostly of another size, this image has seen in its last frame.
#include "common/reprojection.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) buffer SeenCounts { uint v[]; };

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    SeenParams p = SeenParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) return;
    atomicAdd(SeenCounts(p.counts).v[0], 1u);
    vec3 position = surface_position(f, at), normal = surface_normal(f, at);
    vec2 before;
    if (!previous_place(f, position, before)) return;
    Taps taps = taps_around(f, before, before, previous_edge(f, position, normal, before), guide.y >> 24);
    float weight = taps.weight[0] + taps.weight[1] + taps.weight[2] + taps.weight[3];
    if (weight >= MIN_TAP_WEIGHT) atomicAdd(SeenCounts(p.counts).v[1], 1u);
}
