// A clear layer over everything else (KHR_materials_clearcoat): GGX of index 1.5 about a normal of its own. Part of bsdf/bsdf.glsl.
#ifndef BSDF_COAT
#define BSDF_COAT

float coat_fresnel(float c) { return mix(0.04, 1.0, schlick_weight(c)); }

// What the coat lets through on the way from or to a direction: both ways count, so that they may be exchanged.
float coat_transmits(Coat coat, vec3 w) {
    return 1.0 - coat.weight * coat_fresnel(abs(dot(coat.normal, w)));
}

// The coat's normal, which faces the viewer but for rounding; then it is the frame's.
vec3 coat_normal(Coat coat, vec3 wo) {
    return dot(coat.normal, wo) > 0.0 ? coat.normal : vec3(0.0, 0.0, 1.0);
}

vec3 about(vec3 n, vec3 w) {
    return vec3(dot(to_world(n, vec3(1.0, 0.0, 0.0)), w), dot(to_world(n, vec3(0.0, 1.0, 0.0)), w), dot(n, w));
}

BsdfValue coat_at(Coat coat, vec3 wo, vec3 wi) {
    vec3 n = coat_normal(coat, wo);
    vec3 o = about(n, wo), i = about(n, wi);
    o.z = max(o.z, LEAST_COSINE);
    if (!(i.z > 0.0)) return NO_VALUE;
    vec3 m = normalize(o + i);
    float f = coat.weight * coat_fresnel(dot(o, m));
    float value = f * distribution(coat.facets, m) * masking_shadowing(coat.facets, o, i) / (4.0 * o.z);
    return BsdfValue(vec3(value), reflected_pdf(coat.facets, o, m));
}

vec3 coat_microfacet(Coat coat, vec3 wo, vec2 u) {
    vec3 n = coat_normal(coat, wo);
    if (is_smooth(coat.facets)) return n;
    return to_world(n, sample_microfacet(coat.facets, about(n, wo), u));
}

#endif
