// Lights: what emits, how it is chosen (by power, from an alias table, or from a tree), how a point on it is drawn and with which density. Mirrors
// src/render/path/lights.rs.
#ifndef PATH_LIGHTS
#define PATH_LIGHTS
#include "common/warp.glsl"
#include "path/map.glsl"
#include "path/light_tree.glsl"
#include "path/shading.glsl"

const uint LIGHT_POINT = 0u;
const uint LIGHT_SPOT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;
const uint LIGHT_TRIANGLE = 3u;
const uint LIGHT_SPHERE = 4u;
const uint LIGHT_ENVIRONMENT = 5u;
const uint LIGHT_TREE = 6u;  // all that have a place: one of them is drawn from the tree

const uint LIGHT_TWO_SIDED = 1u;  // triangle: it emits from its back, too
const uint LIGHT_MIRRORED = 2u;   // triangle: a mirroring transform has turned its winding

struct LightRecord {
    vec3 position;      // point, spot: where; triangle: first corner; sphere: centre
    float radius;       // sphere; directional: 1 - cosine of half the angle that it fills
    vec3 axis;          // spot, directional: where it shines; triangle: first edge
    float cos_inner;    // spot
    vec3 edge;          // triangle: second edge
    float cos_outer;    // spot
    vec3 intensity;     // point, spot: per solid angle; directional: irradiance; else: radiance, before any texture
    float range;        // point, spot: without effect beyond
    float probability;  // of being chosen
    float threshold;    // alias table: this one is chosen below it, `alias` above
    uint alias;         // of a light in the tree: its way from the root
    uint kind;
    uint instance;      // triangle, sphere: what is seen of it
    uint primitive;
    uint flags;         // LIGHT_TWO_SIDED, LIGHT_MIRRORED
    float lift;         // triangle, sphere: how far above itself rounding may have put it
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer LightRecords { LightRecord v[]; };

struct LightSample {
    vec3 wi;          // unit, towards the light
    float distance;   // to it, infinite for the environment
    vec3 to;          // a point on the light, for finite distances
    vec3 radiance;    // of a light without extent: times its solid angle
    float pdf;        // per solid angle, of point and choice; 0: nothing was drawn
    bool delta;       // no BSDF sample could find it
};

const LightSample NO_LIGHT_SAMPLE = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), vec3(0.0), 0.0, false);

// Radiance of an environment from direction w; and the density with which it is drawn, per solid angle.
vec3 environment_radiance(PathParams p, vec3 w) {
    if (!asks(ASKS_MAP)) return p.environment;
    return p.environment * map_radiance(p.map, w);
}

float environment_pdf(PathParams p, vec3 w) {
    return asks(ASKS_MAP) ? map_pdf(p.map, w) : 1.0 / (4.0 * PI);
}

// Is it of this kind? What the scene has not is not compiled; and where all are of one kind, nobody has to look.
bool is_kind(LightRecord light, uint kind) { return asks(1u << kind) && ((ASKED & ASKS_KINDS) == 1u << kind || light.kind == kind); }

// Smooth end of a light's range (KHR_lights_punctual).
float range_window(float distance, float range) {
    float x = distance / range;
    return clamp(1.0 - x * x * x * x, 0.0, 1.0);
}

LightSample sample_point(LightRecord light, vec3 from) {
    vec3 to = light.position - from;
    float d2 = dot(to, to), d = sqrt(d2);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to / d;
    float falloff = range_window(d, light.range);
    if (is_kind(light, LIGHT_SPOT)) {
        // KHR_lights_punctual
        float x = clamp((dot(-wi, light.axis) - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-4), 0.0, 1.0);
        falloff *= x * x;
    }
    return LightSample(wi, d, light.position, light.intensity * (falloff / d2), light.probability, true);
}

// A cone about an axis, even over its solid angle.
vec3 sample_cone(vec3 axis, float one_minus_cos, vec2 u) {
    float z = u.x * one_minus_cos;
    float r = sqrt(z * (2.0 - z));
    return to_world(axis, vec3(r * on_circle(u.y), 1.0 - z));
}

// 1 - cosine of the half angle that a ball fills, seen from a squared distance to its centre; without cancellation.
float ball_cone(float radius, float d2) {
    float sin2 = radius * radius / d2;
    return sin2 < 1e-3 ? sin2 * (0.5 + sin2 * 0.125) : 1.0 - sqrt(max(1.0 - sin2, 0.0));
}

LightSample sample_sphere(LightRecord light, vec3 from, vec2 u) {
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    // from inside it is everywhere, and BSDF samples find it
    if (d2 <= light.radius * light.radius * (1.0 + 1e-5)) return NO_LIGHT_SAMPLE;
    float cone = ball_cone(light.radius, d2);
    vec3 wi = sample_cone(to * inversesqrt(d2), cone, u);
    float b = dot(wi, to);
    vec3 l = to - b * wi;
    float distance = max(b - sqrt(max(light.radius * light.radius - dot(l, l), 0.0)), 0.0);
    // the nearest point of the sphere itself, from its centre: exact where from + distance * wi is not
    vec3 point = light.position + (light.radius + light.lift) * normalize(from + distance * wi - light.position);
    return LightSample(wi, distance, point, light.intensity, light.probability / (2.0 * PI * cone), false);
}

// A triangle as it is seen from a point: directions of its corners, and the solid angle that it fills (Van Oosterom and Strackee 1983).
struct SphericalTriangle {
    vec3 a;
    vec3 b;
    vec3 c;
    float solid_angle;
};

SphericalTriangle spherical_triangle(LightRecord light, vec3 from) {
    vec3 a = light.position - from;
    SphericalTriangle s = SphericalTriangle(normalize(a), normalize(a + light.axis), normalize(a + light.edge), 0.0);
    float volume = abs(dot(s.a, cross(s.b, s.c))), sum = 1.0 + dot(s.a, s.b) + dot(s.b, s.c) + dot(s.c, s.a);
    s.solid_angle = 4.0 * PI * turns_of(volume, sum);
    return s;
}

// Is it sampled by its solid angle? Small ones are by their area: that is the same, and does not cancel (bounds as in pbrt-v4, 6.5).
bool is_wide(SphericalTriangle s) { return s.solid_angle > 3e-4 && s.solid_angle < 6.22; }

// Angle in turns; without cancellation.
float turns_between(vec3 a, vec3 b) { return turns_of(length(cross(a, b)), dot(a, b)); }

// Density of a point of a triangle, per solid angle.
float triangle_pdf(LightRecord light, SphericalTriangle s, float distance, vec3 wi) {
    if (is_wide(s)) return light.probability / s.solid_angle;
    vec3 n = cross(light.axis, light.edge);
    // twice the area times |cos|
    float facing = abs(dot(n, wi));
    return facing > 0.0 ? light.probability * 2.0 * distance * distance / facing : 0.0;
}

// A point of a triangle (barycentrics), even over the solid angle that it fills: Arvo, "Stratified Sampling of Spherical Triangles", 1995.
vec2 sample_spherical_triangle(SphericalTriangle s, LightRecord light, vec3 from, vec2 u) {
    vec3 ab = normalize(cross(s.a, s.b)), bc = normalize(cross(s.b, s.c)), ca = normalize(cross(s.c, s.a));
    // in turns
    float alpha = turns_between(ab, -ca), sum = alpha + turns_between(bc, -ab) + turns_between(ca, -bc);
    vec2 part = on_circle(fract(mix(0.5, sum, u.x))), at = on_circle(alpha);
    vec2 phi = vec2(part.x * at.x + part.y * at.y, part.y * at.x - part.x * at.y);
    float k1 = phi.x + at.x, k2 = phi.y - at.y * dot(s.a, s.b);
    float cos_b = clamp((k2 + (k2 * phi.x - k1 * phi.y) * at.x) / ((k2 * phi.y + k1 * phi.x) * at.y), -1.0, 1.0);
    vec3 c = cos_b * s.a + sqrt(1.0 - cos_b * cos_b) * normalize(s.c - dot(s.c, s.a) * s.a);
    float cos_t = 1.0 - u.y * (1.0 - dot(c, s.b));
    vec3 w = cos_t * s.b + sqrt(max(1.0 - cos_t * cos_t, 0.0)) * normalize(c - dot(c, s.b) * s.b);
    // where that direction meets the triangle
    vec3 p = cross(w, light.edge), t = from - light.position;
    float scale = 1.0 / dot(p, light.axis);
    vec2 b = clamp(vec2(dot(t, p), dot(w, cross(t, light.axis))) * scale, 0.0, 1.0);
    return b.x + b.y > 1.0 ? b / (b.x + b.y) : b;
}

LightSample sample_triangle(LightRecord light, vec3 from, vec2 u) {
    SphericalTriangle s = spherical_triangle(light, from);
    // Heitz, "A Low-Distortion Map Between Triangle and Square", 2019
    vec2 b = u.x < u.y ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
    if (is_wide(s)) b = sample_spherical_triangle(s, light, from, u);
    vec3 point = light.position + (b.x * light.axis + b.y * light.edge);
    vec3 to = point - from;
    float d2 = dot(to, to), d = sqrt(d2);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to / d;
    vec3 n = cross(light.axis, light.edge) * ((light.flags & LIGHT_MIRRORED) != 0u ? -1.0 : 1.0);
    float front = -dot(n, wi);
    if ((light.flags & LIGHT_TWO_SIDED) == 0u && front <= 0.0) return NO_LIGHT_SAMPLE;
    point += normalize(n) * (front > 0.0 ? light.lift : -light.lift);
    vec3 radiance = light.intensity * emission_texture(light.instance, light.primitive, b);
    return LightSample(wi, d, point, radiance, triangle_pdf(light, s, d, wi), false);
}

// By power, from the alias table. What is left of u is as even as it was.
uint choose_light(PathParams p, inout float u) {
    LightRecords lights = LightRecords(p.lights);
    float x = u * float(p.light_count);
    uint bin = min(uint(x), p.light_count - 1u), k = p.light_first + bin;
    float threshold = lights.v[k].threshold;
    u = x - float(bin);
    if (u < threshold) {
        u /= threshold;
        return k;
    }
    u = (u - threshold) / (1.0 - threshold);
    return lights.v[k].alias;
}

// A light for a point that is lit, and a point on it. u: which; v: where.
LightSample sample_light(PathParams p, vec3 from, float u, vec2 v) {
    LightRecords lights = LightRecords(p.lights);
    uint k = asks(ASKS_CHOICE) ? choose_light(p, u) : p.light_first;
    LightRecord light = lights.v[k];
    if (is_kind(light, LIGHT_TREE)) {
        float of_tree = light.probability;
        float of_leaf = draw_leaf(p.light_tree, from, min(u, 0.99999994), k);
        if (!(of_leaf > 0.0)) return NO_LIGHT_SAMPLE;
        light = lights.v[k];
        light.probability = of_tree * of_leaf;
    }
    if (is_kind(light, LIGHT_TRIANGLE)) return sample_triangle(light, from, v);
    if (is_kind(light, LIGHT_SPHERE)) return sample_sphere(light, from, v);
    if (is_kind(light, LIGHT_ENVIRONMENT)) {
        LightSample s = LightSample(uniform_sphere(v), INFINITY, vec3(0.0), p.environment, 1.0 / (4.0 * PI), false);
        if (asks(ASKS_MAP)) {
            MapSample m = sample_map(p.map, v);
            s = LightSample(m.wi, INFINITY, vec3(0.0), p.environment * m.radiance, m.pdf, false);
        }
        s.pdf *= light.probability;
        return s;
    }
    if (is_kind(light, LIGHT_DIRECTIONAL)) {
        // of one radiance over its cone; the intensity is what a surface that faces it gets
        vec3 wi = sample_cone(-light.axis, light.radius, v);
        return LightSample(wi, INFINITY, vec3(0.0), light.intensity / (1.0 - 0.5 * light.radius), light.probability, true);
    }
    if (asks(ASKS_POINTS) || asks(ASKS_SPOTS)) return sample_point(light, from);
    return NO_LIGHT_SAMPLE;
}

// Density with which sample_light draws, from a point, what a ray from there met; 0: it never does.
float light_pdf(PathParams p, Hit hit, vec3 from, vec3 wi) {
    if (!asks(ASKS_TRIANGLES) && !asks(ASKS_SPHERES)) return 0.0;
    uint first = Words(p.light_of).v[hit.instance];
    if (first == INVALID) return 0.0;
    LightRecord light = LightRecords(p.lights).v[first + hit.primitive];
    if (asks(ASKS_LIGHT_TREE)) {
        // the last of all is the tree
        float of_tree = LightRecords(p.lights).v[p.light_first + p.light_count - 1u].probability;
        light.probability = of_tree * leaf_probability(p.light_tree, from, light.alias);
    }
    if (is_kind(light, LIGHT_TRIANGLE)) return triangle_pdf(light, spherical_triangle(light, from), hit.t, wi);
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (d2 <= light.radius * light.radius * (1.0 + 1e-5)) return 0.0;
    return light.probability / (2.0 * PI * ball_cone(light.radius, d2));
}

#endif
