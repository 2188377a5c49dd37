// Albedos by cosine and roughness, from tables that the host integrates (src/tracer/albedo.rs): layers of ALBEDO_SIZE squared, bilinearly.
// The cosine's axis is a square root, for albedos change fastest at grazing angles.
#ifndef BSDF_ALBEDO
#define BSDF_ALBEDO
#include "scene/scene.glsl"

const uint ALBEDO_SIZE = 64u;
const uint ALBEDO_GGX = 0u;         // of GGX that reflects everything, by the stretched cosine
const uint ALBEDO_SCHLICK = 1u;     // mean of schlick_weight() over what GGX reflects
const uint ALBEDO_SHEEN = 2u;       // Charlie
const uint ALBEDO_BECKMANN = 3u;    // of Beckmann's microfacets that reflect everything, by the stretched cosine
const uint ALBEDO_DIELECTRIC = 4u;  // eight for each index of refraction, DIELECTRIC_* as seen from outside, then from inside

// Of GGX microfacets with the exact Fresnel term F of a dielectric:
const uint DIELECTRIC_TOTAL = 0u;      // reflected beyond the critical angle, over ALBEDO_GGX
const uint DIELECTRIC_REFLECTED = 1u;  // reflected where there is refraction, over ALBEDO_GGX
const uint DIELECTRIC_OPEN = 2u;       // refracted, as if F were 0 where there is refraction
const uint DIELECTRIC_CLOSED = 3u;     // and what of that F takes away
const uint DIELECTRIC_LAYERS = 4u;

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
