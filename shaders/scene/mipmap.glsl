// Mip levels of textures: each half as wide and high as the one before, rounded down, every texel the mean of the texels that it covers. Level 0 is the texture
// itself (scene/texture.glsl); the others are linear, 16 bits per channel, or floats for textures of more than 8 bits.
#ifndef SCENE_MIPMAP
#define SCENE_MIPMAP
#include "interface/material_features.glsl"
#include "interface/texels.glsl"
#include "scene/texture.glsl"

// A texel of levels 1 and up.
vec4 mean_texel(TextureRecord texture, uvec2 texels, uint i) {
    if (HAS_DEEP_TEXELS && texture.format != FORMAT_UNORM8) return uintBitsToFloat(Quads(texels).v[i]);
    return unorm16(Pairs(texels).v[i]);
}

// Linear value of a level at uv, filtered as the texture is; for TEXELS_COVERED premultiplied by alpha.
vec4 sample_level(uint index, TextureRecord texture, vec2 uv, uint kind, uint level) {
    if (level == 0u) {
        vec4 c = sample_texture(index, uv, kind != TEXELS_LINEAR);
        return kind == TEXELS_COVERED ? vec4(c.rgb * c.a, c.a) : c;
    }
    MipRecords mips = MipRecords(SceneRoot(push.scene).mips);
    uvec2 texels = mips.v[index].texels[kind];
    uint first = mips.v[index].first[level - 1u];
    uvec2 size = max(uvec2(texture.width, texture.height) >> level, uvec2(1u));
    vec2 p = fold(uv, texture) * vec2(size);
    if (texture.nearest == 0u) p -= 0.5;
    ivec2 i = to_int(floor(p));
    vec2 f = texture.nearest == 0u ? p - vec2(i) : vec2(0.0);
    uvec2 x = uvec2(wrap_texel(i.x, size.x, texture.wrap_u), wrap_texel(i.x + 1, size.x, texture.wrap_u));
    uvec2 y = first + size.x * uvec2(wrap_texel(i.y, size.y, texture.wrap_v), wrap_texel(i.y + 1, size.y, texture.wrap_v));
    return mix(mix(mean_texel(texture, texels, y.x + x.x), mean_texel(texture, texels, y.x + x.y), f.x),
               mix(mean_texel(texture, texels, y.y + x.x), mean_texel(texture, texels, y.y + x.y), f.x), f.y);
}

// Value at uv over a square of 2^lod texels, with linear interpolation between levels; for lod <= 0 the same as sample_texture, bit for bit.
vec4 sample_mipmap(uint index, vec2 uv, uint kind, float lod) {
    MipRecords mips = MipRecords(SceneRoot(push.scene).mips);
    // also for NaN
    bool plain = !HAS_RAY_CONES || !(lod > 0.0) || mips.v[index].last == 0u;
    if (!plain) {
        TextureRecord texture = TextureRecords(SceneRoot(push.scene).textures).v[index];
        float whole = min(lod, float(mips.v[index].last));
        uint level = uint(to_int(floor(whole)));
        float above = whole - float(level);
        vec4 c = vec4(0.0);
        // a loop, so that the code exists once for both levels
        [[dont_unroll]] for (uint k = 0u; k < 2u; k++) {
            float weight = k == 0u ? 1.0 - above : above;
            if (weight > 0.0) c += weight * sample_level(index, texture, uv, kind, level + k);
        }
        if (kind != TEXELS_COVERED) return c;
        // what is seen here, but not there on average, has a colour of its own: the texture's
        if (c.a > 0.0) return vec4(c.rgb / c.a, c.a);
    }
    return sample_texture(index, uv, kind != TEXELS_LINEAR);
}

#endif
