// Surface positions in the previous frame.
#ifndef SCENE_MOTION
#define SCENE_MOTION
#include "scene/surface.glsl"

// World position, in the previous frame, of the surface point of `hit`.
vec3 previous_position(Hit hit, Surface s) {
    SceneRoot root = SceneRoot(push.scene);
    if (is_null(root.motion)) return s.position;
    uvec2 records = LOAD_PAIR(root.scene_instances, hit.instance);
    InstanceRecord instance = load_instance_record(root.instances, records.x);
    MotionRecord motion = MotionRecords(root.motion).v[records.x];
    vec3 p;
    if (is_null(motion.previous_positions)) {
        p = transform_point(instance.world_to_group, s.position);
    } else {
        uvec3 corners = triangle_indices(SubmeshRecords(root.submeshes).v[records.y], s.primitive);
        vec3 v0 = load_vec3(motion.previous_positions, corners.x);
        vec3 v1 = load_vec3(motion.previous_positions, corners.y);
        vec3 v2 = load_vec3(motion.previous_positions, corners.z);
        p = v0 + (s.uv.x * (v1 - v0) + s.uv.y * (v2 - v0));
    }
    return transform_point(motion.previous_group_to_world, p);
}

#endif
