// Parallel light, and that of distant disks.
#ifndef LIGHTS_DIRECTIONAL
#define LIGHTS_DIRECTIONAL
#include "lights/light.glsl"
#include "lights/cone.glsl"

// Radiance of a directional light with an extent: the same over its disk in the sky. Its intensity is what a surface that faces it gets.
vec3 disk_radiance(LightRecord light) { return light.intensity / (2.0 * PI * light.radius * (1.0 - 0.5 * light.radius)); }

// Density with which its directions are sampled, per solid angle.
float disk_pdf(LightRecord light) { return light.probability / (2.0 * PI * light.radius); }

// Does a ray that leaves the scene this way meet the disk? By the chord between two unit vectors, which does not cancel as their cosine does.
bool meets_disk(LightRecord light, vec3 w) {
    vec3 chord = w + light.axis;
    return dot(chord, chord) < 2.0 * light.radius;
}

LightSample directional_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    if (light.radius == 0.0) return LightSample(-light.axis, INFINITY, vec3(0.0), light.intensity, light.probability, true);
    vec3 wi = sample_cone(-light.axis, light.radius, u);
    return LightSample(wi, INFINITY, vec3(0.0), disk_radiance(light), disk_pdf(light), false);
}

// No surface: path/path.glsl weighs the disks that a ray meets that leaves the scene.
float directional_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
