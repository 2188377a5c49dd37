// A clear layer over everything else (KHR_materials_clearcoat): GGX of index 1.5 about a normal of its own. Part of bsdf/bsdf.glsl.
#ifndef BSDF_CLEARCOAT
#define BSDF_CLEARCOAT

float clearcoat_fresnel(float c) { return mix(0.04, 1.0, schlick_weight(c)); }

// Transmittance of the clearcoat for light from or to a direction: the product of both ways, so that the BSDF is reciprocal.
float clearcoat_transmits(Clearcoat clearcoat, vec3 w) {
    return 1.0 - clearcoat.weight * clearcoat_fresnel(abs(dot(clearcoat.normal, w)));
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
    float f = clearcoat.weight * clearcoat_fresnel(dot(o, m));
    float value = f * distribution(clearcoat.facets, m) * masking_shadowing(clearcoat.facets, o, i) / (4.0 * o.z);
    return BsdfValue(vec3(value), reflected_pdf(clearcoat.facets, o, m));
}

vec3 clearcoat_microfacet(Clearcoat clearcoat, vec3 wo, vec2 u) {
    vec3 n = clearcoat_normal(clearcoat, wo);
    if (is_smooth(clearcoat.facets)) return n;
    return to_world(n, sample_microfacet(clearcoat.facets, about(n, wo), u));
}

#endif
