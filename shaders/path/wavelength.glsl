// Wavelengths of paths that dispersive volumes refract (KHR_materials_dispersion). A path has all wavelengths until such a volume sends one of them another way than
// the others: from there on it has the one that its sampler chose, and the colour of that, whose mean over all is white.
#ifndef PATH_WAVELENGTH
#define PATH_WAVELENGTH
#include "path/shading.glsl"

// Fraunhofer's line d, for which materials say their index of refraction, and the ends of what paths have; all in micrometres. Below 475 nanometres light is
// blue, at 549 green, and above 623 red: near the dominant wavelengths of the primaries of sRGB.
const float D_LINE = 0.5876;
const vec2 WAVELENGTHS = vec2(0.438, 0.660);
// Where all wavelengths are reflected alike, but for such a share of the light, what is reflected keeps all.
const float ALIKE = 0.005;

// Index of refraction by Cauchy's equation.
float index_at(uint medium, float wavelength) {
    float b = SHADING_OF(medium).dispersion;
    return max(SHADING_OF(medium).ior + b * (1.0 / (wavelength * wavelength) - 1.0 / (D_LINE * D_LINE)), 1.0);
}

// Linear RGB of one wavelength out of an even mixture whose sum is white; x: its place among all, 0 to 1. Triangles and ramps that add up to 3 everywhere and
// have a mean of 1 each.
vec3 color_of_wavelength(float x) {
    float blue = clamp(1.5 - 3.0 * x, 0.0, 1.0), red = clamp(3.0 * x - 1.5, 0.0, 1.0);
    return 3.0 * vec3(red, 1.0 - red - blue, blue);
}

// How a boundary disperses a path.
struct Dispersion {
    bool is_there;
    vec3 weight;  // of a path that has one wavelength from here on
    vec2 etas;    // relative indices of refraction at both ends
};

const Dispersion NO_DISPERSION = Dispersion(false, vec3(1.0), vec2(1.0));

// Does light of all wavelengths that comes from w leave towards the viewer alike?
bool stays_white(Dispersion d, vec3 ng, vec3 towards_viewer, vec3 w) {
    if (!d.is_there) return true;
    if (!(dot(ng, w) > 0.0)) return false;
    float cosine = clamp(dot(towards_viewer, normalize(towards_viewer + w)), 0.0, 1.0), cos_t;
    return abs(fresnel_dielectric(cosine, d.etas.x, cos_t) - fresnel_dielectric(cosine, d.etas.y, cos_t)) < ALIKE;
}

#endif
