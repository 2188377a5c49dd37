// Spheres that emit: sampled by the cone that they fill.
#ifndef LIGHTS_SPHERE
#define LIGHTS_SPHERE
#include "lights/light.glsl"
#include "lights/cone.glsl"

// 1 - cosine of the half angle that a ball fills, seen from a squared distance to its centre; without cancellation.
float ball_cone(float radius, float d2) {
    float sin2 = radius * radius / d2;
    return sin2 < 1e-3 ? sin2 * (0.5 + sin2 * 0.125) : 1.0 - sqrt(max(1.0 - sin2, 0.0));
}

LightSample sphere_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
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
    vec3 normal = normalize(from + distance * wi - light.position);
    vec3 point = light.position + (light.radius + light.lift) * normal;
    return LightSample(wi, distance, point, light.intensity * sphere_emission_texture(light.instance, normal), 1.0 / (2.0 * PI * cone), false);
}

float sphere_pdf(LightRecord light, vec3 from, vec3 wi, float distance) {
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (d2 <= light.radius * light.radius * (1.0 + 1e-5)) return 0.0;
    return 1.0 / (2.0 * PI * ball_cone(light.radius, d2));
}

#endif
