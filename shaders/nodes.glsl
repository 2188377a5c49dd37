// nodes: the number of BVH nodes that the camera ray of each pixel visits with the compute tracer, and a colour for it. Rays are not queued:
// one invocation per pixel.
#define STREAM_CLOSEST
#define COUNT_VISITS
#define SPREAD 1u
#include "common/camera.glsl"
#include "interface/passes.glsl"
#include "trace/wide.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer NodeWords { uint v[]; };

Ray counted_ray(uint k) {
    return centre_ray(BlockParams(NodesParams(push.pass).block), k);
}

// Viridis (Smith and van der Walt, 2015) by a polynomial of the sixth degree (Zucker, "Matplotlib colormaps", 2018): perceptually even, readable without
// colour vision. sRGB, 0 to 1.
vec3 viridis(float t) {
    const vec3 c0 = vec3(0.2777273, 0.0054073, 0.3340998), c1 = vec3(0.1050930, 1.4046135, 1.3845902), c2 = vec3(-0.3308618, 0.2148476, 0.0950952);
    const vec3 c3 = vec3(-4.6342305, -5.7991010, -19.3324410), c4 = vec3(6.2282699, 14.1799334, 56.6905526);
    const vec3 c5 = vec3(4.7763850, -13.7451454, -65.3530326), c6 = vec3(-5.4354559, 4.6458526, 26.3124352);
    return clamp(c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6))))), 0.0, 1.0);
}

void store_visits(uint k, uint nodes) {
    NodesParams p = NodesParams(push.pass);
    BlockParams b = BlockParams(p.block);
    uvec2 pixel = block_pixel(b, k);
    if (!in_block(b, pixel)) return;
    uint at = pixel.y * b.block_size.x + pixel.x;
    NodeWords(p.nodes).v[at] = nodes;
    float n = float(nodes) * p.gain;
    uvec3 bytes = uvec3(255.0 * viridis(n / (n + p.middle)) + 0.5);
    NodeWords(p.words).v[at] = 0xff000000u | bytes.r | bytes.g << 8 | bytes.b << 16;
}
