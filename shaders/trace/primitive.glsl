// The readable kernels' primitives: one record each.
#ifndef TRACE_PRIMITIVE
#define TRACE_PRIMITIVE
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/records.glsl"
#include "trace/triangle.glsl"

#define LOAD_FLOATS(base, i) uintBitsToFloat(LOAD_PAIR(base, i))

// Does the ray meet record `i` within (tmin, tmax)? Its number in the group, where, and the weights of a triangle's second and third
// corner.
bool meets_record(uvec2 primitives, uint i, uint instance, Shear shear, vec3 origin, vec3 direction, float tmin, float tmax,
        out uint primitive, out float t, out vec2 uv) {
    vec2 a = LOAD_FLOATS(primitives, 5u * i), b = LOAD_FLOATS(primitives, 5u * i + 1u), c = LOAD_FLOATS(primitives, 5u * i + 2u);
    vec2 d = LOAD_FLOATS(primitives, 5u * i + 3u), e = LOAD_FLOATS(primitives, 5u * i + 4u);
    uint id = floatBitsToUint(e.y);
    primitive = id & NUMBER;
    bool met;
    if (HAS_SPHERES && (id & SPHERE) != 0u) {
        t = intersect_sphere(origin, direction, tmin, tmax, vec3(a, b.x), b.y);
        uv = vec2(0.0);
        met = t > tmin && t < tmax;
    } else {
        met = intersect_triangle(shear, origin, direction, vec3(a, b.x), vec3(b.y, c), vec3(d, e.x), tmin, tmax, t, uv);
    }
    if (HAS_ALPHA) {
        if (met && (id & ALPHA_TESTED) != 0u) met = alpha_passes(instance, primitive, uv, tmin);
    }
    return met;
}

#endif
