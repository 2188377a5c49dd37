// nodes: the number of BVH nodes that the camera ray of each pixel visits with the compute tracer, and a colour for it. Rays are not queued:
// one invocation per pixel.
#define STREAM_CLOSEST
#define COUNT_VISITS
#define SPREAD 1u
#include "common/camera.glsl"
#include "common/viridis.glsl"
#include "interface/passes.glsl"
#include "trace/wide.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer NodeWords { uint v[]; };

Ray counted_ray(uint k) {
    return centre_ray(BlockParams(DebugParams(push.pass).block), k);
}

void store_visits(uint k, uint nodes) {
    DebugParams p = DebugParams(push.pass);
    BlockParams b = BlockParams(p.block);
    uvec2 pixel = block_pixel(b, k);
    if (!in_block(b, pixel)) return;
    uint at = pixel.y * b.block_size.x + pixel.x;
    NodeWords(p.counts).v[at] = nodes;
    float n = float(nodes) * p.gain;
    uvec3 bytes = uvec3(255.0 * viridis(n / (n + p.middle)) + 0.5);
    NodeWords(p.words).v[at] = 0xff000000u | bytes.r | bytes.g << 8 | bytes.b << 16;
}
