// Glass, water: microfacets that reflect and refract (Walter et al. 2007). Radiance is what is carried: refracted light is compressed by
// 1 / eta^2. Part of bsdf/bsdf.glsl.
#ifndef BSDF_DIELECTRIC_
#define BSDF_DIELECTRIC_

// The microfacet normal that takes wi to wo, on the side of wo; zero where there is none.
vec3 generalized_half(Bsdf b, vec3 wo, vec3 wi) {
    vec3 m = wi.z > 0.0 ? wo + wi : wo + b.eta * wi;
    float m2 = dot(m, m);
    if (m2 == 0.0) return vec3(0.0);
    m *= inversesqrt(m2) * (m.z < 0.0 ? -1.0 : 1.0);
    // back-facing microfacets
    return dot(wo, m) > 0.0 && dot(wi, m) * wi.z > 0.0 ? m : vec3(0.0);
}

vec3 dielectric_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || wi.z == 0.0) return vec3(0.0);
    vec3 m = generalized_half(b, wo, wi);
    if (m == vec3(0.0)) return vec3(0.0);
    float cos_t, om = dot(wo, m), im = dot(wi, m);
    float f = fresnel_dielectric(om, b.eta, cos_t);
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, vec3(wi.xy, abs(wi.z)));
    if (wi.z > 0.0) return b.tint * (f * d / (4.0 * wo.z));
    return b.transmitted * ((1.0 - f) * d * abs(im * om) / (wo.z * sqr(om + b.eta * im)));
}

float dielectric_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || wi.z == 0.0) return 0.0;
    vec3 m = generalized_half(b, wo, wi);
    if (m == vec3(0.0)) return 0.0;
    float cos_t, om = dot(wo, m), im = dot(wi, m);
    float f = fresnel_dielectric(om, b.eta, cos_t);
    float pdf = microfacet_pdf(b.facets, wo, m);
    return wi.z > 0.0 ? f * pdf / (4.0 * om) : (1.0 - f) * pdf * b.eta * b.eta * abs(im) / sqr(om + b.eta * im);
}

BsdfSample dielectric_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    bool smooth_surface = is_smooth(b.facets);
    vec3 m = smooth_surface ? vec3(0.0, 0.0, 1.0) : sample_microfacet(b.facets, wo, u);
    float cos_t, om = dot(wo, m);
    if (!(om > 0.0)) return NO_SAMPLE;
    float f = fresnel_dielectric(om, b.eta, cos_t);
    bool reflects = v < f;
    vec3 wi = reflects ? 2.0 * om * m - wo : (om / b.eta - cos_t) * m - wo / b.eta;
    if (smooth_surface) {
        float pdf = reflects ? f : 1.0 - f;
        return BsdfSample(wi, reflects ? b.tint : b.transmitted / (b.eta * b.eta), pdf, true, reflects ? 1.0 : b.eta);
    }
    if (reflects != wi.z > 0.0) return NO_SAMPLE;
    float pdf = dielectric_pdf(b, wo, wi);
    if (!(pdf > 0.0)) return NO_SAMPLE;
    return BsdfSample(wi, dielectric_eval(b, wo, wi) / pdf, pdf, false, reflects ? 1.0 : b.eta);
}

#endif
