// Base colour and alpha at a point of a part (submesh).
#ifndef SCENE_MATERIAL
#define SCENE_MATERIAL
#include "scene/texture.glsl"
#include "common/ray_seed.glsl"

// Vertex indices of a triangle in its group. `primitive` is an index in the group.
uvec3 triangle_indices(PartRecord part, uint primitive) {
    Words w = Words(part.indices);
    return uvec3(w.v[3u * primitive], w.v[3u * primitive + 1u], w.v[3u * primitive + 2u]);
}

vec2 texcoord_at(PartRecord part, uvec3 corners, vec2 uv, uint set) {
    uvec2 base = set == 1u ? part.texcoords1 : part.texcoords0;
    if (is_null(base)) return vec2(0.0);
    corners -= part.first_vertex;
    return load_vec2(base, corners.x) * (1.0 - uv.x - uv.y) + load_vec2(base, corners.y) * uv.x + load_vec2(base, corners.z) * uv.y;
}

vec4 vertex_color(PartRecord part, uvec3 corners, vec2 uv) {
    if (is_null(part.colors)) return vec4(1.0);
    corners -= part.first_vertex;
    Quads q = Quads(part.colors);
    return uintBitsToFloat(q.v[corners.x]) * (1.0 - uv.x - uv.y) + uintBitsToFloat(q.v[corners.y]) * uv.x +
           uintBitsToFloat(q.v[corners.z]) * uv.y;
}

// Linear base colour with alpha at barycentrics uv of a primitive (an index in the group). Spheres have no texture coordinates.
vec4 base_color(PartRecord part, MaterialRecord material, uint primitive, vec2 uv) {
    vec4 color = material.base_color;
    if (is_null(part.indices)) return color;
    uvec3 corners = triangle_indices(part, primitive);
    color *= vertex_color(part, corners, uv);
    if (material.base_color_texture != INVALID) {
        vec2 st = texcoord_at(part, corners, uv, material.texcoord_set);
        vec4 m = material.texcoord_transform;
        st = vec2(m.x * st.x + m.z * st.y, m.y * st.x + m.w * st.y) + material.texcoord_offset;
        color *= sample_texture(material.base_color_texture, st, true);
    }
    return color;
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
    PartRecord part = PartRecords(root.parts).v[part_index(instances, instance, primitive)];
    MaterialRecord material = MaterialRecords(root.materials).v[part.material];
    float alpha = base_color(part, material, primitive, uv).a;
    if (HAS_COVERAGE && material.coverage != 0u) return alpha > coverage_threshold(instance, primitive, uv, tmin);
    return alpha >= material.alpha_cutoff;
}

#endif
