// Lights at a position, in a cone (KHR_lights_punctual).
#ifndef LIGHTS_SPOT
#define LIGHTS_SPOT
#include "lights/light.glsl"
#include "lights/point.glsl"

LightSample spot_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to / sqrt(d2);
    float x = clamp((dot(-wi, light.axis) - light.parameter_1) / max(light.parameter_0 - light.parameter_1, 1e-4), 0.0, 1.0);
    return position_sample(light, wi, d2, x * x);
}

// No ray meets it.
float spot_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
