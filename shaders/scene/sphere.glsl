// Ray-sphere intersection.
#ifndef SCENE_SPHERE
#define SCENE_SPHERE
#include "common/warp.glsl"

// The nearest t in (tmin, tmax), or a value outside of it. The direction need not have unit length. Discriminant from
// the perpendicular distance and stable roots: Haines, Gunther, Akenine-Moeller, "Precision Improvements for Ray/Sphere
// Intersection", Ray Tracing Gems 2019.
float intersect_sphere(vec3 origin, vec3 direction, float tmin, float tmax, vec3 center, float radius) {
    vec3 f = origin - center;
    float a = dot(direction, direction);
    float b = -dot(f, direction);
    vec3 l = f + (b / a) * direction;
    float discriminant = radius * radius - dot(l, l);
    if (!(discriminant >= 0.0)) return tmax;
    // (|f| - r)(|f| + r) instead of |f|^2 - r^2: no cancellation for an origin on the sphere
    float distance = length(f);
    float c = (distance - radius) * (distance + radius);
    float q = b + (b < 0.0 ? -1.0 : 1.0) * sqrt(a * discriminant);
    float t0 = c / q;
    float t1 = q / a;
    float near = min(t0, t1);
    float far = max(t0, t1);
    return near > tmin ? near : far > tmin ? far : tmax;
}

// Texture coordinates of the point with a unit normal in object space: pbrt's u = phi / (2 pi) around the z axis, and theta / pi, which is its v turned over,
// for v of images goes down. Sphere::texcoord of src/scene/mesh.rs.
vec2 sphere_texcoord(vec3 n) {
    float turns = turns_of(n.y, n.x);
    // of an angle whose cosine is all but 1 its sine has the digits
    return vec2(turns < 0.0 ? turns + 1.0 : turns, 2.0 * turns_of(length(n.xy), n.z));
}

#endif
