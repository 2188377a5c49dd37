// Primitive records of the binary and brute-force kernels.
#ifndef TRACE_PRIMITIVE
#define TRACE_PRIMITIVE
#include "interface/hierarchy.glsl"
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/triangle.glsl"

#define LOAD_FLOATS(base, i) uintBitsToFloat(LOAD_PAIR(base, i))

// Intersects the ray with record `i` within (tmin, tmax). Returns the primitive's index in the group, the distance, and the barycentric weights of a triangle's second and third
// vertex.
bool meets_record(uvec2 primitives, uint i, uint instance, Shear shear, vec3 origin, vec3 direction, float tmin, float tmax,
        out uint primitive, out float t, out vec2 uv) {
    vec2 w0 = LOAD_FLOATS(primitives, TRIANGLE_RECORD_PAIRS * i), w1 = LOAD_FLOATS(primitives, TRIANGLE_RECORD_PAIRS * i + 1u);
    vec2 w2 = LOAD_FLOATS(primitives, TRIANGLE_RECORD_PAIRS * i + 2u), w3 = LOAD_FLOATS(primitives, TRIANGLE_RECORD_PAIRS * i + 3u);
    vec2 w4 = LOAD_FLOATS(primitives, TRIANGLE_RECORD_PAIRS * i + 4u);
    uint id = floatBitsToUint(TRIANGLE_RECORD_NUMBER);
    primitive = id & NUMBER;
    bool met;
    if (HAS_SPHERES && (id & SPHERE) != 0u) {
        t = intersect_sphere(origin, direction, tmin, tmax, SPHERE_RECORD_CENTER(vec3), SPHERE_RECORD_RADIUS);
        uv = vec2(0.0);
        met = t > tmin && t < tmax;
    } else {
        met = intersect_triangle(shear, origin, direction, TRIANGLE_RECORD_CORNERS_0(vec3), TRIANGLE_RECORD_CORNERS_1(vec3),
            TRIANGLE_RECORD_CORNERS_2(vec3), tmin, tmax, t, uv);
    }
    if (HAS_ALPHA) {
        if (met && (id & ALPHA_TESTED) != 0u) met = alpha_passes(instance, primitive, uv, tmin);
    }
    return met;
}

#endif
