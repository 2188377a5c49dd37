// Where a pixel's exact ray meets the primitive that was drawn there.
#ifndef TRACE_DRAWN
#define TRACE_DRAWN
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/triangle.glsl"

// The ray in the space of an entry's group.
Ray to_group(Ray world, uint entry) {
    if (SINGLE_LEVEL) return world;
    vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[entry].world_to_group;
    return Ray(transform_point(rows, world.origin), world.tmin, transform_vector(rows, world.direction), world.tmax);
}

// A rasteriser rounds corners to a fraction of a pixel, so the ray may pass the triangle by so much. Then it meets the nearest
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
        // seen exactly from the side it has no inside
        weights = sum > 1e-37 && sum < 1e37 ? weights / sum : vec3(1.0, 0.0, 0.0);
        t = max(dot(weights, vec3(a.z, b.z, c.z) * shear.s.z), r.tmin);
    }
    uv = weights.yz;
}

void intersect_rasterized_sphere(Ray r, vec4 sphere, out float t, out vec2 uv) {
    uv = vec2(0.0);
    t = intersect_sphere(r.origin, r.direction, r.tmin, r.tmax, sphere.xyz, sphere.w);
    // it was met when it was drawn; a compiler that rounds otherwise may see it passed by
    if (!(t > r.tmin && t < r.tmax)) t = max(dot(sphere.xyz - r.origin, r.direction) / dot(r.direction, r.direction), r.tmin);
}

// `primitive` counts in the group. Distance along the ray, and the weights of a triangle's second and third corner.
void intersect_rasterized(Ray world, uint entry, uint primitive, out float t, out vec2 uv) {
    SceneRoot root = SceneRoot(push.scene);
    Ray r = to_group(world, entry);
    // a group's parts share its vertices
    PartRecord part = PartRecords(root.parts).v[root.part_count == 1u ? 0u : InstanceRecords(root.instances).v[entry].first_part];
    if (HAS_SPHERES && is_null(part.indices)) {
        intersect_rasterized_sphere(r, uintBitsToFloat(Quads(part.positions).v[primitive]), t, uv);
    } else {
        uvec3 corners = triangle_indices(part, primitive);
        intersect_rasterized_triangle(r, load_vec3(part.positions, corners.x), load_vec3(part.positions, corners.y),
            load_vec3(part.positions, corners.z), t, uv);
    }
}

#endif
