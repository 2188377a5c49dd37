// gather: for pixels with several samples in a frame, their mean and variance, and with bent normals their mean direction; in the
// order of the samples, so that the result is deterministic.
#include "common/occlusion.glsl"

layout(local_size_x = LANES) in;

void main() {
    AoTraceParams p = AoTraceParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uint n = f.rays_per_pixel, k = gl_GlobalInvocationID.x;
    if (k >= push.count / n) return;
    uvec2 pixel = tile_pixel(f, push.first / n + k);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel), begin = k * n;
    if (!has_rays(f, pixel, at)) return;
    Floats samples = Floats(p.samples);
    float sum = 0.0, squares = 0.0;
    for (uint s = 0u; s < n; s++) {
        float x = samples.v[begin + s];
        sum += x;
        squares += x * x;
    }
    float mean = share_of(sum, float(n));
    float variance = n > 1u ? max(squares - sum * mean, 0.0) / float(n - 1u) : 0.0;
    STORE_PAIR(p.current, at, pack_estimate(Estimate(mean, float(n), variance)));
    if (BENT_NORMALS) {
        vec3 ng = surface_normal(f, at), bent = vec3(0.0);
        for (uint s = 0u; s < n; s++) bent += samples.v[begin + s] * occlusion_direction(f, pixel, at, ng, s);
        store_vec3(p.current_bent, at, bent / float(n));
    }
}
