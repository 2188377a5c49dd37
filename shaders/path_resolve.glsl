// path_resolve: adds the paths of a launch to the film, a thread a pixel, in the order of the samples: sums do not depend on how the samples
// were cut into launches, nor on which was traced first.
#include "common/film.glsl"
#include "path/params.glsl"

layout(local_size_x = LANES) in;

// Mirrors RgbPixel in src/render/film.rs.
struct FilmPixel {
    vec2 sum[3];
    vec2 sum_squares[3];
    uint covered;     // samples whose camera ray met something
    uint not_finite;  // samples that were left out
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Film { FilmPixel v[]; };

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count >> push.sample_bits) return;
    BlockParams p = BlockParams(push.pass);
    uvec2 radiance = PathParams(p.path).radiance;
    Film film = Film(p.film);
    uint at = pixel_index(push.first) + k;
    FilmPixel pixel = film.v[at];
    for (uint s = 0u; s < 1u << push.sample_bits; s++) {
        vec4 sample_ = load_quad(radiance, (k << push.sample_bits) + s);
        // also what is not a number
        if (!(max(abs(sample_.r), max(abs(sample_.g), abs(sample_.b))) < 1e30)) {
            pixel.not_finite++;
            continue;
        }
        for (uint c = 0u; c < 3u; c++) {
            pixel.sum[c] = kahan_add(pixel.sum[c], sample_[c]);
            pixel.sum_squares[c] = kahan_add(pixel.sum_squares[c], sample_[c] * sample_[c]);
        }
        pixel.covered += sample_.a > 0.0 ? 1u : 0u;
    }
    film.v[at] = pixel;
}
