// What the passes of the reference work's pipeline share (Larsen 2019): exactly as it was, its flaws included. Mirrors LarsenParams in
// src/render/realtime/larsen.rs.
#ifndef COMMON_LARSEN
#define COMMON_LARSEN
#include "common/frame.glsl"

const uint LARSEN_RAYS = 64u;
const uint LARSEN_NOISE = 64u;  // side of the noise's tile

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer LarsenParams {
    uvec2 frame;           // FrameParams
    uvec2 lights;          // 4 floats each: position relative to the scene's origin
    uint light_count;
    uint frame_parity;
    uvec2 half_size;       // pixels of the occlusion image
    float unit;            // world units that one of theirs is
    float larsen_reserved;
    uvec2 points;          // 2 floats each: 64 of Mitchell's best candidates
    uvec2 noise;           // a float each: 64 x 64 blue noise
    uvec2 lit;             // a uint a pixel: lights that are visible
    uvec2 samples;         // a float per ray of a launch
    uvec2 occlusion;       // a float per pixel of the occlusion image
    uvec2 combined;        // a float a pixel
    uvec2 previous;        // a float a pixel: the result of the frame before
    uvec2 rays;            // a uint: occlusion rays traced
};

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
