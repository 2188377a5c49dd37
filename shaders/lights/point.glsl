// Lights at a position, with the same intensity in all directions (KHR_lights_punctual).
#ifndef LIGHTS_POINT
#define LIGHTS_POINT
#include "lights/light.glsl"

// Smooth end of a light's range (KHR_lights_punctual).
float range_window(float distance, float range) {
    float x = distance / range;
    return clamp(1.0 - x * x * x * x, 0.0, 1.0);
}

// A light at a position. falloff: share of its intensity in this direction; d2: squared distance.
LightSample position_sample(LightRecord light, vec3 wi, float d2, float falloff) {
    float d = sqrt(d2);
    falloff = range_window(d, light.range) * falloff;
    return LightSample(wi, d, light.position, light.intensity * (falloff / d2), 1.0, true);
}

LightSample point_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    return position_sample(light, to / sqrt(d2), d2, 1.0);
}

// No ray meets it.
float point_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
