// A metal: microfacets that reflect by the exact Fresnel term. Part of bsdf/bsdf.glsl.
#ifndef BSDF_CONDUCTOR_
#define BSDF_CONDUCTOR_

vec3 conductor_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || !(wi.z > 0.0)) return vec3(0.0);
    vec3 m = normalize(wo + wi);
    vec3 f = fresnel_conductor(dot(wo, m), b.f0, b.k);
    return b.tint * f * (distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi) / (4.0 * wo.z));
}

float conductor_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || !(wi.z > 0.0)) return 0.0;
    vec3 m = normalize(wo + wi);
    return microfacet_pdf(b.facets, wo, m) / (4.0 * max(dot(wo, m), 1e-30));
}

BsdfSample conductor_sample(Bsdf b, vec3 wo, vec2 u) {
    if (is_smooth(b.facets)) return BsdfSample(vec3(-wo.xy, wo.z), b.tint * fresnel_conductor(wo.z, b.f0, b.k), 1.0, true, 1.0);
    vec3 m = sample_microfacet(b.facets, wo, u);
    vec3 wi = 2.0 * dot(wo, m) * m - wo;
    float pdf = conductor_pdf(b, wo, wi);
    if (!(pdf > 0.0)) return NO_SAMPLE;
    return BsdfSample(wi, conductor_eval(b, wo, wi) / pdf, pdf, false, 1.0);
}

#endif
