// From a material to its BSDF and to what it emits. Mirrors ShadingRecord of src/tracer/shading.rs.
#ifndef PATH_SHADING
#define PATH_SHADING
#include "scene/surface.glsl"
#include "path/params.glsl"
#include "bsdf/bsdf.glsl"

const uint MODEL_METALLIC_ROUGHNESS = 0u;
const uint MODEL_MATTE = 1u;
const uint MODEL_MIRROR = 2u;
const uint MODEL_GLASS = 3u;
const uint MODEL_CONDUCTOR = 4u;
const uint MODEL_UNLIT = 5u;

struct ShadingRecord {
    vec3 emission;       // radiance
    uint model;
    float metallic;
    float roughness;
    float ior;
    float specular;      // KHR_materials_specular
    vec3 specular_color; // of mirror, glass, conductor: factor of what is reflected
    uint emits_back;     // from both sides
    vec3 eta;            // conductor
    float shading_reserved0;
    vec3 k;
    float shading_reserved1;
    vec3 transmitted;    // glass: factor of what is refracted
    float shading_reserved2;
    TextureUse metallic_roughness_texture;
    TextureUse emission_texture;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer ShadingRecords { ShadingRecord v[]; };

// Value of a texture at a point of a primitive (counted in the group), 1 where there is none.
vec4 sample_use(TextureUse use, PartRecord part, uint primitive, vec2 uv, bool srgb) {
    if (use.texture == INVALID || is_null(part.indices)) return vec4(1.0);
    vec2 st = texcoord_at(part, triangle_indices(part, primitive), uv, use.set);
    st = vec2(use.transform.x * st.x + use.transform.z * st.y, use.transform.y * st.x + use.transform.w * st.y) + use.offset;
    return sample_texture(use.texture, st, srgb);
}

// Factor of a light's radiance at a point of a primitive of an instance of the scene.
vec3 emission_texture(uint instance, uint primitive, vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    PartRecord part = PartRecords(root.parts).v[Pairs(root.placements).v[instance].y];
    TextureUse use = ShadingRecords(root.shading).v[part.material].emission_texture;
    return sample_use(use, part, primitive + part.first_primitive, uv, true).rgb;
}

struct Shading {
    Bsdf bsdf;
    vec3 emission;  // towards the viewer
    bool unlit;
};

// `front`: is the surface seen from its front? cos_o: cosine between view and shading normal.
Shading shade(PathParams params, Surface s, bool front, float cos_o) {
    SceneRoot root = SceneRoot(push.scene);
    PartRecord part = PartRecords(root.parts).v[s.part];
    ShadingRecord m = ShadingRecords(root.shading).v[part.material];
    Shading out_;
    out_.unlit = false;
    out_.emission = vec3(0.0);
    out_.bsdf = Bsdf(BSDF_NONE, vec3(0.0), vec3(0.0), 1.0, vec3(0.0), vec3(1.0), vec3(1.0), 1.0, Microfacets(vec2(1.0), false), 0.0);
    if (params.white_sky != 0u) {
        out_.bsdf.kind = BSDF_DIFFUSE;
        out_.bsdf.diffuse = vec3(params.albedo);
        return out_;
    }
    if (m.emission != vec3(0.0) && (front || m.emits_back != 0u)) {
        out_.emission = m.emission * sample_use(m.emission_texture, part, s.primitive, s.uv, true).rgb;
    }
    vec3 base = base_color(part, MaterialRecords(root.materials).v[part.material], s.primitive, s.uv).rgb;
    if (m.model == MODEL_UNLIT) {
        out_.unlit = true;
        out_.emission += base;
        return out_;
    }
    if (m.model == MODEL_MATTE) {
        out_.bsdf.kind = BSDF_DIFFUSE;
        out_.bsdf.diffuse = base;
    } else if (m.model == MODEL_MIRROR) {
        out_.bsdf.kind = BSDF_MIRROR;
        out_.bsdf.tint = m.specular_color;
    } else if (m.model == MODEL_GLASS) {
        out_.bsdf.kind = BSDF_DIELECTRIC;
        out_.bsdf.tint = m.specular_color;
        out_.bsdf.transmitted = m.transmitted;
        out_.bsdf.eta = front ? m.ior : 1.0 / m.ior;
        out_.bsdf.facets = Microfacets(vec2(m.roughness * m.roughness), false);
    } else if (m.model == MODEL_CONDUCTOR) {
        out_.bsdf.kind = BSDF_CONDUCTOR;
        out_.bsdf.tint = m.specular_color;
        out_.bsdf.f0 = m.eta;
        out_.bsdf.k = m.k;
        out_.bsdf.facets = Microfacets(vec2(m.roughness * m.roughness), true);
    } else {
        vec4 mr = sample_use(m.metallic_roughness_texture, part, s.primitive, s.uv, false);
        float metallic = m.metallic * mr.b, roughness = m.roughness * mr.g;
        // KHR_materials_ior and _specular
        float r0 = (m.ior - 1.0) / (m.ior + 1.0);
        vec3 dielectric = min(r0 * r0 * m.specular_color, vec3(1.0)) * m.specular;
        out_.bsdf.kind = BSDF_METALLIC_ROUGHNESS;
        out_.bsdf.diffuse = base * (1.0 - metallic);
        out_.bsdf.f0 = mix(dielectric, base, metallic);
        out_.bsdf.f90 = mix(m.specular, 1.0, metallic);
        out_.bsdf.facets = Microfacets(vec2(roughness * roughness), false);
        out_.bsdf.specular_share = specular_share(out_.bsdf.diffuse, out_.bsdf.f0, out_.bsdf.f90, cos_o);
    }
    return out_;
}

#endif
