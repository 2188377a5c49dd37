// Glass, water: microfacets that reflect and refract (Walter et al. 2007). Radiance is what is carried: refracted light is compressed by
// 1 / eta^2. Part of bsdf/bsdf.glsl.
#ifndef BSDF_DIELECTRIC_
#define BSDF_DIELECTRIC_

BsdfValue dielectric_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || wi.z == 0.0) return NO_VALUE;
    vec3 m = generalized_half(b.eta, wo, wi);
    if (m == vec3(0.0)) return NO_VALUE;
    float cos_t, om = dot(wo, m), im = dot(wi, m);
    float f = fresnel_dielectric(om, b.eta, cos_t);
    if (wi.z > 0.0) {
        float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi);
        return BsdfValue(b.tint * (f * d / (4.0 * wo.z)), f * reflected_pdf(b.facets, wo, m));
    }
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, vec3(wi.xy, -wi.z));
    return BsdfValue(b.transmitted * ((1.0 - f) * d * refracted_value(b.eta, wo.z, om, im)),
                     (1.0 - f) * refracted_pdf(b.facets, b.eta, wo, m, im));
}

BsdfSample dielectric_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    bool smooth_surface = is_smooth(b.facets);
    vec3 m = smooth_surface ? vec3(0.0, 0.0, 1.0) : sample_microfacet(b.facets, wo, u);
    float cos_t, om = dot(wo, m);
    if (!(om > 0.0)) return NO_SAMPLE;
    float f = fresnel_dielectric(om, b.eta, cos_t);
    bool reflects = v < f;
    vec3 wi = reflects ? 2.0 * om * m - wo : refracted(b.eta, wo, m, om, cos_t);
    float eta = reflects ? 1.0 : b.eta;
    if (smooth_surface) return BsdfSample(wi, reflects ? b.tint : b.transmitted / (b.eta * b.eta), reflects ? f : 1.0 - f, true, eta);
    return reflects == wi.z > 0.0 ? proposed(wi, eta) : NO_SAMPLE;
}

#endif
