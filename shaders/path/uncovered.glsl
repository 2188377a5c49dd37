// Pixels whose surface was not seen in the previous image, by the tests of `radiance_temporal`. They have more paths than others.
#ifndef PATH_UNCOVERED
#define PATH_UNCOVERED
#include "common/reprojection.glsl"

// The number of pixels, a part of the number that show a surface, and each pixel: where it is among those that are sampled in a frame.
layout(buffer_reference, std430, buffer_reference_align = 4) buffer PixelList { uint v[]; };

// `before`: where the surface was in the previous frame.
bool is_uncovered(FrameParams f, vec3 before, vec3 normal, uvec2 guide) {
    if (f.has_history == 0u) return false;
    vec2 place;
    if (!previous_place(f, before, place)) return true;
    EdgeTest edge = with_normal(previous_edge(f, before, normal, place), guide);
    vec2 around = place + f.previous_offset - f.offset;
    // of most pixels the nearest one shows the surface, and counts for a quarter at least
    ivec2 nearest = ivec2(round(around));
    if (all(greaterThanEqual(nearest, ivec2(0))) && all(lessThan(nearest, ivec2(f.size)))) {
        uvec2 seen = LOAD_PAIR(f.previous_guide, image_index(f, uvec2(nearest)));
        if (seen.y >> 24 == guide.y >> 24 && same_surface(edge, vec2(nearest) - place, seen)) return false;
    }
    Taps taps = taps_around(f, around, place, edge, guide.y >> 24);
    return taps.weight[0] + taps.weight[1] + taps.weight[2] + taps.weight[3] < MIN_TAP_WEIGHT;
}

#endif
