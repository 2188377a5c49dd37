// Ambient light: radiance that is the same from everywhere, which ambient occlusion keeps from a surface, as real-time renderers have it.
#ifndef PATH_AMBIENT
#define PATH_AMBIENT
#include "ao/sample.glsl"
#include "path/view.glsl"

// Share of ambient light that a surface reflects: its albedo, less the share that it transmits. What reflects and transmits by delta lobes alone shows single
// directions, of which ambient occlusion says nothing: 0. albedo: surface_albedo().
vec3 ambient_reflectance(Shading m, vec3 albedo) {
    if (!has_rough_part(m.bsdf)) return vec3(0.0);
    return max(albedo * (1.0 - m.bsdf.through_share) - m.bsdf.transmitted, vec3(0.0));
}

// The occlusion ray of a sample (ao/sample.glsl), of random length: any hit will do.
Ray ambient_ray(BlockParams block, OcclusionRecord o, Surface s, vec3 ng, uvec2 pixel, uint n) {
    vec3 axis = o.hemisphere == 0u ? ng : dot(s.ng, ng) < 0.0 ? -s.ns : s.ns;
    vec3 w = to_world(axis, cosine_hemisphere(sample_2d(block.seed, pixel, n, AO_DIRECTION)));
    float reach = random_reach(o, sample_2d(block.seed, pixel, n, AO_LENGTH).x);
    return occlusion_ray(s.position, s.offset, ng, w, reach);
}

#endif
