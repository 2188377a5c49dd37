// A metal: microfacets that reflect by the exact Fresnel term. Part of bsdf/bsdf.glsl.
#ifndef BSDF_CONDUCTOR_
#define BSDF_CONDUCTOR_

BsdfValue conductor_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || !(wi.z > 0.0)) return NO_VALUE;
    vec3 m = normalize(wo + wi);
    vec3 f = fresnel_conductor(dot(wo, m), b.f0, b.k);
    f *= b.tint * (distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi) / (4.0 * wo.z));
    return BsdfValue(f, reflected_pdf(b.facets, wo, m));
}

BsdfSample conductor_sample(Bsdf b, vec3 wo, vec2 u) {
    if (is_smooth(b.facets)) return BsdfSample(vec3(-wo.xy, wo.z), b.tint * fresnel_conductor(wo.z, b.f0, b.k), 1.0, true, 1.0);
    vec3 m = sample_microfacet(b.facets, wo, u);
    vec3 wi = 2.0 * dot(wo, m) * m - wo;
    return wi.z > 0.0 ? proposed(wi, 1.0) : NO_SAMPLE;
}

#endif
