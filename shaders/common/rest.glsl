// The mean of all samples since an image came to rest, without reprojection, filter or clamp: what it converges to.
#ifndef COMMON_REST
#define COMMON_REST
#include "common/frame.glsl"

// Background counts as 0 for ambient visibility, as on the film of a still.
struct Rest {
    vec3 mean;
    float samples;
    float variance;   // of the means of groups of samples (a frame's, or fewer) about their common mean, weighted by samples; summed over channels
    float frames;     // number of groups
    float coverage;
    float passed;     // samples that meet a catcher, times the light that reaches it: those show what is behind, and cover nothing
    bool is_caught;   // all samples meet a catcher, or are black
};

const Rest NO_REST = Rest(vec3(0.0), 0.0, 0.0, 0.0, 0.0, 0.0, true);

Rest load_rest(uvec2 image, uint at) {
    vec4 a = load_quad(image, 2u * at), b = load_quad(image, 2u * at + 1u);
    // negative where not all samples meet a catcher
    return Rest(a.xyz, a.w, b.x, b.y, b.z, b.w < 0.0 ? -1.0 - b.w : b.w, b.w >= 0.0);
}

void store_rest(uvec2 image, uint at, Rest r) {
    store_quad(image, 2u * at, vec4(r.mean, r.samples));
    store_quad(image, 2u * at + 1u, vec4(r.variance, r.frames, r.coverage, r.is_caught ? r.passed : -1.0 - r.passed));
}

// Adds a group of samples with this mean and coverage.
Rest add_rest(Rest r, vec3 mean, float samples, float coverage) {
    if (!(samples > 0.0)) return r;
    r.samples += samples;
    r.frames += 1.0;
    float share = samples / r.samples;
    vec3 difference = mean - r.mean;
    r.mean += share * difference;
    r.coverage += share * (coverage - r.coverage);
    r.variance += share * (dot(difference, mean - r.mean) - r.variance);
    return r;
}

// The same of samples of which some meet a catcher.
Rest add_rest(Rest r, vec3 mean, float samples, float coverage, float passed, bool is_caught) {
    Rest after = add_rest(r, mean, samples, coverage);
    if (!(samples > 0.0)) return after;
    after.passed += samples / after.samples * (passed - after.passed);
    after.is_caught = r.is_caught && is_caught;
    return after;
}

// Variance of the mean, summed over channels; of few frames it is not known.
float rest_error(Rest r) { return r.variance / max(r.frames - 1.0, 1.0); }

#endif
