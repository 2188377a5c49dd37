// A sample of ambient occlusion (pbrt-v4's AOIntegrator, with a falloff): a ray over the cosine-weighted hemisphere about a surface point, and how much
// what it meets occludes. Images, frames and what they are compared with share it.
#ifndef AO_SAMPLE
#define AO_SAMPLE
#include "common/types.glsl"

// How much a hit at a distance occludes: c^-d, given log2(c).
float occlusion_at(float falloff_log2, float distance_) {
    return exp2(-distance_ * falloff_log2);
}

float occlusion_of(float falloff_log2, Hit hit) {
    return is_hit(hit) ? occlusion_at(falloff_log2, hit.t) : 0.0;
}

// The ray of direction w from a surface with the geometric normal ng, `offset` off it so that it does not meet the surface itself, up to `reach`.
Ray occlusion_ray(vec3 position, float offset, vec3 ng, vec3 w, float reach) {
    // about a shading normal some directions are below the surface: they start there, and meet its inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(position + ng * (side * offset), 0.0, w, reach);
}

#endif
