// The film in device memory, and the pass that adds the samples of a launch to it, one thread per pixel, in the order of the samples: sums do not depend on how
// the samples were divided into launches, nor on the order of tracing.
//
// The including shader defines FilmPixel and Film, which are one of the records below, and `add_sample`. Sums are compensated (Kahan 1965), so a million samples keep their precision.
#ifndef COMMON_FILM
#define COMMON_FILM
#include "common/camera.glsl"
#include "interface/film.glsl"

layout(local_size_x = LANES) in;

// x: sum, y: its rounding error.
vec2 kahan_add(vec2 sum, float x) {
    precise float y = x - sum.y;
    precise float t = sum.x + y;
    precise float c = t - sum.x;
    precise float compensation = c - y;
    return vec2(t, compensation);
}

void add_value(inout FilmPixel pixel, uint channel, float value) {
    pixel.sum[channel] = kahan_add(pixel.sum[channel], value);
    pixel.sum_squares[channel] = kahan_add(pixel.sum_squares[channel], value * value);
}

// Adds sample k of the launch to its pixel. Returns whether that changed the pixel.
bool add_sample(inout FilmPixel pixel, FilmParams p, uint k);

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count >> push.sample_bits) return;
    FilmParams p = FilmParams(push.pass);
    Film film = Film(p.film);
    uint at = pixel_index(push.first) + k;
    FilmPixel pixel = film.v[at];
    bool changed = false;
    for (uint s = 0u; s < 1u << push.sample_bits; s++) {
        if (add_sample(pixel, p, (k << push.sample_bits) + s)) changed = true;
    }
    if (changed) film.v[at] = pixel;
}

#endif
