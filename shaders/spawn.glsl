// spawn: the occlusion rays of a frame, into the queue: from the surface of each pixel that is sampled in this frame, over the
// cosine-weighted hemisphere (pbrt-v4's AOIntegrator). Pixels that show nothing cost nothing from here on, and neither do those
// that have all their samples while nothing moves.
// compute: queue
#include "common/frame.glsl"
#include "common/sequence.glsl"
#include "common/warp.glsl"

layout(local_size_x = LANES) in;

// Which of the pixels that share samples this one is, or where the sequence stands: how often a pixel is sampled, and in what order
// its neighbours are.
const uint PATTERN_CHECKER = 1u;
const uint PATTERN_QUARTER = 2u;

bool is_sampled(FrameParams f, uvec2 pixel) {
    if (f.pattern == PATTERN_CHECKER) return ((pixel.x + pixel.y + f.frame) & 1u) == 0u;
    // one of each 2x2, opposite corners in turn
    if (f.pattern == PATTERN_QUARTER) return (0x9cu >> (2u * (f.frame & 3u)) & 3u) == ((pixel.x & 1u) | (pixel.y & 1u) << 1);
    return true;
}

vec2 direction_sample(FrameParams f, uvec2 pixel, uint k) {
    // what is ordered over the image counts the pixels that are sampled, what is ordered over time the frames in which they are
    uvec2 cell = f.pattern == PATTERN_QUARTER ? pixel >> 1 : f.pattern == PATTERN_CHECKER ? uvec2(pixel.x >> 1, pixel.y) : pixel;
    if (f.sequence == SEQUENCE_BLUE) return sequence_2d(f.sequence, f.seed, cell, f.frame, k, f.rays_per_pixel);
    return sequence_2d(f.sequence, f.seed, pixel, f.frame >> f.pattern, k, f.rays_per_pixel);
}

void main() {
    if (gl_GlobalInvocationID.x >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    uvec2 pixel = tile_pixel(f, push.first + gl_GlobalInvocationID.x);
    if (any(greaterThanEqual(pixel, f.size)) || !is_sampled(f, pixel)) return;
    uint at = image_index(f, pixel);
    if (!is_surface(Pairs(f.guide).v[at])) return;
    if (f.still != 0u && f.has_history != 0u && f.rest != 0u && unpack_estimate(Pairs(f.previous_history).v[at]).samples >= f.most_samples) return;
    vec4 a = uintBitsToFloat(Quads(f.surface).v[2u * at]), b = uintBitsToFloat(Quads(f.surface).v[2u * at + 1u]);
    vec3 ng = b.xyz;
    vec3 axis = is_null(f.axes) ? ng : load_vec3(f.axes, at);
    uint n = f.rays_per_pixel;
    if (n > 1u) STORE_PAIR(f.current, at, pack_estimate(Estimate(0.0, float(n), 0.0)));
    for (uint k = 0u; k < n; k++) {
        vec3 w = to_world(axis, cosine_hemisphere(direction_sample(f, pixel, k)));
        // about a shading normal some directions are below the surface: they start there, and meet its inside
        float side = dot(ng, w) < 0.0 ? -1.0 : 1.0;
        append_ray(f.queue, Ray(a.xyz + ng * (side * a.w), 0.0, w, f.reach), n == 1u ? at : gl_GlobalInvocationID.x * n + k);
    }
}
