// filter: the mean of ambient visibility over a pixel's neighbours on the same surface, and of bent normals with the same weights
// (common/filter.glsl).
#include "common/frame.glsl"
#include "interface/passes.glsl"

layout(local_size_x = LANES) in;

#define VALUE float
#define ESTIMATE Estimate

// With few samples the variance is taken to be that of samples that are 0 or 1: the maximum.
const float PRIOR_SAMPLES = 4.0;
const float LONELY = 6.0;

Estimate load_estimate(uvec2 estimates, uint at) { return unpack_estimate(LOAD_PAIR(estimates, at)); }

float filter_class(Estimate e) { return 0.0; }

bool is_neighbour(EdgeTest edge, vec2 offset, uvec2 own_guide, uvec2 guide, vec3 normal) { return same_surface(edge, offset, guide, normal); }

vec3 edge_normal(vec3 normal, uvec2 guide) { return normal; }

float prior_variance(float mean, float spread, float samples) { return mean * (1.0 - mean); }

const bool COUNTS_NOISY_PIXELS = false;

// Variances of samples that are 0 or 1 follow the mean: a pixel that happened to see no occluder has none.
float noise_variance(Estimate own, float variance, float noisy) { return variance; }

float total(float value) { return value; }

float mean_of(float sum, float n) { return share_of(sum, n); }

Estimate estimate_of(Estimate own, float mean, float n, float variance) { return Estimate(mean, n, variance); }

int limited(int radius, FilterParams p, Estimate own) { return radius; }

void finish(FilterParams p, FrameParams f, uint at, Estimate e, vec3 bent) {
    if (BENT_NORMALS) {
        bool open = is_null(p.to) && e.samples == 0.0;
        store_vec3(p.bent_to, at, open ? (2.0 / 3.0) * surface_normal(f, at) : bent);
    }
    if (!is_null(p.to)) {
        STORE_PAIR(p.to, at, pack_estimate(e));
        return;
    }
    // without any information: unoccluded
    FloatImage(p.result).v[at] = e.samples > 0.0 ? e.mean : 1.0;
}

void finish_nothing(FilterParams p, FrameParams f, uint at) {
    if (is_null(p.to)) FloatImage(p.result).v[at] = 0.0;
    else STORE_PAIR(p.to, at, uvec2(0u));
    if (BENT_NORMALS) store_vec3(p.bent_to, at, vec3(0.0));
}

// The mean of the surrounding pixels, whatever they show, for a pixel that is alone on its surface and has no samples yet. A guess, but a
// better one than no occlusion.
Estimate guess(FilterParams p, FrameParams f, uvec2 estimates, ivec2 pixel, Estimate own) {
    if (!is_null(p.to)) return own;
    ivec2 lower = max(pixel - 1, ivec2(0)), upper = min(pixel + 1, ivec2(f.size) - 1);
    float sum = 0.0, n = 0.0;
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            // the background has no samples
            Estimate e = unpack_estimate(LOAD_PAIR(estimates, uint(y) * f.size.x + uint(x)));
            sum += e.mean * e.samples;
            n += e.samples;
        }
    }
    return n > 0.0 ? Estimate(share_of(sum, n), n, 0.0) : Estimate(0.0, 0.0, 0.0);
}

#include "common/filter.glsl"
