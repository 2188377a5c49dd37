// larsen_temporal: the mean of this frame and the previous one, reprojected. The history is never
// rejected, except for pixels without a position.
#include "common/larsen.glsl"

layout(local_size_x = LANES) in;

float texel(LarsenParams l, FrameParams f, ivec2 q) {
    uvec2 p = uvec2(clamp(q, ivec2(0), ivec2(f.size) - 1));
    return Floats(l.previous).v[image_index(f, p)];
}

void main() {
    if (gl_GlobalInvocationID.x >= push.count) return;
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uint at = gl_GlobalInvocationID.x;
    float now = Floats(l.combined).v[at];
    if (f.has_history != 0u && !larsen_nothing(f, at)) {
        vec3 c = affine(f.previous_world_to_camera, uintBitsToFloat(Quads(f.surface).v[at].xyz));
        vec2 plane = f.previous_orthographic != 0u ? c.xy : c.xy / -c.z;
        vec2 q = image_point(f, f.previous_view, plane) - 0.5;
        // clamp to edge
        q = clamp(q, vec2(-1.0), vec2(f.size));
        ivec2 base = ivec2(floor(q));
        vec2 w = q - vec2(base);
        float before = mix(mix(texel(l, f, base), texel(l, f, base + ivec2(1, 0)), w.x), mix(texel(l, f, base + ivec2(0, 1)), texel(l, f, base + ivec2(1, 1)), w.x), w.y);
        now = mix(before, now, 0.5);
    }
    FloatImage(l.result).v[at] = now;
}
