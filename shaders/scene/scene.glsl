// The scene in device memory, reached from one root by device address. Mirrors src/tracer/gpu_scene.rs field by field.
#ifndef SCENE_SCENE
#define SCENE_SCENE
#include "common/types.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer SceneRoot {
    uvec2 instances;   // InstanceRecord: an entry of the top level
    uvec2 parts;       // PartRecord: a mesh within a group
    uvec2 placements;  // uvec2 per instance of the scene: its InstanceRecord and its PartRecord
    uvec2 materials;   // MaterialRecord
    uvec2 textures;    // TextureRecord
    uvec2 nodes;       // compute tracer: nodes of its hierarchy
    uvec2 primitives;  // compute tracer, readable kernels: records of shaders/trace/records.glsl
    uvec2 top_level;   // hardware tracers: address of the top-level acceleration structure
    uint part_count;   // records in parts
    uint root_reserved1;
    uvec2 launch_hits; // compute tracer: what a launch's rays met
    uint root;         // compute tracer: where traversal begins
    uint root_reserved;
    uvec2 unfinished;  // compute tracer: counts rays whose traversal the driver cut short
    uvec2 launch_counters; // compute tracer: rays taken by each work-group
    uvec2 motion;      // MotionRecord of each entry of the top level; null: nothing moves
    uvec2 shading;     // ShadingRecord of each material (shaders/path/shading.glsl); null: nobody asks
    uvec2 albedo;      // tables of shaders/bsdf/albedo.glsl; null: no material asks
    vec4 bounds_min;   // compute tracer: of everything, padded as the hierarchy's boxes are
    vec4 bounds_max;
    uvec2 mips;        // MipRecord of each texture (shaders/scene/mipmap.glsl); null: nobody asks
    uvec2 root_reserved2;
};

// Matrices are three rows of an affine map. Group space is the space of the bottom level's vertices.
struct InstanceRecord {
    vec4 group_to_world[3];
    vec4 world_to_group[3];
    uvec2 part_of;        // uint per primitive of the group: its part, counted from first_part; null when there is one part
    uint first_part;
    uint scene_instance;  // INVALID: ask the part
    uint root;            // compute tracer, readable kernels: node of this group
    uint opaque_count;    // hardware tracers: primitives from here on are in the second geometry (alpha tested)
    uint reserved0;
    uint reserved1;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer InstanceRecords { InstanceRecord v[]; };

struct PartRecord {
    uvec2 indices;     // 3 uints per triangle of the group; null for spheres
    uvec2 positions;   // 3 floats per vertex of the group; 4 per sphere: centre and radius
    uvec2 normals;     // 3 floats per vertex of the part; null: flat
    uvec2 texcoords0;  // 2 floats per vertex of the part; null: none
    uvec2 texcoords1;
    uvec2 colors;      // 4 floats per vertex of the part; null: none
    uint first_primitive;
    uint first_vertex;
    uint material;
    uint scene_instance;
    uint mirrored;     // 1: the vertices were baked through a transform that turned their winding
    uint part_reserved;
    uvec2 tangents;    // 4 floats per vertex of the part; null: no material asks
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer PartRecords { PartRecord v[]; };

struct MaterialRecord {
    vec4 base_color;
    vec4 texcoord_transform;  // 2x2, column by column
    vec2 texcoord_offset;
    uint base_color_texture;  // INVALID: none
    uint texcoord_set;
    float alpha_cutoff;       // present where alpha >= cutoff; negative: always
    uint coverage;            // 1: present with a probability of alpha, whatever the cutoff
    uint material_reserved1;
    uint material_reserved2;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer MaterialRecords { MaterialRecord v[]; };

// A texture and where on it a surface is.
struct TextureUse {
    vec4 transform;  // 2x2, column by column
    vec2 offset;
    uint texture;    // INVALID: none
    uint set;        // of texture coordinates
};

const uint FORMAT_UNORM8 = 0u;   // a uint each
const uint FORMAT_UNORM16 = 1u;  // a uvec2 each
const uint FORMAT_FLOAT = 2u;    // a vec4 each: linear, whatever the use

struct TextureRecord {
    uvec2 texels;  // RGBA, rows from the top
    uint width;
    uint height;
    uint wrap_u;   // 0 repeat, 1 mirror, 2 clamp
    uint wrap_v;
    uint nearest;  // 1: nearest, 0: bilinear
    uint format;   // one of FORMAT_*
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer TextureRecords { TextureRecord v[]; };

// The part of a group's primitive, as an index into SceneRoot.parts.
uint part_index(InstanceRecords instances, uint instance, uint primitive) {
    uvec2 part_of = instances.v[instance].part_of;
    uint first = instances.v[instance].first_part;
    return is_null(part_of) ? first : first + Words(part_of).v[primitive];
}

// From what a tracer knows (entry of the top level, primitive of its group) to the ids of the scene.
Hit scene_hit(float t, uint instance, uint primitive, vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    InstanceRecords instances = InstanceRecords(root.instances);
    if (SINGLE_LEVEL) instance = 0u;
    uint scene_instance = instances.v[instance].scene_instance;
    PartRecords parts = PartRecords(root.parts);
    if (root.part_count == 1u) {
        // it begins with the group
        if (scene_instance == INVALID) scene_instance = parts.v[0].scene_instance;
    } else if (scene_instance == INVALID) {
        uint part = part_index(instances, instance, primitive);
        scene_instance = parts.v[part].scene_instance;
        primitive -= parts.v[part].first_primitive;
    }
    return Hit(t, scene_instance, primitive, uv.x, uv.y);
}

vec3 transform_point(vec4 rows[3], vec3 p) {
    return vec3(dot(rows[0].xyz, p), dot(rows[1].xyz, p), dot(rows[2].xyz, p)) + vec3(rows[0].w, rows[1].w, rows[2].w);
}

vec3 transform_vector(vec4 rows[3], vec3 v) {
    return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}

// v * M: with M = world-to-object this takes normals from object to world space
vec3 transform_transposed(vec4 rows[3], vec3 v) {
    return rows[0].xyz * v.x + rows[1].xyz * v.y + rows[2].xyz * v.z;
}

#endif
