// No tracer: the hits of the camera rays come from rasterization (src/raster). One compute thread per ray looks up the primitive of its pixel
// and intersects it. For streams of one camera ray per pixel, whose parameters are BlockParams. push.rays is the address of two words
// for each pixel of the block, row by row: index of the TLAS instance plus one, and index of the primitive in its group; zero for the background.
#ifndef TRACE_VISIBILITY
#define TRACE_VISIBILITY
#include "common/camera.glsl"
#include "trace/rasterized.glsl"

layout(local_size_x = LANES) in;

void main() {
    if (gl_GlobalInvocationID.x >= ray_count()) return;
    uint index = push.first + gl_GlobalInvocationID.x;
    Ray world = ray(index);
    uvec2 rasterized = uvec2(0u);
    if (is_ray(world)) {
        BlockParams p = BlockParams(push.pass);
        uvec2 pixel = block_pixel(p, pixel_index(index));
        rasterized = Pairs(push.rays).v[pixel.y * p.block_size.x + pixel.x];
    }
    Hit hit = miss();
    if (rasterized.x != 0u) {
        uint tlas_instance = rasterized.x - 1u;
        float t;
        vec2 uv;
        intersect_rasterized(world, tlas_instance, rasterized.y, t, uv);
        hit = scene_hit(t, tlas_instance, rasterized.y, uv);
    }
    // one call for hits and misses: the stream's code, which may be all of a path's, is compiled once for each call
    closest(index, hit);
}

#endif
