// Triangles that emit: sampled by their solid angle, small ones by their area.
#ifndef LIGHTS_TRIANGLE
#define LIGHTS_TRIANGLE
#include "lights/flat.glsl"

// A triangle as it is seen from a point: directions of its corners, and the solid angle that it fills.
struct SphericalTriangle {
    vec3 a;
    vec3 b;
    vec3 c;
    float solid_angle;
};

SphericalTriangle spherical_triangle(LightRecord light, vec3 from) {
    vec3 a = light.position - from, b = a + light.axis, c = a + light.edge;
    vec3 lengths = vec3(length(a), length(b), length(c));
    float volume = abs(dot(a, cross(light.axis, light.edge)));
    return SphericalTriangle(a / lengths.x, b / lengths.y, c / lengths.z, triangle_solid_angle(volume, a, b, c, lengths));
}

// Is it sampled by its solid angle? Small ones are by their area: that is the same, and does not cancel (bounds as in pbrt-v4, 6.5).
bool is_wide(SphericalTriangle s) { return s.solid_angle > 3e-4 && s.solid_angle < 6.22; }

// Angle in turns; without cancellation.
float turns_between(vec3 a, vec3 b) { return turns_of(length(cross(a, b)), dot(a, b)); }

// Density of a point of a triangle, per solid angle.
float triangle_density(LightRecord light, SphericalTriangle s, float distance, vec3 wi) {
    if (is_wide(s)) return 1.0 / s.solid_angle;
    vec3 n = cross(light.axis, light.edge);
    // twice the area times |cos|
    float facing = abs(dot(n, wi));
    return facing > 0.0 ? 2.0 * distance * distance / facing : 0.0;
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

uint five_bits(uint flags, uint at) { return flags >> at & LIGHT_FIVE_BITS; }

// Barycentrics in its triangle of a point of a part of it (src/integrators/path/lights/pictures.rs).
vec2 in_whole(LightRecord light, vec2 b) {
    uint side = five_bits(light.flags, LIGHT_SIDE_AT);
    if (!has_use(USE_EMISSION) || side == 0u) return b;
    vec2 cell = vec2(five_bits(light.flags, LIGHT_ROW_AT), five_bits(light.flags, LIGHT_COLUMN_AT));
    return ((light.flags & LIGHT_TURNED) != 0u ? cell + 1.0 - b : cell + b) / float(side);
}

// Number of the part that has a point of a triangle. light: the first part, or the triangle.
uint part_at(LightRecord light, vec2 b) {
    uint side = five_bits(light.flags, LIGHT_SIDE_AT);
    if (!has_use(USE_EMISSION) || side == 0u) return 0u;
    vec2 s = b * float(side);
    uint row = min(uint(s.x), side - 1u);
    uint column = min(uint(s.y), side - 1u - row);
    bool turned = s.x - float(row) + (s.y - float(column)) > 1.0 && row + column + 1u < side;
    return side * side - (side - row) * (side - row) + 2u * column + (turned ? 1u : 0u);
}

LightSample triangle_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    SphericalTriangle s = spherical_triangle(light, from);
    // Heitz, "A Low-Distortion Map Between Triangle and Square", 2019
    vec2 b = u.x < u.y ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
    if (is_wide(s)) b = sample_spherical_triangle(s, light, from, u);
    LightSample l;
    if (!flat_light_point(light, from, b, l)) return l;
    vec2 at = in_whole(light, b);
    l.radiance *= emission_texture(light.instance, light.primitive, at);
    if (HAS_ALPHA && (light.flags & LIGHT_ALPHA) != 0u) l.radiance *= emitter_alpha(light.instance, light.primitive, at);
    l.pdf = triangle_density(light, s, l.distance, l.wi);
    return l;
}

float triangle_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return triangle_density(light, spherical_triangle(light, from), distance, wi); }

#endif
