// Warps from the unit square to disk and hemisphere, and orthonormal frames: the expressions of src/sampling/warp.rs, which cites the papers. Sine and cosine
// are polynomials, so that a driver's precision (Vulkan allows errors of 2^-11) does not matter.
#ifndef COMMON_WARP
#define COMMON_WARP
#include "common/integers.glsl"

const float PI = 3.14159265358979;

// on [-pi/4, pi/4]
float sin_quarter(float x) {
    float z = x * x;
    return ((-1.9515296e-4 * z + 8.332161e-3) * z - 1.6666655e-1) * z * x + x;
}

float cos_quarter(float x) {
    float z = x * x;
    return ((2.4433157e-5 * z - 1.3887316e-3) * z + 4.1666646e-2) * z * z - 0.5 * z + 1.0;
}

// x, y and the signed radius
vec3 concentric_disk(vec2 u) {
    const float PI_4 = 0.78539816339;
    vec2 p = 2.0 * u - 1.0;
    bool wide = abs(p.x) > abs(p.y);
    float r = wide ? p.x : p.y;
    if (r == 0.0) return vec3(0.0);
    float phi = PI_4 * ((wide ? p.y : p.x) / r);
    float c = cos_quarter(phi), s = sin_quarter(phi);
    return vec3(r * (wide ? vec2(c, s) : vec2(s, c)), r);
}

// z is the normal; density cos / pi
vec3 cosine_hemisphere(vec2 u) {
    vec3 d = concentric_disk(u);
    return vec3(d.xy, sqrt((1.0 - d.z) * (1.0 + d.z)));
}

// Cosine and sine of turns in [0, 1].
vec2 on_circle(float turns) {
    // eighths of a turn, nearest quarter first: exact
    float quarter = floor(4.0 * turns + 0.5);
    float x = (4.0 * turns - quarter) * 1.57079632679;
    float c = cos_quarter(x), s = sin_quarter(x);
    uint q = uint(to_int(quarter)) & 3u;
    vec2 v = (q & 1u) == 0u ? vec2(c, s) : vec2(-s, c);
    return q < 2u ? v : -v;
}

// Angle of (x, y) in turns, -1/2 to 1/2: Cephes' atanf, a few 1e-8 of a turn off. Vulkan lets a driver's own be off by 4096 ulp.
float turns_of(float y, float x) {
    float ax = abs(x), ay = abs(y);
    float greater = max(ax, ay);
    if (greater == 0.0) return 0.0;
    float t = min(ax, ay) / greater;
    // from [0, 1] to [-tan(pi/8), tan(pi/8)]
    bool upper = t > 0.4142135624;
    float z = upper ? (t - 1.0) / (t + 1.0) : t;
    float zz = z * z;
    float a = (((8.05374449538e-2 * zz - 1.38776856032e-1) * zz + 1.99777106478e-1) * zz - 3.33329491539e-1) * zz * z + z;
    float turns = a * 0.159154943092 + (upper ? 0.125 : 0.0);
    turns = ay > ax ? 0.25 - turns : turns;
    turns = x < 0.0 ? 0.5 - turns : turns;
    return y < 0.0 ? -turns : turns;
}

// Uniform over the hemisphere about z.
vec3 uniform_hemisphere(vec2 u) {
    return vec3(sqrt(max(1.0 - u.x * u.x, 0.0)) * on_circle(u.y), u.x);
}

// Duff et al. 2017, branchless. Their sign changes at z = 0, where walls have their normals: below it, rounding, which differs from device to device, decides about no axis.
vec3 to_world(vec3 n, vec3 v) {
    float s = n.z >= -1e-4 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x) * v.x + vec3(b, s + n.y * n.y * a, -n.y) * v.y + n * v.z;
}

// Orthonormal axes; n is the third.
struct Frame {
    vec3 s;
    vec3 t;
    vec3 n;
};

Frame frame_about(vec3 n) {
    return Frame(to_world(n, vec3(1.0, 0.0, 0.0)), to_world(n, vec3(0.0, 1.0, 0.0)), n);
}

// The frame whose first axis is as near to `along` as possible.
Frame frame_along(vec3 n, vec3 along) {
    vec3 s = along - n * dot(n, along);
    float s2 = dot(s, s);
    if (!(s2 > 1e-12)) return frame_about(n);
    s *= inversesqrt(s2);
    return Frame(s, cross(n, s), n);
}

vec3 to_frame(Frame f, vec3 w) { return vec3(dot(f.s, w), dot(f.t, w), dot(f.n, w)); }
vec3 from_frame(Frame f, vec3 w) { return f.s * w.x + f.t * w.y + f.n * w.z; }

#endif
