// gather: where a pixel has several samples in a frame, their mean and variance; in the order of the samples, so that it depends
// on nothing else.
// compute
#include "common/frame.glsl"

layout(local_size_x = LANES) in;

void main() {
    if (gl_GlobalInvocationID.x >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    uvec2 pixel = tile_pixel(f, push.first + gl_GlobalInvocationID.x);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    uint n = uint(unpack_estimate(Pairs(f.current).v[at]).samples);
    if (n == 0u) return;
    Floats samples = Floats(f.samples);
    uint first = gl_GlobalInvocationID.x * f.rays_per_pixel;
    float sum = 0.0, squares = 0.0;
    for (uint k = 0u; k < n; k++) {
        float x = samples.v[first + k];
        sum += x;
        squares += x * x;
    }
    float mean = sum / float(n);
    float variance = n > 1u ? max(squares - sum * mean, 0.0) / float(n - 1u) : 0.0;
    STORE_PAIR(f.current, at, pack_estimate(Estimate(mean, float(n), variance)));
}
