// Directions in a cone.
#ifndef LIGHTS_CONE
#define LIGHTS_CONE
#include "common/warp.glsl"

// A direction in a cone about an axis, uniformly distributed over its solid angle.
vec3 sample_cone(vec3 axis, float one_minus_cos, vec2 u) {
    float z = u.x * one_minus_cos;
    float r = sqrt(z * (2.0 - z));
    return to_world(axis, vec3(r * on_circle(u.y), 1.0 - z));
}

#endif
