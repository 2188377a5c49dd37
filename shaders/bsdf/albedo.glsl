// Albedos by cosine and roughness, from tables that the host integrates (src/tracer/albedo.rs): layers of ALBEDO_SIZE squared, bilinearly.
#ifndef BSDF_ALBEDO
#define BSDF_ALBEDO
#include "scene/scene.glsl"

const uint ALBEDO_SIZE = 32u;
const uint ALBEDO_GGX_F0 = 0u;    // of GGX with Schlick's term: this times f0 ...
const uint ALBEDO_GGX_F90 = 1u;   // ... and this times f90
const uint ALBEDO_SHEEN = 2u;     // Charlie
const uint ALBEDO_BECKMANN = 3u;  // of microfacets that reflect everything
const uint ALBEDO_GLASS = 4u;     // of all that rough glass reflects and refracts: two layers for each index, from outside and from inside

float albedo(uint layer, float cos_o, float roughness) {
    vec2 p = clamp(vec2(cos_o, roughness), 0.0, 1.0) * float(ALBEDO_SIZE - 1u);
    uvec2 i = min(uvec2(p), uvec2(ALBEDO_SIZE - 2u));
    vec2 f = p - vec2(i);
    Floats t = Floats(SceneRoot(push.scene).albedo);
    uint k = (layer * ALBEDO_SIZE + i.y) * ALBEDO_SIZE + i.x;
    return mix(mix(t.v[k], t.v[k + 1u], f.x), mix(t.v[k + ALBEDO_SIZE], t.v[k + ALBEDO_SIZE + 1u], f.x), f.y);
}

// Share of the light that microfacets which reflect everything send away again, of what comes from (or goes to) a direction.
float ggx_albedo(float cos_o, float roughness) {
    return albedo(ALBEDO_GGX_F0, cos_o, roughness) + albedo(ALBEDO_GGX_F90, cos_o, roughness);
}

#endif
