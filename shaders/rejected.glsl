// rejected: a colour for why a pixel has no history, by the tests of `temporal`: where its surface was in the previous image, another one was seen, or none.
#include "common/reprojection.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer DisplayWords { uint v[]; };

// Colours, 8-bit RGBA, red in the lowest byte.
const uint BACKGROUND = 0xff000000u;
const uint KEPT = 0xff404040u;          // grey: there is a history
const uint NO_PAST = 0xffffffffu;       // white: there is no previous frame, or its history was discarded
const uint OFF_SCREEN = 0xffff6030u;    // blue: the surface was outside of the previous image
const uint INSTANCE = 0xff3030e0u;      // red: another instance was seen
const uint DEPTH = 0xff30c030u;         // green: another depth, the background included
const uint NORMAL = 0xff30d0e0u;        // yellow: another normal
const uint NO_SAMPLES = 0xffd030d0u;    // magenta: the same surface was seen, and had no samples yet

bool has_samples(FrameParams f, uint at) {
    // histories of radiance have samples wherever there is a surface
    return is_null(f.previous_history) || unpack_estimate(LOAD_PAIR(f.previous_history, at)).samples > 0.0;
}

uint reason(FrameParams f, uint at, uvec2 guide) {
    if (f.has_history == 0u) return NO_PAST;
    if (f.still != 0u) return has_samples(f, at) ? KEPT : NO_SAMPLES;
    vec3 position = surface_position(f, at), normal = surface_normal(f, at);
    vec3 before = is_null(f.previous_position) ? position : load_vec3(f.previous_position, at);
    vec2 place;
    if (!previous_place(f, before, place)) return OFF_SCREEN;
    EdgeTest edge = previous_edge(f, before, normal, place);
    Taps taps = taps_around(f, place, place, edge, guide.y >> 24);
    bool is_same = false;
    float weight = 0.0;
    [[unroll]] for (int k = 0; k < 4; k++) {
        if (taps.weight[k] == 0.0) continue;
        is_same = true;
        if (has_samples(f, taps.at[k])) weight += taps.weight[k];
    }
    if (weight >= MIN_TAP_WEIGHT) return KEPT;
    if (is_same) return NO_SAMPLES;
    // the pixel that would have counted most
    ivec2 nearest = ivec2(round(place));
    if (any(lessThan(nearest, ivec2(0))) || any(greaterThanEqual(nearest, ivec2(f.size)))) return OFF_SCREEN;
    uvec2 seen = LOAD_PAIR(f.previous_guide, image_index(f, uvec2(nearest)));
    if (!is_surface(seen)) return DEPTH;
    if (seen.y >> 24 != guide.y >> 24) return INSTANCE;
    return on_plane(edge, vec2(nearest) - place, seen) ? NORMAL : DEPTH;
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    DebugParams p = DebugParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    DisplayWords(p.words).v[at] = is_surface(guide) ? reason(f, at, guide) : BACKGROUND;
}
