#version 460
#extension GL_EXT_ray_tracing : require
#include "common/extensions.glsl"
#include "common/types.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.t = INFINITY;
}
