// denoise: the mean of radiance over a pixel's neighbours on the same surface (common/filter.glsl), all channels with the same weights.
#include "common/frame.glsl"
#include "interface/passes.glsl"

layout(local_size_x = LANES) in;

// Mean and number of samples, and variance of one sample; a RadianceRecord in memory.
struct RadianceEstimate {
    vec3 mean;
    float samples;
    vec3 variance;
};

#define VALUE vec3
#define ESTIMATE RadianceEstimate

// One sample has no variance: then all differences within the box count as noise.
const float PRIOR_SAMPLES = 4.0;
// a pixel without neighbours on its surface has samples of its own
const float LONELY = 0.0;

uint filtered_pixel() { return push.first + gl_GlobalInvocationID.x; }

RadianceEstimate load_estimate(uvec2 estimates, uint at) {
    vec4 a = uintBitsToFloat(Quads(estimates).v[2u * at]), b = uintBitsToFloat(Quads(estimates).v[2u * at + 1u]);
    return RadianceEstimate(a.xyz, a.w, b.xyz);
}

// The normals in guides are shading normals here, because lighting depends on them. The eight bits beside them are equal for
// pixels that may be averaged.
bool is_neighbour(EdgeTest edge, vec2 offset, uvec2 own_guide, uvec2 guide) {
    vec3 own = unpackSnorm4x8(own_guide.y).xyz;
    return (own_guide.y ^ guide.y) >> 24 == 0u && on_plane(edge, offset, guide) && dot(own, unpackSnorm4x8(guide.y).xyz) >= edge.cosine;
}

vec3 prior_variance(vec3 mean, vec3 spread, float samples) { return spread * samples; }

float total(vec3 value) { return value.r + value.g + value.b; }

void finish(FilterParams p, FrameParams f, uint at, RadianceEstimate e, vec3 bent) {
    QuadImage to = QuadImage(p.to);
    to.v[2u * at] = floatBitsToUint(vec4(e.mean, e.samples));
    to.v[2u * at + 1u] = floatBitsToUint(vec4(e.variance, 0.0));
}

void finish_nothing(FilterParams p, FrameParams f, uint at) { finish(p, f, at, RadianceEstimate(vec3(0.0), 0.0, vec3(0.0)), vec3(0.0)); }

RadianceEstimate guess(FilterParams p, FrameParams f, uvec2 estimates, ivec2 pixel, RadianceEstimate own) { return own; }

#include "common/filter.glsl"
