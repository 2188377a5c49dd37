// denoise: the mean of radiance over a pixel's neighbours on the same surface (common/filter.glsl), all channels with the same weights.
#include "common/frame.glsl"
#include "interface/passes.glsl"

layout(local_size_x = LANES) in;

#include "common/radiance.glsl"

#define VALUE vec3
#define ESTIMATE RadianceEstimate

// One sample has no variance: then all differences within the box count as noise.
const float PRIOR_SAMPLES = 4.0;
// a pixel without neighbours on its surface has samples of its own
const float LONELY = 0.0;
// Samples from which a pixel's own variance counts more than that of its box: beside a glint's the box says that every pixel is as noisy.
const float OWN_VARIANCE_SAMPLES = 4.0;
// Noisy pixels in a box from which its variance counts more than a pixel's own: light that is rare everywhere has not yet reached some pixels, whose own samples then are all alike. Glints are few.
const float RARE_LIGHT_PIXELS = 8.0;

RadianceEstimate load_estimate(uvec2 estimates, uint at) { return load_radiance(estimates, at); }

RadianceEstimate estimate_of(RadianceEstimate own, vec3 mean, float n, vec3 variance) { return RadianceEstimate(mean, n, variance, own.narrowed); }

int limited(int radius, FilterParams p, RadianceEstimate own) { return min(radius, to_int(ceil((1.0 - own.narrowed) * float(p.radius)))); }

// A shadow that has come is as thin as it is: it is averaged within itself, and darkens nothing around it.
float filter_class(RadianceEstimate e) { return e.narrowed == LIGHT_DARKENED ? 1.0 : 0.0; }

// The normals in guides are shading normals here, because lighting depends on them. The eight bits beside them are equal for
// pixels that may be averaged.
bool is_neighbour(EdgeTest edge, vec2 offset, uvec2 own_guide, uvec2 guide, vec3 normal) {
    return (own_guide.y ^ guide.y) >> 24 == 0u && on_plane(edge, offset, guide) && dot(edge.normal, normal) >= edge.cosine;
}

vec3 edge_normal(vec3 normal, uvec2 guide) { return guide_normal(guide); }

vec3 prior_variance(vec3 mean, vec3 spread, float samples) { return spread * samples; }

const bool COUNTS_NOISY_PIXELS = true;

// By the fourth power of their number: a few samples that are all alike say little, and of many, whose glints are ten thousand times as bright as they, a thousandth is still too much of the box's.
vec3 noise_variance(RadianceEstimate own, vec3 variance, float noisy) {
    float q = own.samples / OWN_VARIANCE_SAMPLES, r = noisy / RARE_LIGHT_PIXELS;
    float known = q * q * q * q, rare = r * r * r * r;
    return mix(variance, own.variance, known / (known + 1.0) / (1.0 + rare));
}

float total(vec3 value) { return value.r + value.g + value.b; }

vec3 mean_of(vec3 sum, float n) { return sum / n; }

void finish(FilterParams p, FrameParams f, uint at, RadianceEstimate e, vec3 bent) {
    store_radiance(p.to, at, e);
}

void finish_nothing(FilterParams p, FrameParams f, uint at) { finish(p, f, at, NO_RADIANCE, vec3(0.0)); }

RadianceEstimate guess(FilterParams p, FrameParams f, uvec2 estimates, ivec2 pixel, RadianceEstimate own) { return own; }

#include "common/filter.glsl"
