// primary: one camera ray per pixel, jittered within it; writes what the occlusion pass starts from.
// stream: closest
#include "common/camera.glsl"
#include "scene/surface.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) writeonly buffer GBuffer { uvec4 v[]; };

// The index is of the block, the G-buffer's is of the launch.
Ray primary_ray(BlockParams p, uint index) {
    uvec2 pixel = block_pixel(p, index);
    if (!in_block(p, pixel)) return no_ray();
    pixel += p.block_origin;
    return camera_ray(p, vec2(pixel) + sample_2d(p.seed, pixel, push.sample_index, CAMERA_FILM));
}

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = primary_ray(p, index);
    dump_ray(p, index, r);
    return r;
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    GBuffer g = GBuffer(p.gbuffer);
    uint at = 3u * (index - push.first);
    if (!is_hit(hit)) {
        g.v[at + 1u].w = 0u;
        return;
    }
    // the point on a triangle follows from its corners; only a sphere asks for the ray again
    Surface s = surface_at(HAS_SPHERES ? primary_ray(p, index) : no_ray(), hit);
    // the side that the viewer sees
    float side = dot(s.ng, view_direction(p, s.position)) > 0.0 ? -1.0 : 1.0;
    g.v[at] = floatBitsToUint(vec4(s.position, s.offset));
    g.v[at + 1u] = uvec4(floatBitsToUint(side * s.ng), 1u);
    if (p.hemisphere != 0u) g.v[at + 2u] = uvec4(floatBitsToUint(side * s.ns), 0u);
}
