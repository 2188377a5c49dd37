// The scene in device memory, reached from one root by device address.
#ifndef SCENE_SCENE
#define SCENE_SCENE
#include "common/types.glsl"
#include "interface/scene.glsl"
#include "interface/texel_format.glsl"
#include "interface/wrap.glsl"

// The submesh of a group's primitive, as an index into SceneRoot.submeshes.
uint submesh_index(InstanceRecords instances, uint instance, uint primitive) {
    uvec2 submesh_of = instances.v[instance].submesh_of;
    uint first = instances.v[instance].first_submesh;
    return is_null(submesh_of) ? first : first + Words(submesh_of).v[primitive];
}

// Converts a tracer's ids (TLAS instance, primitive in its group) to those of the scene.
Hit scene_hit(float t, uint instance, uint primitive, vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    InstanceRecords instances = InstanceRecords(root.instances);
    if (SINGLE_LEVEL) instance = 0u;
    uint scene_instance = instances.v[instance].scene_instance;
    SubmeshRecords submeshes = SubmeshRecords(root.submeshes);
    if (root.submesh_count == 1u) {
        // the only submesh begins at the first primitive of the group
        if (scene_instance == INVALID) scene_instance = submeshes.v[0].scene_instance;
    } else if (scene_instance == INVALID) {
        uint submesh = submesh_index(instances, instance, primitive);
        scene_instance = submeshes.v[submesh].scene_instance;
        primitive -= submeshes.v[submesh].first_primitive;
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
