#version 460
#extension GL_EXT_ray_tracing : require
#include "common/extensions.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.t = gl_HitTEXT;
    payload.instance = uint(gl_InstanceCustomIndexEXT);
    payload.primitive = uint(gl_PrimitiveID);
    payload.u = 0.0;
    payload.v = 0.0;
}
