// What the passes of the reference work's pipeline share (Larsen 2019): exactly as it was, its flaws included.
#ifndef COMMON_LARSEN
#define COMMON_LARSEN
#include "common/frame.glsl"
#include "interface/larsen.glsl"

// Occlusion rays start so far off the surface, and end there, in their units.
const float LARSEN_BIAS = 0.001;
const float LARSEN_REACH = 100.0;

// Pixels of an image in 8x8 tiles.
uvec2 larsen_pixel(uvec2 size, uint k) {
    return tile_pixel(k >> 6, (size.x + 7u) / 8u, k & 63u);
}

// Position 0 means that nothing is there; so does a surface that happens to lie there.
bool larsen_nothing(FrameParams f, uint at) {
    return !is_surface(Pairs(f.guide).v[at]) || uintBitsToFloat(Quads(f.surface).v[2u * at].xyz) == vec3(0.0);
}

#endif
