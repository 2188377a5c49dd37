// Pixels of a block of the image, and their camera rays.
#ifndef COMMON_CAMERA
#define COMMON_CAMERA
#include "common/types.glsl"
#include "interface/block.glsl"
#include "common/morton.glsl"
#include "common/queue.glsl"
#include "common/sampler.glsl"

// A ray index counts the samples of a pixel before the pixels of the block, so that adjacent lanes share a pixel. Pixels are
// counted in 8x8 tiles in Morton order: with one sample eight adjacent lanes are a 4x2 patch.
uint pixel_index(uint ray_index) {
    return ray_index >> push.sample_bits;
}

uint sample_index(uint ray_index) {
    return push.sample_index + (ray_index & ((1u << push.sample_bits) - 1u));
}

// Address of what a pass reads besides the parameters of its block: it lies behind those, `offset` bytes from their end. It follows from push constants alone, so a CPU driver
// reads from there once for all lanes (src/shaders/specialize/uniform.rs).
uvec2 behind_block(uint offset) {
    uint carry;
    uint low = uaddCarry(push.pass.x, BLOCK_PARAMS_BYTES + offset, carry);
    return uvec2(low, push.pass.y + carry);
}

// The pixel in the block of a ray index.
uvec2 block_pixel(BlockParams p, uint pixel) {
    uint tile = pixel >> 6;
    if (!is_null(p.tiles)) tile = Words(p.tiles).v[tile];
    return tile_pixel(tile, p.tiles_x, pixel & 63u);
}

bool in_block(BlockParams p, uvec2 pixel) {
    return all(lessThan(pixel, p.block_size));
}

// Length along a direction from the camera of what lies before the near clipping plane.
float clipped_length(BlockParams p, vec3 direction) {
    vec4 rows[3] = p.camera_to_world;
    return p.clip_near > 0.0 ? p.clip_near / -dot(direction, vec3(rows[0].z, rows[1].z, rows[2].z)) : 0.0;
}

// The part of a ray from the camera between the clipping planes. It starts at the near one: tmin may hold the ray's seed.
Ray clip_ray(BlockParams p, Ray r) {
    if (p.clip_near == 0.0 && p.clip_far == 0.0) return r;
    vec4 rows[3] = p.camera_to_world;
    float length_ = 1.0 / -dot(r.direction, vec3(rows[0].z, rows[1].z, rows[2].z));
    r.origin += r.direction * (p.clip_near * length_);
    if (p.clip_far > 0.0) r.tmax = (p.clip_far - p.clip_near) * length_;
    return r;
}

// Ray from the camera through a point of the image, in pixels from the upper left corner, whatever is clipped.
Ray unclipped_camera_ray(BlockParams p, vec2 at) {
    vec2 ndc = 2.0 * at / vec2(p.image_size) - 1.0;
    vec2 plane = vec2(ndc.x, -ndc.y) * p.view;
    vec4 rows[3] = p.camera_to_world;
    vec3 eye = vec3(rows[0].w, rows[1].w, rows[2].w);
    if (p.orthographic != 0u) {
        vec3 offset = vec3(rows[0].x, rows[1].x, rows[2].x) * plane.x + vec3(rows[0].y, rows[1].y, rows[2].y) * plane.y;
        return Ray(eye + offset, 0.0, -vec3(rows[0].z, rows[1].z, rows[2].z), INFINITY);
    }
    vec3 d = vec3(plane, -1.0);
    return Ray(eye, 0.0, normalize(vec3(dot(rows[0].xyz, d), dot(rows[1].xyz, d), dot(rows[2].xyz, d))), INFINITY);
}

// Ray through a point of the image, in pixels from the upper left corner.
Ray camera_ray(BlockParams p, vec2 at) {
    return clip_ray(p, unclipped_camera_ray(p, at));
}

// The ray of an index, through the centre of its pixel or at an offset from it that all pixels share; an invalid ray for padding.
Ray centre_ray(BlockParams p, uint ray_index) {
    uvec2 pixel = block_pixel(p, pixel_index(ray_index));
    if (!in_block(p, pixel)) return no_ray();
    return camera_ray(p, vec2(pixel + p.block_origin) + 0.5 + p.centre_offset);
}

// Direction from the camera to a point, not normalized.
vec3 view_direction(BlockParams p, vec3 position) {
    vec4 rows[3] = p.camera_to_world;
    return p.orthographic != 0u ? -vec3(rows[0].z, rows[1].z, rows[2].z) : position - vec3(rows[0].w, rows[1].w, rows[2].w);
}

// For --dump-rays: stores the rays before they are traced.
void dump_ray(uvec2 dump, uint index, Ray ray) {
    if (!is_null(dump)) store_ray(dump, index - push.first, ray);
}

#endif
