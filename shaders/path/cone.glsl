// Ray cones: how wide a path's footprint is, for the level of textures to read (Akenine-Moller et al., "Texture Level of Detail Strategies for
// Real-Time Ray Tracing", 2019, and "Improved Shader and Texture Level of Detail Using Ray Cones", 2021). A cone starts as a pixel and has no
// direction across: footprints are squares. docs/design/paths.md says what else is left out.
#ifndef PATH_CONE
#define PATH_CONE
#include "scene/surface.glsl"
#include "path/params.glsl"
#include "bsdf/bsdf.glsl"

struct Cone {
    float width;   // scene units
    float spread;  // what it grows by per unit of length; negative: it narrows
};

// Stands for log2 of no footprint: level 0.
const float SHARP = -1e9;

// Added to levels: interpolation between texels and the places of samples in the pixel blur once more.
const float SHARPER = -0.5;

// A scattered ray stands for a share of its lobe: the solid angle that one sample of its density has, times this. All of it would average
// over what the directions of other samples see.
const float SHARE_OF_LOBE = 0.25;
// No cone widens or narrows faster.
const float MAX_SPREAD = 1.0;

// A pixel's. Lenses do not widen it: their samples do what they are there for.
Cone camera_cone(BlockParams p, vec3 direction) {
    vec2 pixel = 2.0 * p.view / vec2(p.image_size);
    float side = sqrt(pixel.x * pixel.y);
    if (p.orthographic != 0u) return Cone(side, 0.0);
    vec4 rows[3] = p.camera_to_world;
    // a pixel off the middle is farther away
    float spread = side * abs(dot(vec3(rows[0].z, rows[1].z, rows[2].z), direction));
    return Cone(spread * clipped_length(p, direction), spread);
}

// The cone after a distance.
Cone cone_after(Cone c, float length_) {
    c.width += c.spread * length_;
    // beyond its narrowest it is as wide as before
    return c.width < 0.0 ? Cone(-c.width, -c.spread) : c;
}

// log2 of the footprint's side on the triangle, over the root of the triangle's doubled area; SHARP where there is nothing to look up. On a texture,
// of which the triangle covers some doubled area in texels, that is a level plus a constant of the triangle.
float footprint(Cone c, Surface s, vec3 direction) {
    SubmeshRecord submesh = load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh);
    if (HAS_SPHERES && is_null(submesh.indices)) return SHARP;
    uvec3 corners = triangle_indices(submesh, s.primitive);
    vec3 v0 = load_vec3(submesh.positions, corners.x);
    vec3 edge1 = load_vec3(submesh.positions, corners.y) - v0;
    vec3 edge2 = load_vec3(submesh.positions, corners.z) - v0;
    if (!SINGLE_LEVEL) {
        vec4 rows[3] = InstanceRecords(SceneRoot(push.scene).instances).v[s.tlas_instance].group_to_world;
        edge1 = transform_vector(rows, edge1);
        edge2 = transform_vector(rows, edge2);
    }
    // products of small edges underflow
    float largest = max(max(max(abs(edge1.x), abs(edge1.y)), abs(edge1.z)), max(max(abs(edge2.x), abs(edge2.y)), abs(edge2.z)));
    float area = largest > 0.0 ? length(cross(edge1 / largest, edge2 / largest)) : 0.0;
    if (!(area > 0.0 && c.width > 0.0)) return SHARP;
    // a square of its area: as long as it is on a slant (without the half) images lose more to blur than they gain, and what lies across it lies along
    // the samples of the pixel
    float stretch = -0.5 * log2(max(abs(dot(s.ng, direction)), 1e-6));
    return SHARPER + log2(c.width) + stretch - 0.5 * log2(area) - log2(largest);
}

// Curvature: rotation of the interpolated normal along the surface, per scene unit: the mean over the triangle's edges. Positive: it bulges out at the front.
// Normal maps are ignored.
float curvature(Surface s) {
    SubmeshRecord submesh = load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh);
    InstanceRecord instance;
    if (!SINGLE_LEVEL) instance = InstanceRecords(SceneRoot(push.scene).instances).v[s.tlas_instance];
    if (HAS_SPHERES && is_null(submesh.indices)) {
        float radius = uintBitsToFloat(Quads(submesh.positions).v[s.primitive].w);
        if (!SINGLE_LEVEL) {
            vec4 rows[3] = instance.group_to_world;
            radius *= pow(abs(dot(rows[0].xyz, cross(rows[1].xyz, rows[2].xyz))), 1.0 / 3.0);
        }
        return 1.0 / radius;
    }
    if (is_null(submesh.normals)) return 0.0;
    uvec3 corners = triangle_indices(submesh, s.primitive);
    vec3 p[3], n[3];
    for (uint k = 0u; k < 3u; k++) {
        p[k] = load_vec3(submesh.positions, corners[k]);
        n[k] = load_vec3(submesh.normals, corners[k] - submesh.first_vertex);
        if (!SINGLE_LEVEL) {
            p[k] = transform_vector(instance.group_to_world, p[k]);
            n[k] = transform_transposed(instance.world_to_group, n[k]);
        }
        n[k] /= max(length(n[k]), 1e-30);
    }
    float sum = 0.0;
    for (uint k = 0u; k < 3u; k++) {
        vec3 along = p[(k + 1u) % 3u] - p[k];
        float length2 = dot(along, along);
        if (length2 > 0.0) sum += dot(n[(k + 1u) % 3u] - n[k], along) / length2;
    }
    return (dot(n[0] + n[1] + n[2], s.ng) < 0.0 ? -1.0 : 1.0) * sum / 3.0;
}

// After a bounce. By the paraxial equations, with the mean of what a curved mirror or lens does along the plane of incidence and across it; a lobe
// adds its own width.
Cone scattered_cone(Cone c, Surface s, bool front, BsdfSample b, bool passes) {
    float turn = HAS_SHADING_NORMALS || HAS_SPHERES ? (front ? 1.0 : -1.0) * curvature(s) * c.width : 0.0;
    if (!passes) c.spread += 2.0 * turn;
    else if (b.eta != 1.0) c.spread = (c.spread + turn) / b.eta - turn;
    if (!b.delta) c.spread = sqrt(c.spread * c.spread + SHARE_OF_LOBE / b.pdf);
    c.spread = clamp(c.spread, -MAX_SPREAD, MAX_SPREAD);
    return c;
}

#endif
