// A sample of ambient occlusion (pbrt-v4's AOIntegrator, with a falloff): a ray over the cosine-weighted hemisphere about a surface point, and the
// occlusion of its hit. Still images, frames and benchmarks share it.
#ifndef AO_SAMPLE
#define AO_SAMPLE
#include "common/types.glsl"
#include "interface/ao.glsl"

// Occlusion of a hit at a distance: c^-d, given log2(c).
float occlusion_at(float falloff_log2, float distance_) {
    return exp2(-distance_ * falloff_log2);
}

float occlusion_of(float falloff_log2, Hit hit) {
    return is_hit(hit) ? occlusion_at(falloff_log2, hit.t) : 0.0;
}

// The length of an occlusion ray that any hit ends: with falloff c it is longer than d with probability c^-d, so a hit at distance d occludes by c^-d on average.
float random_reach(OcclusionRecord o, float u) {
    return o.falloff_log2 > 0.0 ? min(o.reach, -log2(1.0 - u) / o.falloff_log2) : o.reach;
}

// The ray of direction w from a surface with geometric normal ng, `offset` above it so that it does not hit the surface itself, up to distance `reach`.
Ray occlusion_ray(vec3 position, float offset, vec3 ng, vec3 w, float reach) {
    // about a shading normal some directions are below the surface: those rays start below it, and hit it from inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(position + ng * (side * offset), 0.0, w, reach);
}

#endif
