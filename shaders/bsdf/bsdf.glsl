// Reflection models behind one interface: how much of the light from wi leaves towards wo, and where to look for it.
//
//     vec3 bsdf_eval(Bsdf, wo, wi)            value times |cos wi|, without the delta lobes
//     float bsdf_pdf(Bsdf, wo, wi)            density with which bsdf_sample proposes wi, per solid angle, without the delta lobes
//     BsdfSample bsdf_sample(Bsdf, wo, u, v)  a direction; weight is value times |cos| over density
//
// Directions are unit vectors in the frame of the shading normal, z on the side from which the surface is seen: wo.z > 0. The integrator knows
// no more than this: a model is a file in this folder and a line in each of the functions below.
#ifndef BSDF_BSDF
#define BSDF_BSDF
#include "common/warp.glsl"
#include "bsdf/microfacet.glsl"

// Mirrors BsdfKind in src/render/path/material.rs.
const uint BSDF_NONE = 0u;                // absorbs everything
const uint BSDF_DIFFUSE = 1u;             // Lambert: `diffuse`
const uint BSDF_METALLIC_ROUGHNESS = 2u;  // `diffuse` under microfacets with Schlick's `f0`, `f90` (glTF 2.0, appendix B)
const uint BSDF_CONDUCTOR = 3u;           // microfacets of `f0` + i `k`, tinted by `tint`
const uint BSDF_DIELECTRIC = 4u;          // microfacets that reflect and refract, `eta`
const uint BSDF_MIRROR = 5u;              // reflects `tint` of all light

struct Bsdf {
    uint kind;
    vec3 diffuse;
    vec3 f0;
    float f90;
    vec3 k;
    vec3 tint;          // of what is reflected
    vec3 transmitted;   // of what is refracted
    float eta;          // index of refraction beyond the surface over that on wo's side
    Microfacets facets;
    float specular_share;  // probability with which the specular lobe is sampled, by estimated albedo
};

struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf;    // 0: nothing was sampled
    bool delta;
    float eta;    // refracted: `eta` of the surface; else 1
};

const BsdfSample NO_SAMPLE = BsdfSample(vec3(0.0, 0.0, 1.0), vec3(0.0), 0.0, false, 1.0);

bool has_smooth_part(Bsdf b) {
    return b.kind == BSDF_MIRROR || b.kind >= BSDF_METALLIC_ROUGHNESS && b.kind <= BSDF_DIELECTRIC && is_smooth(b.facets);
}

// Is there anything that light samples could find?
bool has_rough_part(Bsdf b) {
    if (b.kind == BSDF_DIFFUSE) return true;
    if (b.kind == BSDF_METALLIC_ROUGHNESS) return !is_smooth(b.facets) || b.specular_share < 1.0;
    return (b.kind == BSDF_CONDUCTOR || b.kind == BSDF_DIELECTRIC) && !is_smooth(b.facets);
}

#include "bsdf/metallic_roughness.glsl"
#include "bsdf/conductor.glsl"
#include "bsdf/dielectric.glsl"

vec3 bsdf_eval(Bsdf b, vec3 wo, vec3 wi) {
    if (b.kind == BSDF_DIFFUSE) return wi.z > 0.0 ? b.diffuse * (wi.z / PI) : vec3(0.0);
    if (b.kind == BSDF_METALLIC_ROUGHNESS) return metallic_roughness_eval(b, wo, wi);
    if (b.kind == BSDF_CONDUCTOR) return conductor_eval(b, wo, wi);
    if (b.kind == BSDF_DIELECTRIC) return dielectric_eval(b, wo, wi);
    return vec3(0.0);
}

float bsdf_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (b.kind == BSDF_DIFFUSE) return max(wi.z, 0.0) / PI;
    if (b.kind == BSDF_METALLIC_ROUGHNESS) return metallic_roughness_pdf(b, wo, wi);
    if (b.kind == BSDF_CONDUCTOR) return conductor_pdf(b, wo, wi);
    if (b.kind == BSDF_DIELECTRIC) return dielectric_pdf(b, wo, wi);
    return 0.0;
}

// u: where; v: which lobe.
BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    if (b.kind == BSDF_DIFFUSE) {
        vec3 wi = cosine_hemisphere(u);
        return BsdfSample(wi, b.diffuse, wi.z / PI, false, 1.0);
    }
    if (b.kind == BSDF_METALLIC_ROUGHNESS) return metallic_roughness_sample(b, wo, u, v);
    if (b.kind == BSDF_CONDUCTOR) return conductor_sample(b, wo, u);
    if (b.kind == BSDF_DIELECTRIC) return dielectric_sample(b, wo, u, v);
    if (b.kind == BSDF_MIRROR) return BsdfSample(vec3(-wo.xy, wo.z), b.tint, 1.0, true, 1.0);
    return NO_SAMPLE;
}

#endif
