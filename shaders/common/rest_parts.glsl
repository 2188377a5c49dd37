// The parts of which the samples at rest consist: what is filtered apart, and what is not filtered.
//
// The light of a pixel's samples, of which each has an albedo of its own, is the mean albedo times the mean of the diffuse part weighted by albedo: a ratio of two means. Likewise the rest is weighted by how much of the pixel has any.
//
// What is seen directly is the difference of the mean of all light and the two parts that are filtered. It is not filtered itself, so rounding errors, which are relative to the largest part, stay in the pixel: beside the sun they may be large against
// what a surface reflects.
#ifndef COMMON_REST_PARTS
#define COMMON_REST_PARTS
#include "common/radiance.glsl"
#include "common/rest.glsl"

struct RestParts {
    vec3 diffuse;             // times the albedo
    float diffuse_variance;   // of one sample, divided by the albedo; summed over channels
    vec3 albedo;
    float specular_variance;  // of one sample where there is a surface
    vec3 specular;            // neither diffuse nor seen directly
};

const RestParts NO_PARTS = RestParts(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0));

RestParts load_parts(uvec2 image, uint at) {
    vec4 a = load_quad(image, 3u * at), b = load_quad(image, 3u * at + 1u), c = load_quad(image, 3u * at + 2u);
    return RestParts(a.rgb, a.w, b.rgb, b.w, c.rgb);
}

void store_parts(uvec2 image, uint at, RestParts p) {
    store_quad(image, 3u * at, vec4(p.diffuse, p.diffuse_variance));
    store_quad(image, 3u * at + 1u, vec4(p.albedo, p.specular_variance));
    store_quad(image, 3u * at + 2u, vec4(p.specular, 0.0));
}

// Quotients; 0 where there is nothing to divide by.
vec3 ratio(vec3 a, vec3 b) { return mix(vec3(0.0), a / max(b, vec3(1e-20)), greaterThan(b, vec3(1e-6))); }

// The part that is seen directly.
vec3 direct_part(Rest rest, RestParts p) { return max(rest.mean - p.diffuse - p.specular, vec3(0.0)); }

// Adds the means over a frame's samples. before, after: the samples at rest without and with them.
RestParts add_parts(RestParts past, Rest before, Rest after, RestParts now, float now_coverage) {
    if (!(after.samples > before.samples)) return past;
    float n = after.samples - before.samples, share = n / after.samples;
    RestParts p = RestParts(mix(past.diffuse, now.diffuse, share), past.diffuse_variance, mix(past.albedo, now.albedo, share), past.specular_variance, mix(past.specular, now.specular, share));
    if (after.frames < 2.0) return p;
    // residuals about the ratio before and after (Welford 1962)
    vec3 d = ratio(now.diffuse - ratio(past.diffuse, past.albedo) * now.albedo, p.albedo), e = ratio(now.diffuse - ratio(p.diffuse, p.albedo) * now.albedo, p.albedo);
    p.diffuse_variance += (n * dot(d, e) - p.diffuse_variance) / (after.frames - 1.0);
    vec3 c = vec3(after.coverage);
    d = ratio(now.specular - ratio(past.specular, vec3(before.coverage)) * now_coverage, c);
    e = ratio(now.specular - ratio(p.specular, c) * now_coverage, c);
    p.specular_variance += (n * dot(d, e) - p.specular_variance) / (after.frames - 1.0);
    return p;
}

// What is filtered, of the samples at rest: of those that met a surface, which at a silhouette may be few.
RadianceEstimate diffuse_at_rest(Rest rest, RestParts p) {
    if (all(lessThanEqual(p.albedo, vec3(1e-6)))) return NO_RADIANCE;
    return RadianceEstimate(ratio(p.diffuse, p.albedo), rest.samples * rest.coverage, vec3(max(p.diffuse_variance, 0.0) / 3.0), 0.0);
}

RadianceEstimate specular_at_rest(Rest rest, RestParts p) {
    if (rest.coverage <= 1e-6) return NO_RADIANCE;
    return RadianceEstimate(p.specular / rest.coverage, rest.samples * rest.coverage, vec3(max(p.specular_variance, 0.0) / 3.0), 0.0);
}

#endif
