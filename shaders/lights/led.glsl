// Lights at a position whose intensity is a power of the cosine of the angle from an axis.
#ifndef LIGHTS_LED
#define LIGHTS_LED
#include "lights/light.glsl"
#include "lights/point.glsl"

LightSample led_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (!(d2 > 0.0)) return NO_LIGHT_SAMPLE;
    vec3 wi = to / sqrt(d2);
    float c = dot(-wi, light.axis);
    return position_sample(light, wi, d2, c > 0.0 ? pow(min(c, 1.0), light.parameter_0) : 0.0);
}

// No ray meets it.
float led_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
