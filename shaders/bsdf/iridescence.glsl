// A thin film over the interface of a glTF material (KHR_materials_iridescence): Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
// Iridescence", SIGGRAPH 2017. Part of bsdf/gltf.glsl.
//
// Light is reflected at the film's upper face, or after any number of reflections between its faces; the parts interfere. Their sum is a series of cosines of the phase, which
// is integrated over wavelengths in closed form: the spectral sensitivities of the eye are sums of Gaussians, whose Fourier transforms are Gaussians (the paper's section 4).
#ifndef BSDF_IRIDESCENCE
#define BSDF_IRIDESCENCE

// Orders of interference that are summed: the third is a few thousandths at most.
const int FILM_ORDERS = 2;

// Below this thickness, in nanometres, a film fades into nothing: none is seen.
const float FILM_FADES = 30.0;

// Fourier transform of the sensitivities of CIE X, Y and Z for an optical path difference in nanometres and a phase shift, in linear sRGB. Of a difference of 0 it is 1.
vec3 film_sensitivity(float path_difference, vec3 shift) {
    // the Gaussians' area, mean and variance over the wave number, of the paper's fit; X has a second one
    const vec3 AREA = vec3(5.4856e-13, 4.4201e-13, 5.2481e-13), MEAN = vec3(1.6810e6, 1.7953e6, 2.2084e6), VARIANCE = vec3(4.3278e9, 9.3046e9, 6.6121e9);
    const float AREA_2 = 9.7470e-14, MEAN_2 = 2.2399e6, VARIANCE_2 = 4.5282e9;
    // what the sums come to without interference
    const float WHITE = 1.0685e-7;
    const mat3 TO_SRGB = mat3(3.2404542, -0.9692660, 0.0556434, -1.5371385, 1.8760108, -0.2040259, -0.4985314, 0.0415560, 1.0572252);
    float phase = 2.0 * PI * path_difference * 1e-9, phase2 = phase * phase;
    vec3 xyz = AREA * sqrt(2.0 * PI * VARIANCE) * cos(MEAN * phase + shift) * exp(-phase2 * VARIANCE);
    xyz.x += AREA_2 * sqrt(2.0 * PI * VARIANCE_2) * cos(MEAN_2 * phase + shift.x) * exp(-phase2 * VARIANCE_2);
    return TO_SRGB * (xyz / WHITE);
}

float reflectance_of_ior(float ratio) { return sqr((ratio - 1.0) / (ratio + 1.0)); }

// Reflectance of a film over what reflects f0 at normal incidence, by the cosine of light that comes from outside. 1 where nothing gets into the film.
vec3 film_fresnel(Film film, float cosine, vec3 f0) {
    float ior = mix(1.0, film.ior, smoothstep(0.0, FILM_FADES, film.thickness));
    float cos2 = 1.0 - (1.0 - sqr(cosine)) / sqr(ior);
    if (cos2 < 0.0) return vec3(1.0);
    float inside = sqrt(cos2);

    // the upper face, and the lower one with its phase shifts: half a wave where light comes to what is denser
    float upper = mix(reflectance_of_ior(ior), 1.0, schlick_weight(cosine)), crosses = 1.0 - upper;
    vec3 root = sqrt(min(f0, vec3(0.9999)));
    vec3 base_ior = (1.0 + root) / (1.0 - root), ratio = (base_ior - ior) / (base_ior + ior);
    vec3 lower = mix(ratio * ratio, vec3(1.0), schlick_weight(inside));
    vec3 shift = mix(vec3(0.0), vec3(PI), lessThan(base_ior, vec3(ior))) + (ior < 1.0 ? 0.0 : PI);

    // the sum over reflections: its mean over phases, then the orders of interference
    vec3 both = clamp(upper * lower, 1e-5, 0.9999), amplitude = sqrt(both);
    vec3 returned = crosses * crosses * lower / (1.0 - both);
    vec3 sum = upper + returned, order = returned - crosses;
    float path_difference = 2.0 * ior * film.thickness * inside;
    for (int m = 1; m <= FILM_ORDERS; m++) {
        order *= amplitude;
        sum += 2.0 * order * film_sensitivity(float(m) * path_difference, float(m) * shift);
    }
    // colours of pure wavelengths lie outside of sRGB
    return clamp(sum, 0.0, 1.0);
}

#endif
