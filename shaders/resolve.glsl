// resolve: adds the samples of a launch to the film, a thread a pixel, in the order of the samples: sums do not depend on how the
// samples were cut into launches, nor on which of them was traced first.
#include "common/camera.glsl"
#include "common/film.glsl"

layout(local_size_x = LANES) in;

struct FilmPixel {
    vec2 sum;          // of accessibility, and its compensation
    vec2 sum_squares;  // likewise
    uint covered;      // samples that met the scene; the others count 0 and are not written
    uint reserved;
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Film { FilmPixel v[]; };

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count >> push.sample_bits) return;
    BlockParams p = BlockParams(push.pass);
    Floats samples = Floats(p.samples);
    Film film = Film(p.film);
    uint at = pixel_index(push.first) + k;
    FilmPixel pixel = film.v[at];
    uint covered = pixel.covered;
    for (uint s = 0u; s < 1u << push.sample_bits; s++) {
        float accessibility = samples.v[(k << push.sample_bits) + s];
        if (accessibility < 0.0) continue;
        pixel.sum = kahan_add(pixel.sum, accessibility);
        pixel.sum_squares = kahan_add(pixel.sum_squares, accessibility * accessibility);
        pixel.covered++;
    }
    if (pixel.covered != covered) film.v[at] = pixel;
}
