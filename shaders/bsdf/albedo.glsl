// Albedos by cosine and roughness, from tables that the host integrates (src/tracer/albedo.rs): layers of ALBEDO_SIZE squared, bilinearly.
// The cosine's axis is a square root, for albedos change fastest at grazing angles.
#ifndef BSDF_ALBEDO
#define BSDF_ALBEDO
#include "interface/albedo.glsl"
#include "scene/scene.glsl"


// x: along cosines, y: along roughness, both from 0 to 1.
float albedo(uint layer, float x, float y) {
    vec2 p = clamp(vec2(x, y), 0.0, 1.0) * float(ALBEDO_SIZE - 1u);
    uvec2 i = min(uvec2(p), uvec2(ALBEDO_SIZE - 2u));
    vec2 f = p - vec2(i);
    Floats t = Floats(SceneRoot(push.scene).albedo);
    uint k = (layer * ALBEDO_SIZE + i.y) * ALBEDO_SIZE + i.x;
    return mix(mix(t.v[k], t.v[k + 1u], f.x), mix(t.v[k + ALBEDO_SIZE], t.v[k + ALBEDO_SIZE + 1u], f.x), f.y);
}

// Place of a cosine in tables of microfacets: the cosine once the surface is stretched until its roughness is 1. What microfacets hide
// follows it, however smooth they are.
float stretched(float cos_o, float roughness) {
    float a = roughness * roughness, c2 = cos_o * cos_o;
    return sqrt(cos_o * inversesqrt(c2 + a * a * max(1.0 - c2, 0.0)));
}

// Share of the light that microfacets which reflect everything send away again, of what comes from (or goes to) a direction.
float ggx_albedo(float cos_o, float roughness) { return albedo(ALBEDO_GGX, stretched(cos_o, roughness), roughness); }
float beckmann_albedo(float cos_o, float roughness) { return albedo(ALBEDO_BECKMANN, stretched(cos_o, roughness), roughness); }

// Mean of schlick_weight() over the light that such microfacets send away.
float ggx_schlick_weight(float cos_o, float roughness) { return albedo(ALBEDO_SCHLICK, sqrt(cos_o), roughness); }

// Shares of light that a rough dielectric reflects and refracts.
struct DielectricAlbedo {
    float reflected;
    float transmitted;
};

// layer: the index of refraction's first, on the viewer's side; e: ggx_albedo(); tint: factor of what is reflected, but beyond the critical angle.
DielectricAlbedo dielectric_albedo(uint layer, float cos_o, float roughness, float e, float tint) {
    float x = sqrt(cos_o);
    float reflected = albedo(layer + DIELECTRIC_TOTAL, x, roughness) + tint * albedo(layer + DIELECTRIC_REFLECTED, x, roughness);
    float refracted = albedo(layer + DIELECTRIC_OPEN, x, roughness) - tint * albedo(layer + DIELECTRIC_CLOSED, x, roughness);
    return DielectricAlbedo(e * reflected, refracted);
}

#endif
