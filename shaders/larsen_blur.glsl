// larsen_blur: a box filter of 3x3 over the occlusion image, read with bilinear filtering at full size, without edge detection; not
// where it is 0. All surfaces are white here.
#include "common/larsen.glsl"

layout(local_size_x = LANES) in;

float texel(LarsenParams l, ivec2 q) {
    uvec2 p = uvec2(clamp(q, ivec2(0), ivec2(l.half_size) - 1));
    return Floats(l.occlusion).v[p.y * l.half_size.x + p.x];
}

float bilinear(LarsenParams l, vec2 at) {
    ivec2 base = ivec2(floor(at));
    vec2 w = at - vec2(base);
    return mix(mix(texel(l, base), texel(l, base + ivec2(1, 0)), w.x), mix(texel(l, base + ivec2(0, 1)), texel(l, base + ivec2(1, 1)), w.x), w.y);
}

void main() {
    if (gl_GlobalInvocationID.x >= push.count) return;
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uint at = gl_GlobalInvocationID.x;
    if (!is_surface(Pairs(f.guide).v[at])) {
        FloatImage(l.combined).v[at] = 0.0;
        return;
    }
    vec2 uv = (vec2(image_pixel(f, at)) + 0.5) / vec2(f.size);
    vec2 middle = uv * vec2(l.half_size) - 0.5;
    float occlusion = bilinear(l, middle);
    // without the filter, to compare
    if (occlusion != 0.0 && l.blurred != 0u) {
        occlusion = 0.0;
        for (int k = 0; k < 9; k++) occlusion += bilinear(l, middle + vec2(k % 3 - 1, k / 3 - 1)) / 9.0;
    }
    FloatImage(l.combined).v[at] = 1.0 - occlusion;
}
