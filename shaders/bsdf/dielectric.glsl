// Glass, water: microfacets that reflect and refract (Walter et al. 2007). Radiance is what is carried: refracted light is compressed by
// 1 / eta^2. Part of bsdf/bsdf.glsl.
#ifndef BSDF_DIELECTRIC_
#define BSDF_DIELECTRIC_

void dielectric_setup(inout Bsdf b, inout MaterialPoint point) {
    uint m = point.material;
    float roughness = SHADING_OF(m).roughness;
    b.tint = SHADING_OF(m).specular_color;
    b.transmitted = SHADING_OF(m).transmitted;
    b.eta = point.front ? SHADING_OF(m).ior : 1.0 / SHADING_OF(m).ior;
    b.facets = Microfacets(vec2(roughness * roughness), false);
    if (!HAS_COMPENSATION || is_smooth(b.facets)) return;
    // gives back what microfacets of one bounce lose (docs/reference/materials.md, Energy)
    DielectricAlbedo a = dielectric_albedo(dielectric_layer(m, point.front), point.cos_o, roughness, ggx_albedo(point.cos_o, roughness), 1.0);
    float gain = 1.0 / (a.reflected + a.transmitted);
    b.tint *= gain;
    b.transmitted *= gain;
}

bool dielectric_has_smooth_part(Bsdf b) { return is_smooth(b.facets); }

bool dielectric_has_rough_part(Bsdf b) { return !is_smooth(b.facets); }

BsdfValue dielectric_eval(Bsdf b, vec3 wo, vec3 wi) {
    float kept = shadowing(b.ng, FRAME_NORMAL, wi);
    if (is_smooth(b.facets) || wi.z == 0.0) return NO_VALUE;
    vec3 m = generalized_half(b.eta, wo, wi);
    if (m == vec3(0.0)) return NO_VALUE;
    float cos_t, om = dot(wo, m), im = dot(wi, m);
    float f = fresnel_dielectric(om, b.eta, cos_t);
    if (wi.z > 0.0) {
        float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi);
        return BsdfValue(b.tint * (f * d / (4.0 * wo.z)) * kept, f * reflected_pdf(b.facets, wo, m));
    }
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, vec3(wi.xy, -wi.z));
    return BsdfValue(b.transmitted * ((1.0 - f) * d * refracted_value(b.eta, wo.z, om, im)) * kept,
                     (1.0 - f) * refracted_pdf(b.facets, b.eta, wo, m, im));
}

vec3 dielectric_diffuse(Bsdf b, vec3 wo, vec3 wi) { return vec3(0.0); }

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
