// Textures in plain memory, filtered here: no limit on their number or size, no descriptor indexing, and the same value on
// every driver (the oracle computes it too).
#ifndef SCENE_TEXTURE
#define SCENE_TEXTURE
#include "common/integers.glsl"
#include "common/srgb.glsl"
#include "scene/scene.glsl"

// For i from -1 to 2 * size + 1, as folded coordinates have them; always a texel.
uint wrap_texel(int i, uint size, uint mode) {
    int n = int(size);
    if (mode != WRAP_CLAMP) {
        int period = mode == WRAP_MIRROR ? 2 * n : n;
        i += i < 0 ? period : 0;
        // three times if a texture has one texel
        i -= i >= period ? period : 0;
        i -= i >= period ? period : 0;
        i -= i >= period ? period : 0;
        // in the mirrored half
        i = i < n ? i : 2 * n - 1 - i;
    }
    return uint(clamp(i, 0, n - 1));
}

vec4 unorm16(uvec2 rgba) { return vec4(unpackUnorm2x16(rgba.x), unpackUnorm2x16(rgba.y)); }

// Texel i as stored, without decoding sRGB.
vec4 texel(TextureRecord texture, uint i) {
    if (HAS_DEEP_TEXELS) {
        if (texture.format == FORMAT_UNORM16) return unorm16(LOAD_PAIR(texture.texels, i));
        if (texture.format == FORMAT_FLOAT) return load_quad(texture.texels, i);
    }
    return unpackUnorm4x8(Words(texture.texels).v[i]);
}

vec4 decoded_texel(TextureRecord texture, uint i, bool srgb) {
    vec4 c = texel(texture, i);
    bool encoded = srgb && !(HAS_DEEP_TEXELS && texture.format == FORMAT_FLOAT);
    return encoded ? vec4(srgb_decode(c.rgb), c.a) : c;
}

// Coordinates far outside [0, 1] would overflow the integer texel index: fold them first. Repeating with period 2 holds for
// repeat and mirror; clamp needs no more than the neighbourhood.
vec2 fold(vec2 uv, TextureRecord texture) {
    vec2 folded = uv - 2.0 * floor(uv * 0.5);
    return vec2(texture.wrap_u == WRAP_CLAMP ? clamp(uv.x, -1.0, 2.0) : folded.x, texture.wrap_v == WRAP_CLAMP ? clamp(uv.y, -1.0, 2.0) : folded.y);
}

// Filtered value at uv (v down). sRGB is decoded before filtering.
vec4 sample_texture(uint index, vec2 uv, bool srgb) {
    TextureRecord texture = load_texture_record(SceneRoot(push.scene).textures, index);
    bool nearest = texture.nearest != 0u;
    vec2 p = fold(uv, texture) * vec2(texture.width, texture.height);
    if (!nearest) p -= 0.5;
    ivec2 i = to_int(floor(p));
    uint x = wrap_texel(i.x, texture.width, texture.wrap_u), y = texture.width * wrap_texel(i.y, texture.height, texture.wrap_v);
    vec4 first = decoded_texel(texture, y + x, srgb);
    if (nearest) return first;
    uint x1 = wrap_texel(i.x + 1, texture.width, texture.wrap_u), y1 = texture.width * wrap_texel(i.y + 1, texture.height, texture.wrap_v);
    vec2 f = p - vec2(i);
    return mix(
        mix(first, decoded_texel(texture, y + x1, srgb), f.x),
        mix(decoded_texel(texture, y1 + x, srgb), decoded_texel(texture, y1 + x1, srgb), f.x),
        f.y);
}

#endif
