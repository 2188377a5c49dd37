#version 460
#extension GL_EXT_ray_tracing : require
#include "common/extensions.glsl"
#include "scene/scene.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 attributes;

void main() {
    payload.t = gl_HitTEXT;
    payload.instance = uint(gl_InstanceCustomIndexEXT);
    // alpha-tested triangles are the second geometry of their BLAS
    payload.primitive = uint(gl_PrimitiveID) +
        (gl_GeometryIndexEXT != 0 ? InstanceRecords(SceneRoot(push.scene).instances).v[gl_InstanceCustomIndexEXT].opaque_count : 0u);
    payload.u = attributes.x;
    payload.v = attributes.y;
}
