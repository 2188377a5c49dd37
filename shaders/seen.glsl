// seen: how many of the surfaces that another image shows, of another size or of the next frame, this image has seen in its last frame.
#include "common/reprojection.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) buffer SeenCounts { uint v[]; };

// of the work-group
shared uint counts[2];

// Returns true if this image shows the surface of a pixel of the other one.
bool is_seen(FrameParams f, uint at, uvec2 guide) {
    vec3 position = is_null(f.previous_position) ? surface_position(f, at) : load_vec3(f.previous_position, at), normal = surface_normal(f, at);
    vec2 before;
    if (!previous_place(f, position, before)) return false;
    EdgeTest edge = with_normal(previous_edge(f, position, normal, before), guide);
    Taps taps = taps_around(f, before, before, edge, guide.y >> 24);
    return taps.weight[0] + taps.weight[1] + taps.weight[2] + taps.weight[3] >= MIN_TAP_WEIGHT;
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    if (lane < 2u) counts[lane] = 0u;
    barrier();
    SeenParams p = SeenParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    if (gl_GlobalInvocationID.x < push.count) {
        uint at = push.first + gl_GlobalInvocationID.x * p.stride;
        uvec2 guide = LOAD_PAIR(f.guide, at);
        if (is_surface(guide)) {
            atomicAdd(counts[0], 1u);
            if (is_seen(f, at, guide)) atomicAdd(counts[1], 1u);
        }
    }
    barrier();
    if (lane < 2u) atomicAdd(SeenCounts(p.counts).v[lane], counts[lane]);
}
