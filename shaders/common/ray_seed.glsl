// A random number per ray for stochastic alpha (scene/material.glsl). It is stored in the bits of tmin, which every tracer can read where
// it tests alpha, and which is so small as a length (below 2^-61) that no hit is lost. It depends on the pixel, the sample and the vertex alone, so it is the
// same for all launches and tracers.
#ifndef COMMON_RAY_SEED
#define COMMON_RAY_SEED
#include "common/sampler.glsl"

// The seed of the rays that leave vertex `vertex` of a path; the camera is vertex 0.
uint ray_seed(uint seed, uvec2 pixel, uint sample_index, uint vertex) {
    seed = hash_combine(hash_combine(hash_combine(seed, pixel.x), pixel.y), RAY_SEED);
    return hash_combine(hash_combine(seed, sample_index), vertex);
}

float tmin_of_seed(uint seed) { return uintBitsToFloat(0x00800000u + (seed >> 3)); }
bool has_seed(float tmin) { return tmin > 0.0 && tmin < 4e-19; }

#endif
