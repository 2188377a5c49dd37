// occlusion: one ray per covered pixel over the cosine-weighted hemisphere (pbrt-v4's AOIntegrator); adds accessibility to
// the film. Built twice: with a falloff the nearest hit counts by its distance, without one any hit will do.
// stream: any closest
#include "common/camera.glsl"
#include "common/warp.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer GBuffer { uvec4 v[]; };

// Sums are compensated (Kahan 1965): a million samples keep their digits.
struct FilmPixel {
    vec2 sum;          // of accessibility, and its compensation
    vec2 sum_squares;  // likewise
    uint covered;      // samples that met the scene; the others count 0 and are not written
    uint reserved;
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Film { FilmPixel v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Counters { uint v[]; };

Ray occlusion_ray(BlockParams p, uint index) {
    uint at = 3u * (index - push.first);
    GBuffer g = GBuffer(p.gbuffer);
    uvec4 n = g.v[at + 1u];
    if (n.w == 0u) return no_ray();
    vec4 position = uintBitsToFloat(g.v[at]);
    vec3 ng = uintBitsToFloat(n.xyz);
    vec3 axis = p.hemisphere != 0u ? uintBitsToFloat(g.v[at + 2u].xyz) : ng;
    uvec2 pixel = block_pixel(p, index) + p.block_origin;
    vec3 w = to_world(axis, cosine_hemisphere(sample_2d(p.seed, pixel, push.sample_index, AO_DIRECTION)));
    // about a shading normal some directions are below the surface: they start there, and meet its inside
    float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
    return Ray(position.xyz + ng * (side * position.w), 0.0, w, p.radius);
}

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = occlusion_ray(p, index);
    dump_ray(p, index, r);
    return r;
}

vec2 kahan_add(vec2 sum, float x) {
    precise float y = x - sum.y;
    precise float t = sum.x + y;
    precise float c = t - sum.x;
    precise float compensation = c - y;
    return vec2(t, compensation);
}

void add_sample(uint index, float occlusion) {
    BlockParams p = BlockParams(push.pass);
    // padding of a tile has no coverage either
    if (GBuffer(p.gbuffer).v[3u * (index - push.first) + 1u].w == 0u) return;
    Film film = Film(p.film);
    float accessibility = 1.0 - occlusion;
    FilmPixel pixel = film.v[index];
    pixel.sum = kahan_add(pixel.sum, accessibility);
    pixel.sum_squares = kahan_add(pixel.sum_squares, accessibility * accessibility);
    pixel.covered++;
    film.v[index] = pixel;
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 1.0 : 0.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, is_hit(hit) ? exp2(-hit.t * BlockParams(push.pass).falloff_log2) : 0.0);
}
#endif
