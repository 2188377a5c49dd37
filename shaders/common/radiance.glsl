// Estimates of radiance: RadianceRecords in memory.
#ifndef COMMON_RADIANCE
#define COMMON_RADIANCE
#include "common/frame.glsl"

struct RadianceEstimate {
    vec3 mean;
    float samples;
    vec3 variance;    // of one sample
    float narrowed;   // by how much the filter's box is narrowed here, 0 to 1; or one of the following
};

// The box is not narrowed, and there is no history because the light of the pixel has changed from one frame to the next: to less, or to more.
const float LIGHT_DARKENED = -1.0;
const float LIGHT_BRIGHTENED = -2.0;

const RadianceEstimate NO_RADIANCE = RadianceEstimate(vec3(0.0), 0.0, vec3(0.0), 0.0);

RadianceEstimate load_radiance(uvec2 image, uint at) {
    vec4 a = load_quad(image, 2u * at), b = load_quad(image, 2u * at + 1u);
    return RadianceEstimate(a.xyz, a.w, b.xyz, b.w);
}

void store_radiance(uvec2 image, uint at, RadianceEstimate e) {
    store_quad(image, 2u * at, vec4(e.mean, e.samples));
    store_quad(image, 2u * at + 1u, vec4(e.variance, e.narrowed));
}

// Also false for NaN.
bool is_finite(vec3 c) { return max(abs(c.r), max(abs(c.g), abs(c.b))) < 1e30; }

// The samples of both (Chan, Golub, LeVeque, "Algorithms for Computing the Sample Variance", 1983).
RadianceEstimate all_samples(RadianceEstimate a, RadianceEstimate b) {
    float n = a.samples + b.samples;
    if (!(n > 0.0)) return b;
    float share = b.samples / n;
    vec3 difference = b.mean - a.mean;
    // variance of all samples about their common mean
    return RadianceEstimate(a.mean + share * difference, n, mix(a.variance, b.variance, share) + share * (1.0 - share) * difference * difference, b.narrowed);
}

#endif
