// Rectangles that emit: sampled by their solid angle, small ones by their area.
#ifndef LIGHTS_RECTANGLE
#define LIGHTS_RECTANGLE
#include "lights/flat.glsl"

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
float rectangle_density(LightRecord light, SphericalRectangle s, float distance, vec3 wi) {
    if (is_wide(s)) return 1.0 / s.solid_angle;
    float facing = abs(dot(cross(light.axis, light.edge), wi));
    return facing > 0.0 ? distance * distance / facing : 0.0;
}

LightSample rectangle_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    SphericalRectangle s = spherical_rectangle(light, from);
    if (is_wide(s)) u = sample_spherical_rectangle(s, u);
    LightSample l;
    if (flat_light_point(light, from, u, l)) l.pdf = rectangle_density(light, s, l.distance, l.wi);
    return l;
}

float rectangle_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return rectangle_density(light, spherical_rectangle(light, from), distance, wi); }

#endif
