// No tracer: what the camera's rays meet was drawn (src/raster). One compute thread a ray; each looks up what its pixel
// shows and meets that one primitive. For streams of camera rays, one a pixel, whose parameters are BlockParams. At push.rays are two words
// for each pixel of the block, row by row: the entry of the top level and one, and the primitive of its group; zero for nothing.
#ifndef TRACE_VISIBILITY
#define TRACE_VISIBILITY
#include "common/camera.glsl"
#include "trace/callback.glsl"
#include "trace/rasterized.glsl"

layout(local_size_x = LANES) in;

void main() {
    if (gl_GlobalInvocationID.x >= ray_count()) return;
    uint index = push.first + gl_GlobalInvocationID.x;
    Ray world = ray(index);
    if (!is_ray(world)) {
        deliver_miss(index);
        return;
    }
    BlockParams p = BlockParams(push.pass);
    uvec2 pixel = block_pixel(p, pixel_index(index));
    uvec2 drawn = Pairs(push.rays).v[pixel.y * p.block_size.x + pixel.x];
    if (drawn.x == 0u) {
        deliver_miss(index);
        return;
    }
    uint entry = drawn.x - 1u;
    float t;
    vec2 uv;
    intersect_rasterized(world, entry, drawn.y, t, uv);
    closest(index, scene_hit(t, entry, drawn.y, uv));
}

#endif
