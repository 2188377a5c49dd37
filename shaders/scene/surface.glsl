// Surface points of hits, with a ray offset from an error bound.
#ifndef SCENE_SURFACE
#define SCENE_SURFACE
#include "scene/corners.glsl"
#include "scene/material.glsl"
#include "scene/sphere.glsl"

struct Surface {
    vec3 position;   // world
    vec3 ng;         // unit geometric normal, world, on the front (counter-clockwise) side
    vec3 ns;         // unit shading normal, on the side of ng
    float offset;    // distance along +-ng at which a new ray cannot hit this surface again
    uint submesh;    // index of the SubmeshRecord
    uint tlas_instance;  // index of the InstanceRecord
    uint primitive;  // index in the group
    vec2 uv;
};

// Object- and world-space rounding as bounded by Moreau, "Solving Self-Intersection Artifacts in DirectX Raytracing" (2022):
// the reconstruction of the point from barycentrics, the intersection test, and the two transforms. c0..c2 are his
// constants: 1, 3 and 2 half-ulps with margin.
const float C0 = 5.9604645e-8;
const float C1 = 1.7881394e-7;
const float C2 = 1.1920930e-7;

vec3 abs_transform_vector(vec4 rows[3], vec3 v) {
    return vec3(dot(abs(rows[0].xyz), v), dot(abs(rows[1].xyz), v), dot(abs(rows[2].xyz), v));
}

// Offset along the unit world normal, from the object-space error per axis, for a point with unnormalised normals.
float spawn_offset(vec4 group_to_world[3], vec4 world_to_group[3], vec3 p, vec3 world, vec3 error, vec3 normal, vec3 ng, float scale) {
    vec3 translation = vec3(group_to_world[0].w, group_to_world[1].w, group_to_world[2].w);
    vec3 world_error = C1 * abs_transform_vector(group_to_world, abs(p)) + C2 * abs(translation);
    vec3 back = vec3(world_to_group[0].w, world_to_group[1].w, world_to_group[2].w);
    error += C2 * (abs_transform_vector(world_to_group, abs(world)) + abs(back));
    return dot(error, abs(normal)) * scale + dot(world_error, abs(ng));
}

// A point of a triangle in its group's space: with its unit normal, and bounds on the rounding of the reconstruction and of the intersection test.
struct TrianglePoint {
    vec3 p;
    vec3 normal;
    vec3 error;
};

TrianglePoint triangle_point(Corners c, vec2 uv) {
    vec3 v0 = c.p[0], edge1 = c.p[1] - v0, edge2 = c.p[2] - v0;
    TrianglePoint point;
    // the base corner last: its rounding is the smallest that way
    point.p = v0 + (uv.x * edge1 + uv.y * edge2);
    vec3 normal = cross(edge1, edge2);
    vec3 extents = abs(edge1) + abs(edge2) + abs(abs(edge1) - abs(edge2));
    float extent = max(max(extents.x, extents.y), extents.z);
    point.error = C0 * abs(v0) + vec3(C1 * extent);
    // a tiny triangle's cross product underflows: normalise before the transform
    float largest = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    point.normal = largest > 0.0 ? normalize(normal / largest) : vec3(0.0, 0.0, 1.0);
    return point;
}

vec4[3] identity_rows() {
    return vec4[3](vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0, 1.0, 0.0, 0.0), vec4(0.0, 0.0, 1.0, 0.0));
}

#ifdef KEEPS_CORNERS
// Position, geometric normal and offset of the triangle that the kernel has hit in a scene of one level, without the records of its submesh: a mirrored one's normal
// points to its back.
Surface surface_of_corners(Hit hit) {
    Surface s;
    s.uv = vec2(hit.u, hit.v);
    TrianglePoint point = triangle_point(hit_corners, s.uv);
    vec4 rows[3] = identity_rows();
    s.position = transform_point(rows, point.p);
    vec3 n = transform_transposed(rows, point.normal);
    float scale = inversesqrt(dot(n, n));
    s.ng = n * scale;
    s.ns = s.ng;
    s.offset = spawn_offset(rows, rows, point.p, s.position, point.error, point.normal, s.ng, scale);
    s.submesh = INVALID;
    s.tlas_instance = 0u;
    s.primitive = INVALID;
    return s;
}
#endif

// The surface point of a hit. It is computed from the triangle's vertices, not from origin + t * direction, whose error
// grows with t.
Surface surface_at(Ray ray, Hit hit) {
    SceneRoot root = SceneRoot(push.scene);
    uvec2 records = uvec2(0u);
    SubmeshRecord submesh;
    // a scene of one submesh: read uniformly, without a gather
    if (root.submesh_count == 1u) {
        submesh = load_submesh_record(root.submeshes, 0u);
        records.x = SINGLE_LEVEL ? 0u : LOAD_PAIR(root.scene_instances, hit.instance).x;
    } else {
        records = LOAD_PAIR(root.scene_instances, hit.instance);
        submesh = load_submesh_record(root.submeshes, records.y);
        if (SINGLE_LEVEL && !HAS_SPHERES) {
            // submeshes of one group share its arrays, which are uniform too
            submesh.indices = SubmeshRecords(root.submeshes).v[0].indices;
            submesh.positions = SubmeshRecords(root.submeshes).v[0].positions;
        }
    }
    InstanceRecord instance;
    if (SINGLE_LEVEL) {
        // one TLAS instance without a transform
        instance.group_to_world = identity_rows();
        instance.world_to_group = identity_rows();
    } else {
        instance = load_instance_record(root.instances, records.x);
    }
    Surface s;
    s.submesh = records.y;
    s.tlas_instance = SINGLE_LEVEL ? 0u : records.x;
    s.primitive = hit.primitive + submesh.first_primitive;
    s.uv = vec2(hit.u, hit.v);

    vec3 p, normal, error;
    vec3 shading = vec3(0.0);
    if (HAS_SPHERES && is_null(submesh.indices)) {
        vec4 sphere = load_quad(submesh.positions, s.primitive);
        vec3 at = transform_point(instance.world_to_group, ray.origin) + hit.t * transform_vector(instance.world_to_group, ray.direction);
        normal = normalize(at - sphere.xyz);
        p = sphere.xyz + sphere.w * normal;
        if (submesh.texcoord_sets != 0u) s.uv = sphere_texcoord(normal);
        // pbrt-v4 6.8.5 for the reprojected point, and the rounding of the centre's sum
        error = 5.0 * C0 * (abs(p) + vec3(sphere.w)) + 4.0 * C0 * abs(sphere.xyz);
    } else {
        TrianglePoint point = triangle_point(corners_of_hit(submesh, s.primitive), s.uv);
        p = point.p;
        normal = point.normal;
        error = point.error;
        if (!is_null(submesh.normals)) {
            uvec3 corners = triangle_indices(submesh, s.primitive) - submesh.first_vertex;
            shading = load_vec3(submesh.normals, corners.x) * (1.0 - s.uv.x - s.uv.y) + load_vec3(submesh.normals, corners.y) * s.uv.x +
                      load_vec3(submesh.normals, corners.z) * s.uv.y;
        }
    }
    s.position = transform_point(instance.group_to_world, p);
    vec3 n = transform_transposed(instance.world_to_group, normal);
    float scale = inversesqrt(dot(n, n));
    s.ng = n * scale;
    s.offset = spawn_offset(instance.group_to_world, instance.world_to_group, p, s.position, error, normal, s.ng, scale);
    vec3 ns = transform_transposed(instance.world_to_group, shading);
    float ns2 = dot(ns, ns);
    // a mirroring transform that was baked into the vertices has reversed their winding (glTF 2.0, 3.7.4)
    s.ng *= submesh.mirrored != 0u ? -1.0 : 1.0;
    s.ns = ns2 > 0.0 ? ns * inversesqrt(ns2) : s.ng;
    s.ns *= dot(s.ns, s.ng) < 0.0 ? -1.0 : 1.0;
    return s;
}

// Tangent of a sphere that has textures, along which u grows: as tangent_at.
vec4 sphere_tangent(Surface s) {
    vec2 c = on_circle(s.uv.x);
    vec3 t = vec3(-c.y, c.x, 0.0);
    float w = 1.0;
    if (!SINGLE_LEVEL) {
        vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[s.tlas_instance].group_to_world;
        t = normalize(transform_vector(rows, t));
        if (dot(rows[0].xyz, cross(rows[1].xyz, rows[2].xyz)) < 0.0) w = -w;
    }
    return vec4(t, w);
}

// Unit tangent (world space, not yet orthogonal to the normal) with handedness in w: the bitangent is w * cross(normal, tangent) about the normal of the
// front. w = 0 without a tangent. `tangents`: one of the submesh's arrays.
vec4 tangent_at(Surface s, SubmeshRecord submesh, uvec2 tangents) {
    uvec3 corners = triangle_indices(submesh, s.primitive) - submesh.first_vertex;
    vec4 a = load_quad(tangents, corners.x);
    vec3 t = a.xyz * (1.0 - s.uv.x - s.uv.y) + load_quad(tangents, corners.y).xyz * s.uv.x + load_quad(tangents, corners.z).xyz * s.uv.y;
    float w = a.w;
    if (!SINGLE_LEVEL) {
        vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[s.tlas_instance].group_to_world;
        t = transform_vector(rows, t);
        // a mirroring transform reverses the bitangent relative to the cross product
        if (dot(rows[0].xyz, cross(rows[1].xyz, rows[2].xyz)) < 0.0) w = -w;
    }
    float t2 = dot(t, t);
    return t2 > 0.0 ? vec4(t * inversesqrt(t2), w) : vec4(0.0);
}

#endif
