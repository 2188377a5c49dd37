// path_resolve: adds the paths of a launch to the film (common/film.glsl).
#define FilmPixel RgbFilmPixel
#define Film RgbFilm
#include "common/film.glsl"
#include "path/params.glsl"

bool add_sample(inout FilmPixel pixel, FilmParams p, uint k) {
    vec4 sample_ = load_quad(p.samples, k);
    sample_.rgb *= occluded_share(p.occludes_all, sample_);
    // also false for NaN
    if (!(max(abs(sample_.r), max(abs(sample_.g), abs(sample_.b))) < 1e30)) {
        pixel.not_finite++;
        return true;
    }
    for (uint c = 0u; c < 3u; c++) add_value(pixel, c, sample_[c]);
    pixel.covered += sample_.a > 0.0 ? 1u : 0u;
    return true;
}
