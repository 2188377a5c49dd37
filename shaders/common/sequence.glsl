// Sample positions of occlusion rays in successive frames: the same functions, bit for bit, as src/sampling/sequence.rs,
// which cites the papers.
#ifndef COMMON_SEQUENCE
#define COMMON_SEQUENCE
#include "common/morton.glsl"
#include "common/sampler.glsl"
#include "interface/sequence.glsl"

// 2^32 / g and 2^32 / g^2, g = 1.3247... the plastic number
const uvec2 R2_STEP = uvec2(3242174889u, 2447445414u);

// Sample `index` of `count` that a pixel takes in a frame, as fractions of 2^32.
uvec2 sequence_bits(uint sequence, uint seed, uvec2 pixel, uint frame, uint index, uint count) {
    if (sequence == SEQUENCE_SOBOL) return sample_2d_bits(seed, pixel, frame * count + index, AO_DIRECTION);
    // SEQUENCE_BLUE
    seed = hash_combine(seed, AO_DIRECTION);
    uvec2 p = sobol_2d(owen_scramble(morton(pixel), seed) * count + index);
    p = uvec2(owen_scramble(p.x, hash_combine(seed, 0u)), owen_scramble(p.y, hash_combine(seed, 1u)));
    return p + frame * R2_STEP;
}

vec2 sequence_2d(uint sequence, uint seed, uvec2 pixel, uint frame, uint index, uint count) {
    return vec2(sequence_bits(sequence, seed, pixel, frame, index, count) >> 8) * (1.0 / 16777216.0);
}

#endif
