// A clear layer over everything else (KHR_materials_clearcoat): GGX of index 1.5 about a normal of its own. Part of bsdf/gltf.glsl.
#ifndef BSDF_CLEARCOAT
#define BSDF_CLEARCOAT

float clearcoat_fresnel(float c) { return mix(0.04, 1.0, schlick_weight(c)); }

// Factor of what the clearcoat reflects seen at this cosine: with energy compensation it gives back what its microfacets reflect more than once.
float clearcoat_gain(Clearcoat clearcoat, float c) {
    if (!HAS_COMPENSATION || is_smooth(clearcoat.facets)) return 1.0;
    float e = ggx_albedo(c, sqrt(clearcoat.facets.alpha.x));
    return 1.0 + 0.04 * ((1.0 - e) / e);
}

// Share of light from a direction at this cosine that the clearcoat reflects, compensated.
float clearcoat_albedo(Clearcoat clearcoat, float c) {
    if (is_smooth(clearcoat.facets)) return clearcoat_fresnel(c);
    float roughness = sqrt(clearcoat.facets.alpha.x);
    return clearcoat_gain(clearcoat, c) * ggx_albedo(c, roughness) * mix(0.04, 1.0, ggx_schlick_weight(c, roughness));
}

// Share of light that crosses the clearcoat on its way from wi to what is below, and on to wo. The product of both ways makes the BSDF reciprocal. With energy compensation,
// which does not, it is what the clearcoat does not reflect, so that nothing is lost between the layers.
float clearcoat_transmits(Clearcoat clearcoat, vec3 wo, vec3 wi) {
    float o = abs(dot(clearcoat.normal, wo));
    if (HAS_COMPENSATION) return max(1.0 - clearcoat.weight * clearcoat_albedo(clearcoat, clamp(o, MIN_COSINE, 1.0)), 0.0);
    return (1.0 - clearcoat.weight * clearcoat_fresnel(o)) * (1.0 - clearcoat.weight * clearcoat_fresnel(abs(dot(clearcoat.normal, wi))));
}

// The clearcoat's normal, which faces the viewer but for rounding; then it is the frame's.
vec3 clearcoat_normal(Clearcoat clearcoat, vec3 wo) {
    return dot(clearcoat.normal, wo) > 0.0 ? clearcoat.normal : vec3(0.0, 0.0, 1.0);
}

vec3 about(vec3 n, vec3 w) {
    return vec3(dot(to_world(n, vec3(1.0, 0.0, 0.0)), w), dot(to_world(n, vec3(0.0, 1.0, 0.0)), w), dot(n, w));
}

BsdfValue clearcoat_at(Clearcoat clearcoat, vec3 wo, vec3 wi) {
    vec3 n = clearcoat_normal(clearcoat, wo);
    vec3 o = about(n, wo), i = about(n, wi);
    o.z = max(o.z, MIN_COSINE);
    if (!(i.z > 0.0)) return NO_VALUE;
    vec3 m = normalize(o + i);
    float f = clearcoat.weight * clearcoat_gain(clearcoat, min(o.z, 1.0)) * clearcoat_fresnel(dot(o, m));
    float value = f * distribution(clearcoat.facets, m) * masking_shadowing(clearcoat.facets, o, i) / (4.0 * o.z);
    return BsdfValue(vec3(value), reflected_pdf(clearcoat.facets, o, m));
}

vec3 clearcoat_microfacet(Clearcoat clearcoat, vec3 wo, vec2 u) {
    vec3 n = clearcoat_normal(clearcoat, wo);
    if (is_smooth(clearcoat.facets)) return n;
    return to_world(n, sample_microfacet(clearcoat.facets, about(n, wo), u));
}

#endif
