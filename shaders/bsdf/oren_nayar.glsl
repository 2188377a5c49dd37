// Rough diffuse reflection that loses no energy: Oren and Nayar's qualitative model in Fujii's form, with the light that microfacets of more than one bounce
// return (Portsmouth, Kutz, Hill, "EON: A Practical Energy-Preserving Rough Diffuse BRDF", JCGT 14(1), 2025). `facets.alpha.x` is its r, 0 to 1. Part of bsdf/bsdf.glsl.
#ifndef BSDF_OREN_NAYAR_
#define BSDF_OREN_NAYAR_

// Names are the paper's.
const float FON_1 = 0.5 - 2.0 / (3.0 * PI);
const float FON_2 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

void oren_nayar_setup(inout Bsdf b, inout MaterialPoint point) {
    b.diffuse = point.base;
    b.facets.alpha = SHADING_OF(point.material).parameters;
}

bool oren_nayar_has_smooth_part(Bsdf b) { return false; }

bool oren_nayar_has_rough_part(Bsdf b) { return true; }

// Directional albedo of one bounce between white facets; a polynomial, within 0.1 %.
float fon_albedo(float mu, float r) {
    float x = 1.0 - mu;
    float g = x * (0.0571085289 + x * (0.491881867 + x * (-0.332181442 + x * 0.0714429953)));
    return (1.0 + r * g) / (1.0 + FON_1 * r);
}

vec3 oren_nayar_diffuse(Bsdf b, vec3 wo, vec3 wi) {
    if (!(wi.z > 0.0)) return vec3(0.0);
    float r = b.facets.alpha.x, s = dot(wi, wo) - wi.z * wo.z;
    float a = 1.0 / (1.0 + FON_1 * r);
    float single = a * (1.0 + r * (s > 0.0 ? s / max(wi.z, wo.z) : s));
    float mean = a * (1.0 + FON_2 * r);
    float lost = max(1.0 - fon_albedo(wo.z, r), 1e-7) * max(1.0 - fon_albedo(wi.z, r), 1e-7) / max(1.0 - mean, 1e-7);
    vec3 rho = b.diffuse, several = rho * mean / (1.0 - rho * (1.0 - mean));
    return (single + several * lost) * (wi.z / PI * shadowing(b.ng, FRAME_NORMAL, wi));
}

BsdfValue oren_nayar_eval(Bsdf b, vec3 wo, vec3 wi) {
    return BsdfValue(b.diffuse * oren_nayar_diffuse(b, wo, wi), max(wi.z, 0.0) / PI);
}

BsdfSample oren_nayar_sample(Bsdf b, vec3 wo, vec2 u, float v) { return proposed(cosine_hemisphere(u), 1.0); }

#endif
