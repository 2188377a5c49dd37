// resolve: adds the occlusion samples of a launch to the film (common/film.glsl).
#define FilmPixel ScalarFilmPixel
#define Film ScalarFilm
#include "common/film.glsl"

bool add_sample(inout FilmPixel pixel, FilmParams p, uint k) {
    float visibility = Floats(p.samples).v[k];
    // a sample without a hit counts as 0
    if (visibility < 0.0) return false;
    add_value(pixel, 0u, visibility);
    pixel.covered++;
    return true;
}
