// glTF 2.0's metallic-roughness model (appendix B): Lambert under microfacets with Schlick's Fresnel term at the half vector. Part of
// bsdf/bsdf.glsl.
#ifndef BSDF_METALLIC_ROUGHNESS_
#define BSDF_METALLIC_ROUGHNESS_

float highest(vec3 c) { return max(c.r, max(c.g, c.b)); }

// Schlick's term averaged over where its microfacets are seen: what the choice between lobes goes by.
float specular_share(vec3 diffuse, vec3 f0, float f90, float cos_o) {
    float s = highest(fresnel_schlick(cos_o, f0, f90)), d = highest(diffuse) * (1.0 - s);
    return s + d > 0.0 ? s / (s + d) : 0.0;
}

vec3 metallic_roughness_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (!(wi.z > 0.0)) return vec3(0.0);
    vec3 m = normalize(wo + wi);
    vec3 f = fresnel_schlick(dot(wo, m), b.f0, b.f90);
    vec3 value = b.diffuse * (1.0 - highest(f)) * (wi.z / PI);
    if (!is_smooth(b.facets)) value += f * (distribution(b.facets, m) * masking_shadowing(b.facets, wo, wi) / (4.0 * wo.z));
    return value;
}

float metallic_roughness_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (!(wi.z > 0.0)) return 0.0;
    float pdf = (1.0 - b.specular_share) * wi.z / PI;
    if (!is_smooth(b.facets)) {
        vec3 m = normalize(wo + wi);
        pdf += b.specular_share * microfacet_pdf(b.facets, wo, m) / (4.0 * max(dot(wo, m), 1e-30));
    }
    return pdf;
}

BsdfSample metallic_roughness_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    vec3 wi;
    if (v < b.specular_share) {
        if (is_smooth(b.facets)) {
            return BsdfSample(vec3(-wo.xy, wo.z), fresnel_schlick(wo.z, b.f0, b.f90) / b.specular_share, b.specular_share, true, 1.0);
        }
        vec3 m = sample_microfacet(b.facets, wo, u);
        wi = 2.0 * dot(wo, m) * m - wo;
    } else {
        wi = cosine_hemisphere(u);
    }
    float pdf = metallic_roughness_pdf(b, wo, wi);
    if (!(pdf > 0.0)) return NO_SAMPLE;
    return BsdfSample(wi, metallic_roughness_eval(b, wo, wi) / pdf, pdf, false, 1.0);
}

#endif
