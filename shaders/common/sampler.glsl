// Padded two-dimensional Owen-scrambled Sobol points: the same functions, bit for bit, as src/sampling/sobol.rs, which cites
// the papers.
#ifndef COMMON_SAMPLER
#define COMMON_SAMPLER
#include "interface/sampler.glsl"


uint hash(uint x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

uint hash_combine(uint seed, uint v) {
    return hash(seed ^ hash(v + 0x9e3779b9u));
}

uint laine_karras_permutation(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

uint owen_scramble(uint x, uint seed) {
    return bitfieldReverse(laine_karras_permutation(bitfieldReverse(x), seed));
}

uvec2 sobol_2d(uint index) {
    uint v = index;
    v ^= (v & 0xaaaaaaaau) >> 1;
    v ^= (v & 0xccccccccu) >> 2;
    v ^= (v & 0xf0f0f0f0u) >> 4;
    v ^= (v & 0xff00ff00u) >> 8;
    v ^= (v & 0xffff0000u) >> 16;
    return bitfieldReverse(uvec2(index, v));
}

uvec2 sample_2d_bits(uint seed, uvec2 pixel, uint sample_index, uint dimension) {
    seed = hash_combine(hash_combine(hash_combine(seed, pixel.x), pixel.y), dimension);
    uvec2 p = sobol_2d(owen_scramble(sample_index, seed));
    return uvec2(owen_scramble(p.x, hash_combine(seed, 0u)), owen_scramble(p.y, hash_combine(seed, 1u)));
}

// The same, but the first number, which chooses among many outcomes, is scrambled by a digital shift alone.
uvec2 sample_choice_bits(uint seed, uvec2 pixel, uint sample_index, uint dimension) {
    seed = hash_combine(hash_combine(hash_combine(seed, pixel.x), pixel.y), dimension);
    uvec2 p = sobol_2d(owen_scramble(sample_index, seed));
    return uvec2(p.x ^ hash_combine(seed, 0u), owen_scramble(p.y, hash_combine(seed, 1u)));
}

// Bits as a point in [0, 1): the upper 24, exactly.
vec2 to_unit(uvec2 bits) { return vec2(bits >> 8) * (1.0 / 16777216.0); }

vec2 sample_2d(uint seed, uvec2 pixel, uint sample_index, uint dimension) {
    return to_unit(sample_2d_bits(seed, pixel, sample_index, dimension));
}

#endif
