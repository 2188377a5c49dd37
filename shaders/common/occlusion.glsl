// Directions of a frame's occlusion rays: the pass that traces them and the pass that sums them compute the same ones, so they need no memory.
#ifndef COMMON_OCCLUSION
#define COMMON_OCCLUSION
#include "common/frame.glsl"
#include "common/sequence.glsl"
#include "common/warp.glsl"
#include "interface/passes.glsl"

vec2 direction_sample(FrameParams f, uvec2 pixel, uint k) {
    // what is ordered over the image counts the pixels that are sampled, what is ordered over time the frames in which they are
    if (f.sequence == SEQUENCE_BLUE) {
        uvec2 cell = f.pattern == PATTERN_QUARTER ? pixel >> 1 : f.pattern == PATTERN_CHECKER ? uvec2(pixel.x >> 1, pixel.y) : pixel;
        return sequence_2d(f.sequence, f.seed, cell, f.frame, k, f.rays_per_pixel);
    }
    return sequence_2d(f.sequence, f.seed, pixel, f.frame >> f.pattern, k, f.rays_per_pixel);
}

// Of ray k of a pixel in this frame: over the cosine-weighted hemisphere (pbrt-v4's AOIntegrator). `ng`: its geometric normal.
vec3 occlusion_direction(FrameParams f, uvec2 pixel, uint at, vec3 ng, uint k) {
    vec3 axis = is_null(f.axes) ? ng : load_vec3(f.axes, at);
    return to_world(axis, cosine_hemisphere(direction_sample(f, pixel, k)));
}

#endif
