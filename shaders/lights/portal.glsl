// Portals: openings of a room, a window or a door, through which the environment is sampled. They emit nothing and hide nothing: a direction from the
// environment's own samples and from each portal's counts with the sum of their densities (the balance heuristic, Veach and Guibas 1995), so the image is the
// same wherever they are, and only its noise is less.
#ifndef LIGHTS_PORTAL
#define LIGHTS_PORTAL
#include "lights/light.glsl"
#include "lights/rectangle.glsl"

// By how much a sampled point may seem outside its portal, in shares of an edge: rounding.
const float PORTAL_MARGIN = 1e-5;

vec3 environment_radiance(PathParams p, vec3 w);

// Density with which a portal proposes a direction.
float portal_density(LightRecord light, vec3 from, vec3 wi) {
    vec3 n = cross(light.axis, light.edge), to = light.position - from;
    float distance = dot(n, to) / dot(n, wi);
    if (!(distance > 0.0) || isinf(distance)) return 0.0;
    vec3 d = distance * wi - to;
    vec2 at = vec2(dot(d, light.axis) / dot(light.axis, light.axis), dot(d, light.edge) / dot(light.edge, light.edge));
    if (any(greaterThan(abs(at - 0.5), vec2(0.5 + PORTAL_MARGIN)))) return 0.0;
    return light.probability * rectangle_density(light, spherical_rectangle(light, from), distance, wi);
}

// Of all portals: they follow the environment, which knows how many there are.
float portals_pdf(PathParams p, vec3 from, vec3 wi) {
    uint count = LightRecords(p.lights).v[p.environment_light].primitive;
    float all_ = 0.0;
    for (uint k = 1u; k <= count; k++) all_ += portal_density(LightRecords(p.lights).v[p.environment_light + k], from, wi);
    return all_;
}

LightSample portal_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    SphericalRectangle s = spherical_rectangle(light, from);
    if (is_wide(s)) u = sample_spherical_rectangle(s, u);
    vec3 to = light.position + (u.x * light.axis + u.y * light.edge) - from;
    float d2 = dot(to, to);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to * inversesqrt(d2);
    return LightSample(wi, INFINITY, vec3(0.0), environment_radiance(p, wi), sky_pdf(p, m, from, wi), false);
}

// No surface: it is part of sky_pdf.
float portal_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
