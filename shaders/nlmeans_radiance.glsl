// nlmeans_radiance: non-local means of an image of radiance (common/nlmeans.glsl), each of whose pixels is red, green, blue, and their variances' sum.
#include "common/types.glsl"
#include "interface/denoise.glsl"

layout(local_size_x = LANES) in;

#define VALUE vec3
#define BLOCK int(NLMEANS_RADIANCE_BLOCK)

vec3 load_value(uvec2 image, uint at, out float variance) {
    vec4 quad = load_quad(image, at);
    variance = quad.a;
    return quad.rgb;
}

float squared(vec3 value) { return dot(value, value); }

void store_value(uvec2 image, uint at, vec3 value) { store_quad(image, at, vec4(value, 0.0)); }

#include "common/nlmeans.glsl"
