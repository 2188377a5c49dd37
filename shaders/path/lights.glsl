// Lights: what emits, how one is chosen (by power, or from a tree), how a point on it is sampled and with which density.
//
// One two-dimensional sample does it all: its first number chooses the light, and what is left of it places the point. Every light then gets points
// that are as evenly distributed as the samples are, where a choice by a number of its own would give each light a random subset of them.
#ifndef PATH_LIGHTS
#define PATH_LIGHTS
#include "common/warp.glsl"
#include "interface/light_kind.glsl"
#include "path/map.glsl"
#include "path/light_tree.glsl"
#include "path/shading.glsl"


struct LightSample {
    vec3 wi;          // unit, towards the light
    float distance;   // to it, infinite for the environment
    vec3 to;          // a point on the light, for finite distances
    vec3 radiance;    // of a light without extent: times its solid angle
    float pdf;        // per solid angle, of point and choice; 0: nothing was drawn
    bool delta;       // no BSDF sample could find it
};

const LightSample NO_LIGHT_SAMPLE = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), vec3(0.0), 0.0, false);

// Radiance of the environment from direction w.
vec3 environment_radiance(PathParams p, vec3 w) {
    if (!WITH_ENVIRONMENT_MAP) return p.environment;
    return p.environment * map_radiance(p.map, w);
}

// Can light from behind the surface be scattered to the viewer?
bool transmits_light(Shading m) { return (has_transmission() || HAS_DIELECTRIC) && m.bsdf.transmitted != vec3(0.0); }

// A constant environment is sampled by the cosine to the shading normal, as a diffuse surface scatters it, on each side that light may come from. Per solid
// angle.
float constant_environment_pdf(Shading m, vec3 w) {
    float c = dot(m.frame.n, w) / PI;
    return transmits_light(m) ? 0.5 * abs(c) : max(c, 0.0);
}

// Direction (world), and its pdf.
vec4 sample_constant_environment(Shading m, vec2 u) {
    bool behind = transmits_light(m) && u.x >= 0.5;
    if (transmits_light(m)) u.x = behind ? 2.0 * u.x - 1.0 : 2.0 * u.x;
    vec3 w = cosine_hemisphere(u);
    w = from_frame(m.frame, behind ? vec3(w.xy, -w.z) : w);
    return vec4(w, constant_environment_pdf(m, w));
}

// Is it of this kind? What the scene has not is not compiled; and where all are of one kind, nobody has to look.
bool is_kind(LightRecord light, uint kind) {
    // kinds are the first features
    uint kinds = PATH_FEATURES_0 & (1u << LIGHT_KIND_COUNT) - 1u;
    return (kinds >> kind & 1u) != 0u && (kinds == 1u << kind || light.kind == kind);
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

// Solid angle of a triangle with corners a, b, c as seen from the origin (Van Oosterom and Strackee 1983). lengths: those of a, b, c. volume: |a . (b x c)|,
// computed from the triangle's edges, because that of unit vectors cancels.
float triangle_solid_angle(float volume, vec3 a, vec3 b, vec3 c, vec3 lengths) {
    float below = lengths.x * lengths.y * lengths.z + dot(a, b) * lengths.z + dot(b, c) * lengths.x + dot(c, a) * lengths.y;
    return 4.0 * PI * turns_of(volume, below);
}

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

// A rectangle as it is seen from a point (Urena, Fajardo, King, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013): its corners
// along its edges, from the foot of the perpendicular, and the distance of its plane.
struct SphericalRectangle {
    float x0;
    float x1;
    float y0;
    float y1;
    float z;
    float solid_angle;
};

SphericalRectangle spherical_rectangle(LightRecord light, vec3 from) {
    vec3 a = light.position - from, b = a + light.axis, c = a + light.edge, d = b + light.edge;
    float width = length(light.axis), height = length(light.edge);
    vec3 x = light.axis / width, y = light.edge / height, n = cross(light.axis, light.edge);
    float volume = abs(dot(a, n)), x0 = dot(a, x), y0 = dot(a, y);
    vec4 lengths = vec4(length(a), length(b), length(c), length(d));
    float solid = triangle_solid_angle(volume, a, b, c, lengths.xyz) + triangle_solid_angle(volume, d, b, c, lengths.wyz);
    return SphericalRectangle(x0, x0 + width, y0, y0 + height, volume / (width * height), solid);
}

// Is it sampled by its solid angle? The angles whose differences say where a point of a small one is are not known well enough.
bool is_wide(SphericalRectangle s) { return s.solid_angle > 2e-3 && s.solid_angle < 6.22; }

// acos in turns.
float turns_of_cosine(float c) { return turns_of(sqrt(max((1.0 - c) * (1.0 + c), 0.0)), c); }

// A point of a rectangle in shares of its edges, uniformly distributed over the solid angle that it fills. Names are the paper's.
vec2 sample_spherical_rectangle(SphericalRectangle s, vec2 u) {
    float z2 = s.z * s.z;
    float n0 = -s.y0 * inversesqrt(z2 + s.y0 * s.y0), n1 = s.x1 * inversesqrt(z2 + s.x1 * s.x1);
    float n2 = s.y1 * inversesqrt(z2 + s.y1 * s.y1), n3 = -s.x0 * inversesqrt(z2 + s.x0 * s.x0);
    float g2 = turns_of_cosine(-n2 * n3), g3 = turns_of_cosine(-n3 * n0);
    float all_ = turns_of_cosine(-n0 * n1) + turns_of_cosine(-n1 * n2) + g2 + g3 - 1.0;
    vec2 au = on_circle(fract(u.x * all_ + 1.0 - g2 - g3));
    float fu = (au.x * n0 - n2) / au.y;
    float cu = clamp(inversesqrt(fu * fu + n0 * n0) * (fu > 0.0 ? 1.0 : -1.0), -0.99999994, 0.99999994);
    float xu = clamp(cu * s.z * inversesqrt((1.0 - cu) * (1.0 + cu)), s.x0, s.x1);
    float d2 = xu * xu + z2;
    float h0 = s.y0 * inversesqrt(d2 + s.y0 * s.y0), h1 = s.y1 * inversesqrt(d2 + s.y1 * s.y1);
    float hv = mix(h0, h1, u.y), rest = (1.0 - hv) * (1.0 + hv);
    float yv = rest > 1e-6 ? clamp(hv * sqrt(d2 / rest), s.y0, s.y1) : hv > 0.0 ? s.y1 : s.y0;
    return vec2((xu - s.x0) / (s.x1 - s.x0), (yv - s.y0) / (s.y1 - s.y0));
}

// Density of a point of a rectangle, per solid angle.
float rectangle_pdf(LightRecord light, SphericalRectangle s, float distance, vec3 wi) {
    if (is_wide(s)) return light.probability / s.solid_angle;
    float facing = abs(dot(cross(light.axis, light.edge), wi));
    return facing > 0.0 ? light.probability * distance * distance / facing : 0.0;
}

// A light sample at a point of a triangle or rectangle, without the density and what textures say. False where the light emits nothing that way.
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

LightSample sample_rectangle(LightRecord light, vec3 from, vec2 u) {
    SphericalRectangle s = spherical_rectangle(light, from);
    if (is_wide(s)) u = sample_spherical_rectangle(s, u);
    LightSample l;
    if (flat_light_point(light, from, u, l)) l.pdf = rectangle_pdf(light, s, l.distance, l.wi);
    return l;
}

LightSample sample_triangle(LightRecord light, vec3 from, vec2 u) {
    SphericalTriangle s = spherical_triangle(light, from);
    // Heitz, "A Low-Distortion Map Between Triangle and Square", 2019
    vec2 b = u.x < u.y ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
    if (is_wide(s)) b = sample_spherical_triangle(s, light, from, u);
    LightSample l;
    if (!flat_light_point(light, from, b, l)) return l;
    l.radiance *= emission_texture(light.instance, light.primitive, b);
    if (HAS_ALPHA && (light.flags & LIGHT_ALPHA) != 0u) l.radiance *= emitter_alpha(light.instance, light.primitive, b);
    l.pdf = triangle_pdf(light, s, l.distance, l.wi);
    return l;
}

// Chooses a light by its power. bits: uniformly distributed; u: what is left of them, in [0, 1).
uint choose_light(PathParams p, uint bits, out float u) {
    Words starts = Words(p.light_starts);
    uint low = 0u, count = p.light_count;
    while (count > 1u) {
        uint half_ = count >> 1;
        if (starts.v[low + half_] <= bits) low += half_;
        count -= half_;
    }
    uint start = starts.v[low];
    // the last ends at 2^32, which is 0
    u = min(float(bits - start) / float(starts.v[low + 1u] - start), 0.99999994);
    return p.light_first + low;
}

// Radiance of a directional light with an extent: the same over its disk in the sky. Its intensity is what a surface that faces it gets.
vec3 disk_radiance(LightRecord light) { return light.intensity / (2.0 * PI * light.radius * (1.0 - 0.5 * light.radius)); }

// Density with which its directions are sampled, per solid angle.
float disk_pdf(LightRecord light) { return light.probability / (2.0 * PI * light.radius); }

// Does a ray that leaves the scene this way meet the disk? By the chord between two unit vectors, which does not cancel as their cosine does.
bool meets_disk(LightRecord light, vec3 w) {
    vec3 chord = w + light.axis;
    return dot(chord, chord) < 2.0 * light.radius;
}

// A light for a point that is lit, and a point on it. bits: a point of a two-dimensional sequence.
LightSample sample_light(PathParams p, vec3 from, Shading m, uvec2 bits) {
    LightRecords lights = LightRecords(p.lights);
    vec2 v = vec2(bits >> 8) * (1.0 / 16777216.0);
    uint k = WITH_LIGHT_CHOICE ? choose_light(p, bits.x, v.x) : p.light_first;
    LightRecord light = lights.v[k];
    if (is_kind(light, LIGHT_TREE)) {
        float of_tree = light.probability;
        float of_leaf = sample_leaf(p.light_tree, from, v.x, k);
        if (!(of_leaf > 0.0)) return NO_LIGHT_SAMPLE;
        light = lights.v[k];
        light.probability = of_tree * of_leaf;
    }
    if (is_kind(light, LIGHT_RECTANGLE)) return sample_rectangle(light, from, v);
    if (is_kind(light, LIGHT_TRIANGLE)) return sample_triangle(light, from, v);
    if (is_kind(light, LIGHT_SPHERE)) return sample_sphere(light, from, v);
    if (is_kind(light, LIGHT_ENVIRONMENT)) {
        if (WITH_ENVIRONMENT_MAP) {
            MapSample s = sample_map(p.map, v);
            return LightSample(s.wi, INFINITY, vec3(0.0), p.environment * s.radiance, light.probability * s.pdf, false);
        }
        vec4 s = sample_constant_environment(m, v);
        return LightSample(s.xyz, INFINITY, vec3(0.0), p.environment, light.probability * s.w, false);
    }
    if (is_kind(light, LIGHT_DIRECTIONAL)) {
        if (light.radius == 0.0) return LightSample(-light.axis, INFINITY, vec3(0.0), light.intensity, light.probability, true);
        vec3 wi = sample_cone(-light.axis, light.radius, v);
        return LightSample(wi, INFINITY, vec3(0.0), disk_radiance(light), disk_pdf(light), false);
    }
    if (WITH_POINT_LIGHTS || WITH_SPOT_LIGHTS) return sample_point(light, from);
    return NO_LIGHT_SAMPLE;
}

// Density with which sample_light draws, from a point, what a ray from there met; 0: it never does.
float light_pdf(PathParams p, Hit hit, vec3 from, vec3 wi) {
    if (!WITH_TRIANGLE_LIGHTS && !WITH_RECTANGLE_LIGHTS && !WITH_SPHERE_LIGHTS) return 0.0;
    uint first = Words(p.light_of).v[hit.instance];
    if (first == INVALID) return 0.0;
    uint k = Words(p.light_of).v[first + hit.primitive];
    if (k == INVALID) return 0.0;
    LightRecord light = LightRecords(p.lights).v[k];
    if (WITH_LIGHT_TREE) {
        // the last of all is the tree
        float of_tree = LightRecords(p.lights).v[p.light_first + p.light_count - 1u].probability;
        light.probability = of_tree * leaf_probability(p.light_tree, from, light.trail);
    }
    if (is_kind(light, LIGHT_RECTANGLE)) return rectangle_pdf(light, spherical_rectangle(light, from), hit.t, wi);
    if (is_kind(light, LIGHT_TRIANGLE)) return triangle_pdf(light, spherical_triangle(light, from), hit.t, wi);
    vec3 to = light.position - from;
    float d2 = dot(to, to);
    if (d2 <= light.radius * light.radius * (1.0 + 1e-5)) return 0.0;
    return light.probability / (2.0 * PI * ball_cone(light.radius, d2));
}

#endif
