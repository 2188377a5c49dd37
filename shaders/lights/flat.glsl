// What triangles and rectangles that emit share.
#ifndef LIGHTS_FLAT
#define LIGHTS_FLAT
#include "lights/light.glsl"

// Solid angle of a triangle with corners a, b, c as seen from the origin (Van Oosterom and Strackee 1983). lengths: those of a, b, c. volume: |a . (b x c)|,
// computed from the triangle's edges, because that of unit vectors cancels.
float triangle_solid_angle(float volume, vec3 a, vec3 b, vec3 c, vec3 lengths) {
    float below = lengths.x * lengths.y * lengths.z + dot(a, b) * lengths.z + dot(b, c) * lengths.x + dot(c, a) * lengths.y;
    return 4.0 * PI * turns_of(volume, below);
}

// A light sample at a point of a triangle or rectangle, without the density and what textures say. False where the light emits nothing in that direction.
bool flat_light_point(LightRecord light, vec3 from, vec2 b, out LightSample l) {
    l = NO_LIGHT_SAMPLE;
    vec3 point = light.position + (b.x * light.axis + b.y * light.edge);
    vec3 to = point - from;
    float d2 = dot(to, to);
    if (!(d2 > 0.0)) return false;
    l.distance = sqrt(d2);
    l.wi = to / l.distance;
    vec3 n = cross(light.axis, light.edge) * ((light.flags & LIGHT_MIRRORED) != 0u ? -1.0 : 1.0);
    float front = -dot(n, l.wi);
    if ((light.flags & LIGHT_TWO_SIDED) == 0u && front <= 0.0) return false;
    l.to = point + normalize(n) * (front > 0.0 ? light.lift : -light.lift);
    l.radiance = light.intensity;
    return true;
}

#endif
