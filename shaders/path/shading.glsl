// From a material to its BSDF and to what it emits.
#ifndef PATH_SHADING
#define PATH_SHADING
#include "scene/surface.glsl"
#include "scene/mipmap.glsl"
#include "path/params.glsl"
#include "path/cone.glsl"
#include "bsdf/bsdf.glsl"
#include "interface/shading.glsl"
#include "interface/walls.glsl"

// The record of a material, whose fields are loaded on use, so that branches that are not taken load nothing.
#define SHADING_OF(material) ShadingRecords(SceneRoot(push.scene).shading).v[material]

// Its first four words, which every surface needs: emission and model.
uvec4 shading_head(uint material) { return LOAD_QUAD(SceneRoot(push.scene).shading, SHADING_RECORD_BYTES / 16u * material); }

// Twice the area of a triangle on a texture of one by one, before the use's own transform.
float texcoord_area(SubmeshRecord submesh, uvec3 corners, uint set) {
    uvec2 base = texcoord_set(submesh, set);
    if (is_null(base)) return 0.0;
    corners = texcoord_indices(submesh, corners, set);
    vec2 a = load_vec2(base, corners.x);
    vec2 edge1 = load_vec2(base, corners.y) - a, edge2 = load_vec2(base, corners.z) - a;
    return abs(edge1.x * edge2.y - edge1.y * edge2.x);
}

// Texture coordinates of a use of a texture at a point of a primitive (index in the BLAS). uv: barycentrics, or texture coordinates of a sphere.
vec2 coordinates_of_use(TextureUse use, SubmeshRecord submesh, uint primitive, vec2 uv) {
    if (!is_null(submesh.indices)) uv = texcoord_at(submesh, triangle_indices(submesh, primitive), uv, use.set);
    return transform_texcoord(use.transform, use.offset, uv);
}

// Has a submesh texture coordinates at all?
bool has_coordinates(SubmeshRecord submesh) { return !is_null(submesh.indices) || HAS_SPHERES && submesh.texcoord_sets != 0u; }

// log2 of the side of a footprint() on the texture of a use, in texels; SHARP for a point of it. Spheres have no footprint.
float side_on_texture(TextureUse use, SubmeshRecord submesh, uint primitive, float log_side) {
    if (!HAS_RAY_CONES || !(log_side > SHARP) || is_null(submesh.indices)) return SHARP;
    TextureRecords records = TextureRecords(SceneRoot(push.scene).textures);
    float area = texcoord_area(submesh, triangle_indices(submesh, primitive), use.set) * abs(use.transform.x * use.transform.w - use.transform.y * use.transform.z);
    area *= float(records.v[use.texture].width) * float(records.v[use.texture].height);
    // coordinates that do not change show one point of the texture
    return area > 0.0 ? log_side + 0.5 * log2(area) : SHARP;
}

// Value of a texture of a kind (TEXELS_*) at a point of a primitive, 1 without a texture; as above, log_side: footprint().
vec4 sample_use(TextureUse use, SubmeshRecord submesh, uint primitive, vec2 uv, uint kind, float log_side) {
    if (use.texture == INVALID || !has_coordinates(submesh)) return vec4(1.0);
    return sample_mipmap(use.texture, coordinates_of_use(use, submesh, primitive, uv), kind, side_on_texture(use, submesh, primitive, log_side));
}

// The same of an sRGB texture, unfiltered: texture filtering applies to hits of paths only.
vec4 sample_use_sharply(TextureUse use, SubmeshRecord submesh, uint primitive, vec2 uv) {
    if (use.texture == INVALID || !has_coordinates(submesh)) return vec4(1.0);
    return sample_texture(use.texture, coordinates_of_use(use, submesh, primitive, uv), true);
}

// Linear base colour of a surface.
vec3 shown_color(Surface s, SubmeshRecord submesh, MaterialRecord m, float log_side) {
    vec3 color = m.base_color.rgb;
    if (!HAS_BASE_COLORS) return color;
    if (!is_null(submesh.indices)) color *= vertex_color(submesh, triangle_indices(submesh, s.primitive), s.uv).rgb;
    TextureUse use = TextureUse(m.texcoord_transform, m.texcoord_offset, m.base_color_texture, m.texcoord_set);
    // with alpha, colours are premultiplied: texels of alpha 0 do not contribute
    return color * sample_use(use, submesh, s.primitive, s.uv, m.alpha_cutoff < 0.0 ? TEXELS_SRGB : TEXELS_COVERED, log_side).rgb;
}

// Factor of a light's radiance at a point of a primitive of an instance of the scene.
vec3 emission_texture(uint instance, uint primitive, vec2 uv) {
    if (!has_use(USE_EMISSION)) return vec3(1.0);
    SceneRoot root = SceneRoot(push.scene);
    SubmeshRecord submesh = load_submesh_record(root.submeshes, Pairs(root.scene_instances).v[instance].y);
    TextureUse use = SHADING_OF(submesh.material).uses[USE_EMISSION];
    return sample_use_sharply(use, submesh, primitive + submesh.first_primitive, uv).rgb;
}

// The same of a point of a sphere with this unit normal in the world.
vec3 sphere_emission_texture(uint instance, vec3 normal) {
    if (!has_use(USE_EMISSION)) return vec3(1.0);
    SceneRoot root = SceneRoot(push.scene);
    uvec2 records = Pairs(root.scene_instances).v[instance];
    SubmeshRecord submesh = load_submesh_record(root.submeshes, records.y);
    if (submesh.texcoord_sets == 0u) return vec3(1.0);
    if (!SINGLE_LEVEL) normal = normalize(transform_vector(InstanceRecords(root.instances).v[records.x].world_to_group, normal));
    return sample_use_sharply(SHADING_OF(submesh.material).uses[USE_EMISSION], submesh, submesh.first_primitive, sphere_texcoord(normal)).rgb;
}

// Alpha of an emitter at a point of a primitive of an instance of the scene: the fraction of rays that hit it there.
float emitter_alpha(uint instance, uint primitive, vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    SubmeshRecord submesh = load_submesh_record(root.submeshes, Pairs(root.scene_instances).v[instance].y);
    MaterialRecord m = MaterialRecords(root.materials).v[submesh.material];
    float alpha = base_color(submesh, m, primitive + submesh.first_primitive, uv).a;
    if (HAS_COVERAGE && m.coverage != 0u) return clamp(alpha, 0.0, 1.0);
    return alpha >= m.alpha_cutoff ? 1.0 : 0.0;
}

// The surface that a path hits.
struct Shading {
    Bsdf bsdf;
    Frame frame;    // about the shading normal, which is on the viewer's side
    vec3 ng;        // geometric normal, on the viewer's side
    vec3 emission;  // towards the viewer
    bool unlit;
    uint material;
};

// Values of the material's textures at a surface, 1 without a texture.
struct MaterialTextures {
    vec4 at[TEXTURE_FEATURES_COUNT];
};

// Value of one of the material's textures at a surface, 1 without a texture.
vec4 look_up_one(uint use, Surface s, SubmeshRecord submesh, float log_side) {
    uint kind = (SRGB_TEXTURES >> use & 1u) != 0u ? TEXELS_SRGB : TEXELS_LINEAR;
    return has_use(use) ? sample_use(SHADING_OF(submesh.material).uses[use], submesh, s.primitive, s.uv, kind, log_side) : vec4(1.0);
}

MaterialTextures look_up(Surface s, SubmeshRecord submesh, float log_side) {
    MaterialTextures found;
    [[unroll]] for (uint use = 0u; use < TEXTURE_FEATURES_COUNT; use++) found.at[use] = vec4(1.0);
    // drivers compile a copy of the body below for every texture before they find that no material has it
    if (TEXTURE_FEATURES_0 == 0u) return found;
    // all places are constants once it is unrolled: CPU drivers write to others lane by lane
    [[unroll]] for (uint use = 0u; use < TEXTURE_FEATURES_COUNT; use++) found.at[use] = look_up_one(use, s, submesh, log_side);
    return found;
}

bool has_map(uint m, uint use) { return has_use(use) && SHADING_OF(m).uses[use].texture != INVALID; }

// Normal from a tangent-space map; tangents about n, which is on the front.
vec3 mapped_normal(vec4 texel_, float scale, vec3 n, vec4 tangent) {
    vec3 t = texel_.xyz * 2.0 - 1.0;
    t.xy *= scale;
    vec3 mapped = tangent.xyz * t.x + cross(n, tangent.xyz) * (tangent.w * t.y) + n * t.z;
    float m2 = dot(mapped, mapped);
    return m2 > 1e-12 ? mapped * inversesqrt(m2) : n;
}

// Bends the normal towards the viewer as far as it points away.
vec3 towards(vec3 n, vec3 wo) {
    float c = dot(n, wo);
    return c < MIN_COSINE ? normalize(n + (MIN_COSINE - c) * wo) : n;
}

// First layer of the albedo tables of a refracting material, as seen from one side.
uint dielectric_layer(uint m, bool front) {
    return ALBEDO_DIELECTRIC + DIELECTRIC_LAYERS * (2u * SHADING_OF(m).glass_layer + (front ? 0u : 1u));
}

// Inputs of a material's BSDF at a point.
struct MaterialPoint {
    uint material;
    vec3 base;    // linear base colour
    bool front;   // seen from its front
    float cos_o;  // between shading normal and view
    MaterialTextures textures;
    vec2 along;   // direction of anisotropy, in the plane of tangent and bitangent
};

#include "interface/bsdf_dispatch.glsl"

// A black surface, which absorbs everything.
Shading black_shading(Surface s, vec3 wo) {
    float side = dot(s.ng, wo) > 0.0 ? 1.0 : -1.0;
    return Shading(black_bsdf(), frame_about(towards(s.ns * side, wo)), s.ng * side, vec3(0.0), false, INVALID);
}

// A diffuse surface, whatever the material.
Shading grey_shading(Surface s, vec3 wo, float grey) {
    Shading out_ = black_shading(s, wo);
    out_.bsdf.kind = BSDF_DIFFUSE;
    out_.bsdf.diffuse = vec3(grey);
    if (HAS_SHADING_NORMALS) out_.bsdf.ng = to_frame(out_.frame, out_.ng);
    return out_;
}

// The surface hit by a ray along -wo, with textures filtered over a footprint().
Shading shade(Surface s, vec3 wo, float log_side) {
    SceneRoot root = SceneRoot(push.scene);
    SubmeshRecord submesh = load_submesh_record(root.submeshes, s.submesh);
    uint m = submesh.material;
    bool front = dot(s.ng, wo) > 0.0;
    float side = front ? 1.0 : -1.0;
    Shading out_ = black_shading(s, wo);
    out_.material = submesh.material;
    vec3 n = out_.frame.n;
    MaterialTextures textures = look_up(s, submesh, log_side);
    uvec4 head = shading_head(m);
    vec3 emission = uintBitsToFloat(head.xyz);
    uint model = head.w;
    if (HAS_EMISSION && emission != vec3(0.0) && (front || SHADING_OF(m).emits_back != 0u)) out_.emission = emission * textures.at[USE_EMISSION].rgb;
    vec3 base = shown_color(s, submesh, load_material_record(root.materials, submesh.material), log_side);
    if (HAS_UNLIT && model == BSDF_NONE) {
        // unlit materials show their base colour, and their emission is ignored
        out_.unlit = true;
        out_.emission = base;
        return out_;
    }
    vec4 tangent = vec4(0.0);
    bool mapped = has_map(m, USE_NORMAL), clearcoat_mapped = HAS_CLEARCOAT && has_map(m, USE_CLEARCOAT_NORMAL);
    if ((mapped || clearcoat_mapped || HAS_ANISOTROPY) && !is_null(submesh.tangents)) tangent = tangent_at(s, submesh, submesh.tangents);
    if (HAS_SPHERES && submesh.texcoord_sets != 0u) tangent = sphere_tangent(s);
    if (mapped && tangent.w != 0.0) {
        n = towards(mapped_normal(textures.at[USE_NORMAL], SHADING_OF(m).normal_scale, s.ns, tangent) * side, wo);
        out_.frame = frame_about(n);
    }
    vec4 clearcoat_tangent = tangent, anisotropy_tangent = tangent;
    if (HAS_SEPARATE_TANGENTS) {
        if (!is_null(submesh.clearcoat_tangents)) clearcoat_tangent = tangent_at(s, submesh, submesh.clearcoat_tangents);
        if (!is_null(submesh.anisotropy_tangents)) anisotropy_tangent = tangent_at(s, submesh, submesh.anisotropy_tangents);
    }
    float cos_o = max(dot(n, wo), MIN_COSINE);
    MaterialPoint point = MaterialPoint(m, base, front, cos_o, textures, vec2(1.0, 0.0));
    out_.bsdf.kind = model;
    bsdf_setup(out_.bsdf, point);
    if (is_bsdf(out_.bsdf, BSDF_GLTF, HAS_GLTF)) {
        if (HAS_ANISOTROPY && SHADING_OF(m).anisotropy != vec2(0.0) && anisotropy_tangent.w != 0.0) {
            vec4 t = anisotropy_tangent;
            vec3 d = t.xyz * point.along.x + cross(s.ns, t.xyz) * (t.w * point.along.y);
            out_.frame = frame_along(n, d);
        }
        if (clearcoat_mapped && clearcoat_tangent.w != 0.0) {
            vec3 nc = mapped_normal(textures.at[USE_CLEARCOAT_NORMAL], SHADING_OF(m).clearcoat_normal_scale, s.ns, clearcoat_tangent) * side;
            out_.bsdf.clearcoat.normal = to_frame(out_.frame, towards(nc, wo));
        } else if (HAS_CLEARCOAT && mapped) {
            // the clearcoat has its own normals, or none
            out_.bsdf.clearcoat.normal = to_frame(out_.frame, towards(s.ns * side, wo));
        }
    }
    if (HAS_SHADING_NORMALS) out_.bsdf.ng = to_frame(out_.frame, out_.ng);
    return out_;
}

#endif
