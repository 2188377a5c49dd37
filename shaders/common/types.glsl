// Rays, hits and raw memory access, for all streams and tracers.
#ifndef COMMON_TYPES
#define COMMON_TYPES
#include "interface/constants.glsl"
#include "interface/ray.glsl"

const float INFINITY = 1.0 / 0.0;

Ray no_ray() { return Ray(vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), -1.0); }
bool is_ray(Ray ray) { return ray.tmax > ray.tmin; }
// Vulkan leaves undefined what hardware does with other rays: some call neither a hit shader nor the miss shader.
bool is_finite(Ray ray) { return all(lessThan(abs(ray.origin), vec3(INFINITY))) && all(lessThan(abs(ray.direction), vec3(INFINITY))); }
Hit miss() { return Hit(INFINITY, INVALID, INVALID, 0.0, 0.0); }
bool is_hit(Hit hit) { return hit.t < INFINITY; }

// Memory by device address. The address is a uvec2 so that no 64-bit integer is needed in shaders.
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Words { uint v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Floats { float v[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Pairs { uvec2 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Quads { uvec4 v[]; };

// On a CPU driver a divergent load is one gather, of 32 or of 64 bits alike: load pairs where 64-bit integers exist.
#ifdef LOAD64
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Words64 { uint64_t v[]; };
#define LOAD_PAIR(base, i) unpackUint2x32(Words64(base).v[i])
#else
#define LOAD_PAIR(base, i) Pairs(base).v[i]
#endif

// Four words at once.
#ifdef LOAD64
#define LOAD_QUAD(base, i) uvec4(LOAD_PAIR(base, 2u * (i)), LOAD_PAIR(base, 2u * (i) + 1u))
#else
#define LOAD_QUAD(base, i) Quads(base).v[i]
#endif

bool is_null(uvec2 address) { return (address.x | address.y) == 0u; }

// Three words of an array of such, which begins and ends at multiples of 8 bytes, as all buffers do. As two pairs they are one gather less than word by word.
uvec3 load_triple(uvec2 base, uint index) {
#ifdef LOAD64
    uint word = 3u * index;
    uvec2 a = LOAD_PAIR(base, word >> 1), b = LOAD_PAIR(base, (word >> 1) + 1u);
    return (word & 1u) == 0u ? uvec3(a, b.x) : uvec3(a.y, b);
#else
    Words w = Words(base);
    return uvec3(w.v[3u * index], w.v[3u * index + 1u], w.v[3u * index + 2u]);
#endif
}

vec3 load_vec3(uvec2 base, uint index) { return uintBitsToFloat(load_triple(base, index)); }

vec2 load_vec2(uvec2 base, uint index) { return uintBitsToFloat(LOAD_PAIR(base, index)); }

// Two words at once: one access where 64-bit integers exist. A CPU driver stores lane by lane and word by word.
#ifdef LOAD64
layout(buffer_reference, std430, buffer_reference_align = 8) writeonly buffer StoredPairs { uint64_t v[]; };
#define STORE_PAIR(base, i, pair) StoredPairs(base).v[i] = packUint2x32(pair)
#else
layout(buffer_reference, std430, buffer_reference_align = 8) writeonly buffer StoredPairs { uvec2 v[]; };
#define STORE_PAIR(base, i, pair) StoredPairs(base).v[i] = (pair)
#endif

void store_quad(uvec2 base, uint k, vec4 q) {
    STORE_PAIR(base, 2u * k, floatBitsToUint(q.xy));
    STORE_PAIR(base, 2u * k + 1u, floatBitsToUint(q.zw));
}

vec4 load_quad(uvec2 base, uint k) { return uintBitsToFloat(LOAD_QUAD(base, k)); }

// A ray in memory is 32 bytes: origin, tmin, direction, tmax.
void store_ray(uvec2 rays, uint k, Ray r) {
    STORE_PAIR(rays, 4u * k, floatBitsToUint(r.origin.xy));
    STORE_PAIR(rays, 4u * k + 1u, floatBitsToUint(vec2(r.origin.z, r.tmin)));
    STORE_PAIR(rays, 4u * k + 2u, floatBitsToUint(r.direction.xy));
    STORE_PAIR(rays, 4u * k + 3u, floatBitsToUint(vec2(r.direction.z, r.tmax)));
}

Ray load_ray(uvec2 rays, uint k) {
    vec4 a = load_quad(rays, 2u * k), b = load_quad(rays, 2u * k + 1u);
    return Ray(a.xyz, a.w, b.xyz, b.w);
}

// The number of rays that this launch traces. Work-groups must not touch anything beyond.
uint ray_count() {
    if (is_null(push.queued)) return push.count;
    uint queued = Words(push.queued).v[0];
    return min(push.count, queued - min(queued, push.first));
}

#endif
