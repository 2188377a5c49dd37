// larsen_occlusion: 64 rays per pixel of an image of half the size per axis, where no light is visible; nearest hits, with and without a
// falloff.
#include "ao/sample.glsl"
#include "common/larsen.glsl"
#include "common/warp.glsl"

uvec2 occlusion_pixel(LarsenParams l, uint index) {
    return larsen_pixel(l.half_size, index / LARSEN_RAYS);
}

bool is_traced(LarsenParams l, FrameParams f, uvec2 pixel) {
    if (any(greaterThanEqual(pixel, l.half_size))) return false;
    uint at = image_index(f, min(2u * pixel, f.size - 1u));
    return !larsen_nothing(f, at) && Words(l.lit).v[at] == 0u;
}

// Point k of the table, whose indices are rotated about its middle by an angle, rounded and wrapped.
vec2 table_point(LarsenParams l, uint k, float angle) {
    vec2 centred = vec2(k % 8u, k / 8u) - 3.5;
    float c = cos(angle), s = sin(angle);
    ivec2 turned = ivec2(round(vec2(c * centred.x - s * centred.y, s * centred.x + c * centred.y) + 3.5));
    uvec2 wrapped = uvec2(turned & 7);
    return load_vec2(l.points, wrapped.y * 8u + wrapped.x);
}

// Rotates +z to n by Rodrigues' formula; divides by the square of the sine between them, so it is NaN for n along z.
vec3 align(vec3 n, vec3 w) {
    vec3 axis = vec3(-n.y, n.x, 0.0);
    float sin2 = dot(axis, axis);
    return w * n.z + cross(axis, w) + axis * (dot(axis, w) * (1.0 - n.z) / sin2);
}

Ray ray(uint index) {
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uvec2 pixel = occlusion_pixel(l, index);
    if (!is_traced(l, f, pixel)) return no_ray();
    uint at = image_index(f, min(2u * pixel, f.size - 1u));
    vec3 p = uintBitsToFloat(Quads(f.surface).v[at].xyz), n = uintBitsToFloat(Quads(f.normals).v[at].xyz);
    float noise = Floats(l.noise).v[(pixel.y % LARSEN_NOISE) * LARSEN_NOISE + pixel.x % LARSEN_NOISE];
    float angle = 6.28318530718 * fract(noise + 1.61803398875 * float(l.frame_parity));
    vec3 w = align(n, cosine_hemisphere(table_point(l, index % LARSEN_RAYS, angle)));
    // no ray, and so no occlusion, where the direction is NaN
    if (!(dot(w, w) < 2.0)) return no_ray();
    return Ray(p + LARSEN_BIAS * l.unit * n, 0.0, w, LARSEN_REACH * l.unit);
}

void closest(uint index, Hit hit) {
    LarsenParams l = LarsenParams(push.pass);
    FloatImage(l.samples).v[index - push.first] = occlusion_of(FrameParams(l.frame).falloff_log2, hit);
}
