// The fast kernels' leaves: a sphere, or a pair of triangles that share an edge (src/accel/pairs.rs).
#ifndef TRACE_LEAF
#define TRACE_LEAF
#include "interface/hierarchy.glsl"
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/triangle.glsl"

// The words of a primitive leaf of either kind: primitive indices with flags, and the order of the triangles' corners.
#define FIRST_ID TRIANGLE_LEAF_PRIMITIVES.x
#define SECOND_ID TRIANGLE_LEAF_PRIMITIVES.y
#define ORDER TRIANGLE_LEAF_ORDER

// The weight of the corner at position `k` of a triangle.
float pick_weight(vec3 weights, uint k) {
    k &= 3u;
    return k == 0u ? weights.x : k == 1u ? weights.y : weights.z;
}

// Accepts a hit of a triangle: `id` is its index with flags, `turn` has the positions of its second and third vertex
// among the corners. Computes their barycentric weights and tests alpha.
bool is_there(uint id, uint turn, uint instance, vec3 weights, float tmin, out vec2 uv) {
    uv = vec2(pick_weight(weights, turn), pick_weight(weights, turn >> 2));
    bool met = true;
    if (HAS_ALPHA) {
        if ((id & ALPHA_TESTED) != 0u) met = alpha_passes(instance, id & NUMBER, uv, tmin);
    }
    return met;
}

// Intersects one triangle of a pair, after the edge tests: corners in space, and in the ray's frame.
bool meets_triangle(uint id, uint turn, uint instance, Shear shear, vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2,
        Corner a, Corner b, Corner c, vec3 edges, float tmin, float tmax, out float t, out vec2 uv) {
    vec3 weights;
    bool met = meets_between(shear, origin, direction, v0, v1, v2, a, b, c, edges, tmin, tmax, t, weights);
    if (met) met = is_there(id, turn, instance, weights, tmin, uv);
    return met;
}

bool meets_moller_trumbore(uint id, uint turn, uint instance, vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, float tmin,
        float tmax, out float t, out vec2 uv) {
    vec2 vw;
    bool met = id != INVALID && intersect_moller_trumbore(origin, direction, v0, v1, v2, tmin, tmax, t, vw);
    if (met) met = is_there(id, turn, instance, vec3(1.0 - vw.x - vw.y, vw), tmin, uv);
    return met;
}

bool meets_sphere(vec3 origin, vec3 direction, vec3 center, float radius, float tmin, float tmax, out float t, out vec2 uv) {
    t = intersect_sphere(origin, direction, tmin, tmax, center, radius);
    uv = vec2(0.0);
    return t > tmin && t < tmax;
}

#endif
