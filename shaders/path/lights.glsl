// Lights: what emits, how it is chosen (by power, from an alias table), how a point on it is drawn and with which density. Mirrors
// src/render/path/lights.rs.
#ifndef PATH_LIGHTS
#define PATH_LIGHTS
#include "common/warp.glsl"
#include "path/map.glsl"
#include "path/shading.glsl"

const uint LIGHT_POINT = 0u;
const uint LIGHT_SPOT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;
const uint LIGHT_TRIANGLE = 3u;
const uint LIGHT_SPHERE = 4u;
const uint LIGHT_ENVIRONMENT = 5u;

struct LightRecord {
    vec3 position;      // point, spot: where; triangle: first corner; sphere: centre
    float radius;       // sphere
    vec3 axis;          // spot, directional: where it shines; triangle: first edge
    float cos_inner;    // spot
    vec3 edge;          // triangle: second edge
    float cos_outer;    // spot; directional: of half its angle; triangle: -1 where a mirroring transform has turned its winding, else 1
    vec3 intensity;     // point, spot: per solid angle; directional: irradiance; else: radiance, before any texture
    float range;        // point, spot: without effect beyond
    float probability;  // of being chosen
    float threshold;    // alias table: this one is chosen below it, `alias` above
    uint alias;
    uint kind;
    uint instance;      // triangle, sphere: what is seen of it
    uint primitive;
    uint two_sided;     // triangle: it emits from its back, too
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
    if (is_null(p.map.texels)) return p.environment;
    return p.environment * map_radiance(p.map, w);
}

float environment_pdf(PathParams p, vec3 w) {
    return is_null(p.map.texels) ? 1.0 / (4.0 * PI) : map_pdf(p.map, w);
}

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
    if (light.kind == LIGHT_SPOT) {
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

// Density of a point of a triangle by area, per solid angle.
float triangle_pdf(LightRecord light, float distance, vec3 wi) {
    vec3 n = cross(light.axis, light.edge);
    // twice the area times |cos|
    float facing = abs(dot(n, wi));
    return facing > 0.0 ? light.probability * 2.0 * distance * distance / facing : 0.0;
}

LightSample sample_triangle(LightRecord light, vec3 from, vec2 u) {
    // Heitz, "A Low-Distortion Map Between Triangle and Square", 2019
    vec2 b = u.x < u.y ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
    vec3 point = light.position + (b.x * light.axis + b.y * light.edge);
    vec3 to = point - from;
    float d2 = dot(to, to), d = sqrt(d2);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to / d;
    vec3 n = cross(light.axis, light.edge) * light.cos_outer;
    float front = -dot(n, wi);
    if (light.two_sided == 0u && front <= 0.0) return NO_LIGHT_SAMPLE;
    point += normalize(n) * (front > 0.0 ? light.lift : -light.lift);
    vec3 radiance = light.intensity * emission_texture(light.instance, light.primitive, b);
    return LightSample(wi, d, point, radiance, triangle_pdf(light, d, wi), false);
}

// A light for a point that is lit, and a point on it. u: which; v: where.
LightSample sample_light(PathParams p, vec3 from, float u, vec2 v) {
    if (p.light_count == 0u) return NO_LIGHT_SAMPLE;
    LightRecords lights = LightRecords(p.lights);
    float x = u * float(p.light_count);
    uint k = min(uint(x), p.light_count - 1u);
    if (x - float(k) >= lights.v[k].threshold) k = lights.v[k].alias;
    LightRecord light = lights.v[k];
    if (light.kind == LIGHT_TRIANGLE) return sample_triangle(light, from, v);
    if (light.kind == LIGHT_SPHERE) return sample_sphere(light, from, v);
    if (light.kind == LIGHT_ENVIRONMENT) {
        LightSample s = LightSample(uniform_sphere(v), INFINITY, vec3(0.0), p.environment, 1.0 / (4.0 * PI), false);
        if (!is_null(p.map.texels)) {
            MapSample m = sample_map(p.map, v);
            s = LightSample(m.wi, INFINITY, vec3(0.0), p.environment * m.radiance, m.pdf, false);
        }
        s.pdf *= light.probability;
        return s;
    }
    if (light.kind == LIGHT_DIRECTIONAL) {
        float cone = 1.0 - light.cos_outer;
        vec3 wi = sample_cone(-light.axis, cone, v);
        return LightSample(wi, INFINITY, vec3(0.0), light.intensity, light.probability, true);
    }
    return sample_point(light, from);
}

// Density with which sample_light draws, from a point, what a ray from there met; 0: it never does.
float light_pdf(PathParams p, Hit hit, vec3 from, vec3 wi) {
    if (is_null(p.light_of)) return 0.0;
    uint first = Words(p.light_of).v[hit.instance];
    if (first == INVALID) return 0.0;
    LightRecord light = LightRecords(p.lights).v[first + hit.primitive];
    if (light.kind == LIGHT_TRIANGLE) return triangle_pdf(light, hit.t, wi);
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (d2 <= light.radius * light.radius * (1.0 + 1e-5)) return 0.0;
    return light.probability / (2.0 * PI * ball_cone(light.radius, d2));
}

#endif
