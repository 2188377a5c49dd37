// A metal: microfacets that reflect by the exact Fresnel term. Part of bsdf/bsdf.glsl.
#ifndef BSDF_CONDUCTOR_
#define BSDF_CONDUCTOR_

void conductor_setup(inout Bsdf b, inout MaterialPoint point) {
    uint m = point.material;
    float roughness = SHADING_OF(m).roughness;
    b.tint = SHADING_OF(m).specular_color;
    b.f0 = SHADING_OF(m).eta;
    b.k = SHADING_OF(m).k;
    b.facets = Microfacets(vec2(roughness * roughness), true);
    if (!HAS_COMPENSATION || is_smooth(b.facets)) return;
    // gives back what microfacets of one bounce lose (docs/reference/materials.md, Energy)
    float e = beckmann_albedo(point.cos_o, roughness);
    b.tint *= 1.0 + fresnel_conductor(1.0, b.f0, b.k) * ((1.0 - e) / e);
}

bool conductor_has_smooth_part(Bsdf b) { return is_smooth(b.facets); }

bool conductor_has_rough_part(Bsdf b) { return !is_smooth(b.facets); }

BsdfValue conductor_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b.facets) || !(wi.z > 0.0)) return NO_VALUE;
    vec3 m = normalize(wo + wi);
    vec3 f = fresnel_conductor(dot(wo, m), b.f0, b.k);
    f *= b.tint * (distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi) / (4.0 * wo.z));
    return BsdfValue(f * shadowing(b.ng, FRAME_NORMAL, wi), reflected_pdf(b.facets, wo, m));
}

vec3 conductor_diffuse(Bsdf b, vec3 wo, vec3 wi) { return vec3(0.0); }

BsdfSample conductor_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    if (is_smooth(b.facets)) return BsdfSample(vec3(-wo.xy, wo.z), b.tint * fresnel_conductor(wo.z, b.f0, b.k), 1.0, true, 1.0);
    vec3 m = sample_microfacet(b.facets, wo, u);
    vec3 wi = 2.0 * dot(wo, m) * m - wo;
    return wi.z > 0.0 ? proposed(wi, 1.0) : NO_SAMPLE;
}

#endif
