// rest_noise: the mean of all samples of ambient visibility since an image came to rest and how well it is known, the input of non-local means (common/nlmeans.glsl). Few samples know their own
// variance badly, so it is averaged over 3x3 pixels.
#include "common/rest.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    RestNoiseParams p = RestNoiseParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    ivec2 pixel = ivec2(image_pixel(f, at)), lower = max(pixel - 1, ivec2(0)), upper = min(pixel + 1, ivec2(f.size) - 1);
    uvec2 rests = p.rest;
    float error = 0.0;
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            vec4 b = load_quad(rests, 2u * (uint(y) * f.size.x + uint(x)) + 1u);
            error += rest_error(Rest(vec3(0.0), 0.0, b.x, b.y, 0.0, 0.0, false)) * pow(max(b.y, 1.0), -p.evenness);
        }
    }
    error /= float((upper.x - lower.x + 1) * (upper.y - lower.y + 1));
    // ambient visibility counts as three equal channels
    STORE_PAIR(p.to, at, floatBitsToUint(vec2(load_quad(rests, 2u * at).r, error / 3.0)));
}
