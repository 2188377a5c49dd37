// Base colour and alpha at a point of a submesh.
#ifndef SCENE_MATERIAL
#define SCENE_MATERIAL
#include "scene/texture.glsl"
#include "common/ray_seed.glsl"

// Vertex indices of a triangle in its group. `primitive` is an index in the group.
uvec3 triangle_indices(SubmeshRecord submesh, uint primitive) { return load_triple(submesh.indices, primitive); }

// Where a set of texture coordinates is, and in it those of vertices of the group. Sets from 1 on lie side by side, vertex by vertex.
uvec2 texcoord_set(SubmeshRecord submesh, uint set) { return set == 0u ? submesh.texcoords0 : submesh.texcoords1; }
uvec3 texcoord_indices(SubmeshRecord submesh, uvec3 corners, uint set) {
    corners -= submesh.first_vertex;
    if (!HAS_MANY_TEXCOORDS || set == 0u) return corners;
    return corners * submesh.texcoord_sets + (set - 1u);
}

vec2 texcoord_at(SubmeshRecord submesh, uvec3 corners, vec2 uv, uint set) {
    uvec2 base = texcoord_set(submesh, set);
    if (is_null(base)) return vec2(0.0);
    corners = texcoord_indices(submesh, corners, set);
    return load_vec2(base, corners.x) * (1.0 - uv.x - uv.y) + load_vec2(base, corners.y) * uv.x + load_vec2(base, corners.z) * uv.y;
}

vec4 vertex_color(SubmeshRecord submesh, uvec3 corners, vec2 uv) {
    if (is_null(submesh.colors)) return vec4(1.0);
    corners -= submesh.first_vertex;
    return load_quad(submesh.colors, corners.x) * (1.0 - uv.x - uv.y) + load_quad(submesh.colors, corners.y) * uv.x + load_quad(submesh.colors, corners.z) * uv.y;
}

// Texture coordinates that a transform (2x2, column by column) and an offset make of others.
vec2 transform_texcoord(vec4 m, vec2 offset, vec2 st) { return vec2(m.x * st.x + m.z * st.y, m.y * st.x + m.w * st.y) + offset; }

// Linear base colour with alpha at barycentrics uv of a primitive (an index in the group), or at texture coordinates uv of a sphere, whose alpha is the same
// everywhere.
vec4 base_color(SubmeshRecord submesh, MaterialRecord material, uint primitive, vec2 uv) {
    vec4 color = material.base_color;
    bool is_sphere = is_null(submesh.indices);
    if (is_sphere && !(HAS_SPHERES && submesh.texcoord_sets != 0u)) return color;
    vec2 st = uv;
    if (!is_sphere) {
        uvec3 corners = triangle_indices(submesh, primitive);
        color *= vertex_color(submesh, corners, uv);
        if (material.base_color_texture != INVALID) st = texcoord_at(submesh, corners, uv, material.texcoord_set);
    }
    if (material.base_color_texture == INVALID) return color;
    // in one place: drivers compile a copy of the look-up for each
    vec4 found = sample_texture(material.base_color_texture, transform_texcoord(material.texcoord_transform, material.texcoord_offset, st), true);
    return color * vec4(found.rgb, is_sphere ? 1.0 : found.a);
}

// A uniform random number in [0, 1) for a ray and a primitive, the same in every call. Rays without a seed are distinguished by the bits of their barycentrics
// on the primitive.
float coverage_threshold(uint instance, uint primitive, vec2 uv, float tmin) {
    uvec2 ray = has_seed(tmin) ? uvec2(floatBitsToUint(tmin), 0u) : floatBitsToUint(uv);
    return float(hash_combine(hash_combine(hash_combine(hash(ray.x), ray.y), instance), primitive) >> 8) * (1.0 / 16777216.0);
}

// Whether an alpha-tested primitive is opaque at this point, for a ray that begins at tmin.
bool alpha_passes(uint instance, uint primitive, vec2 uv, float tmin) {
    SceneRoot root = SceneRoot(push.scene);
    InstanceRecords instances = InstanceRecords(root.instances);
    SubmeshRecord submesh = SubmeshRecords(root.submeshes).v[submesh_index(instances, instance, primitive)];
    MaterialRecord material = MaterialRecords(root.materials).v[submesh.material];
    float alpha = base_color(submesh, material, primitive, uv).a;
    if (HAS_COVERAGE && material.coverage != 0u) return alpha > coverage_threshold(instance, primitive, uv, tmin);
    return alpha >= material.alpha_cutoff;
}

#endif
