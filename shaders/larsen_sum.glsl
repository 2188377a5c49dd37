// larsen_sum: the mean of a pixel's 64 rays; 0 for the background and where a light is visible.
#include "common/larsen.glsl"

layout(local_size_x = LANES) in;

void main() {
    if (gl_GlobalInvocationID.x >= push.count / LARSEN_RAYS) return;
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uvec2 pixel = larsen_pixel(l.half_size, push.first / LARSEN_RAYS + gl_GlobalInvocationID.x);
    if (any(greaterThanEqual(pixel, l.half_size))) return;
    uint at = image_index(f, min(2u * pixel, f.size - 1u));
    float sum = 0.0;
    if (!larsen_nothing(f, at) && Words(l.lit).v[at] == 0u) {
        Floats samples = Floats(l.samples);
        for (uint k = 0u; k < LARSEN_RAYS; k++) sum += samples.v[gl_GlobalInvocationID.x * LARSEN_RAYS + k];
        atomicAdd(QueueCount(l.rays).v[0], LARSEN_RAYS);
    }
    FloatImage(l.occlusion).v[pixel.y * l.half_size.x + pixel.x] = sum / float(LARSEN_RAYS);
}
