// uncovered: lists the pixels sampled in this frame whose surface was not seen in the previous image, by the tests of `radiance_temporal`. They have more paths than others.
#include "common/reprojection.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

// The number of pixels, a part of the number that show a surface, and each pixel: where it is among those that are sampled in a frame.
layout(buffer_reference, std430, buffer_reference_align = 4) buffer PixelList { uint v[]; };

bool is_uncovered(FrameParams f, uint at, uvec2 guide) {
    vec3 position = surface_position(f, at), normal = surface_normal(f, at);
    vec3 before = is_null(f.previous_position) ? position : load_vec3(f.previous_position, at);
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

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count) return;
    ListParams p = ListParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 pixel = sampled_pixel(f, tile_pixel(k >> 6, p.tiles_x, k & 63u));
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (f.has_history == 0u || !is_surface(guide)) return;
    PixelList list = PixelList(p.list);
    if (k % LIST_PART == 0u) atomicAdd(list.v[1], 1u);
    if (is_uncovered(f, at, guide)) list.v[2u + atomicAdd(list.v[0], 1u)] = k;
}
