// resample: an image of records at another size: each pixel has the record of the pixel in which its centre lies.
#include "common/frame.glsl"
#include "interface/passes.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer ResampledWords { uint v[]; };

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    ResampleParams p = ResampleParams(push.pass);
    uvec2 pixel = divide(at, p.to_size.x);
    // of (pixel + 1/2) * from_size / to_size the whole part; sides of up to 2^15 pixels do not overflow
    uvec2 nearest = (pixel * p.from_size + p.from_size / 2u) / p.to_size;
    uint from = nearest.y * p.from_size.x + nearest.x;
    for (uint k = 0u; k < p.words; k++) ResampledWords(p.to).v[at * p.words + k] = Words(p.from).v[from * p.words + k];
}
