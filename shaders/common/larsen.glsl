// Functions that the passes of Larsen's pipeline (2019) share: exactly as in the original, flaws included.
#ifndef COMMON_LARSEN
#define COMMON_LARSEN
#include "common/frame.glsl"
#include "interface/larsen.glsl"

// Offset of occlusion rays from the surface, at both ends, in scene units.
const float LARSEN_BIAS = 0.001;
const float LARSEN_REACH = 100.0;

// Pixels of an image in 8x8 tiles.
uvec2 larsen_pixel(uvec2 size, uint k) {
    return tile_pixel(k >> 6, (size.x + 7u) / 8u, k & 63u);
}

// Position 0 marks the background, and also a surface that happens to be there.
bool larsen_nothing(FrameParams f, uint at) {
    return !is_surface(Pairs(f.guide).v[at]) || uintBitsToFloat(Quads(f.surface).v[at].xyz) == vec3(0.0);
}

#endif
