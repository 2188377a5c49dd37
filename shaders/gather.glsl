// gather: where a pixel has several samples in a frame, their mean and variance; in the order of the samples, so that it depends
// on nothing else.
// compute
#include "common/frame.glsl"

layout(local_size_x = LANES) in;

void main() {
    FrameParams f = FrameParams(push.pass);
    uint n = f.rays_per_pixel;
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count / n) return;
    uvec2 pixel = tile_pixel(f, push.first / n + k);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    if (!has_rays(f, pixel, at)) return;
    Floats samples = Floats(f.samples);
    float sum = 0.0, squares = 0.0;
    for (uint s = 0u; s < n; s++) {
        float x = samples.v[k * n + s];
        sum += x;
        squares += x * x;
    }
    float mean = sum / float(n);
    float variance = n > 1u ? max(squares - sum * mean, 0.0) / float(n - 1u) : 0.0;
    STORE_PAIR(f.current, at, pack_estimate(Estimate(mean, float(n), variance)));
}
