// Unit square to disk, hemisphere and frame: the expressions of src/sampling/warp.rs, which cites the papers. Sine and cosine
// are polynomials, so that a driver's own (Vulkan allows 2^-11 of error) does not matter.
#ifndef COMMON_WARP
#define COMMON_WARP

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

// Duff et al. 2017, branchless
vec3 to_world(vec3 n, vec3 v) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x) * v.x + vec3(b, s + n.y * n.y * a, -n.y) * v.y + n * v.z;
}

#endif
