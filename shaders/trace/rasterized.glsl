// Intersects a pixel's exact ray with the primitive that was rasterized there.
#ifndef TRACE_DRAWN
#define TRACE_DRAWN
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/triangle.glsl"

// The ray in the space of a TLAS instance's group.
Ray to_group(Ray world, uint tlas_instance) {
    if (SINGLE_LEVEL) return world;
    vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[tlas_instance].world_to_group;
    return Ray(transform_point(rows, world.origin), world.tmin, transform_vector(rows, world.direction), world.tmax);
}

// A rasterizer rounds vertices to a fraction of a pixel, so the exact ray may miss the triangle by that much. Then the hit is the nearest
// point of its edge.
void intersect_rasterized_triangle(Ray r, vec3 v0, vec3 v1, vec3 v2, out float t, out vec2 uv) {
    Shear shear = make_shear(r.direction);
    Corner a = make_corner(shear, r.origin, v0), b = make_corner(shear, r.origin, v1), c = make_corner(shear, r.origin, v2);
    vec3 edges = vec3(edge(c, b), edge(a, c), edge(b, a));
    vec3 weights;
    bool met = false;
    if (is_inside(edges)) met = meets_between(shear, r.origin, r.direction, v0, v1, v2, a, b, c, edges, r.tmin, r.tmax, t, weights);
    if (!met) {
        float side = edges.x + edges.y + edges.z < 0.0 ? -1.0 : 1.0;
        weights = max(side * edges, vec3(0.0));
        float sum = weights.x + weights.y + weights.z;
        // a triangle seen exactly edge-on has no interior
        weights = sum > 1e-37 && sum < 1e37 ? weights / sum : vec3(1.0, 0.0, 0.0);
        t = max(dot(weights, vec3(a.z, b.z, c.z) * shear.s.z), r.tmin);
    }
    uv = weights.yz;
}

void intersect_rasterized_sphere(Ray r, vec4 sphere, out float t, out vec2 uv) {
    uv = vec2(0.0);
    t = intersect_sphere(r.origin, r.direction, r.tmin, r.tmax, sphere.xyz, sphere.w);
    // rasterization found it visible; a compiler that rounds differently may compute a miss
    if (!(t > r.tmin && t < r.tmax)) t = max(dot(sphere.xyz - r.origin, r.direction) / dot(r.direction, r.direction), r.tmin);
}

// `primitive` is an index in the group. Returns the distance along the ray, and the barycentric weights of a triangle's second and third vertex.
void intersect_rasterized(Ray world, uint tlas_instance, uint primitive, out float t, out vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    Ray r = to_group(world, tlas_instance);
    // the submeshes of a group share its vertices
    SubmeshRecord submesh = SubmeshRecords(root.submeshes).v[root.submesh_count == 1u ? 0u : InstanceRecords(root.instances).v[tlas_instance].first_submesh];
    if (HAS_SPHERES && is_null(submesh.indices)) {
        intersect_rasterized_sphere(r, uintBitsToFloat(Quads(submesh.positions).v[primitive]), t, uv);
    } else {
        uvec3 corners = triangle_indices(submesh, primitive);
        intersect_rasterized_triangle(r, load_vec3(submesh.positions, corners.x), load_vec3(submesh.positions, corners.y),
            load_vec3(submesh.positions, corners.z), t, uv);
    }
}

#endif
