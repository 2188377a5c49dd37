// nlmeans: non-local means of an image of one channel (common/nlmeans.glsl), each of whose pixels is a value and its variance.
#include "common/types.glsl"
#include "interface/denoise.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Filtered { float v[]; };

#define VALUE float
#define BLOCK int(NLMEANS_BLOCK)

float load_value(uvec2 image, uint at, out float variance) {
    vec2 pair = load_vec2(image, at);
    variance = pair.y;
    return pair.x;
}

float squared(float value) { return value * value; }

void store_value(uvec2 image, uint at, float value) { Filtered(image).v[at] = value; }

#include "common/nlmeans.glsl"
