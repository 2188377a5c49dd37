// aov: one ray through each pixel's centre; writes the AOVs of its hit.
#include "common/camera.glsl"
#include "interface/aov.glsl"
#include "scene/surface.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) writeonly buffer Aov { uvec4 v[]; };

Ray ray(uint index) {
    return centre_ray(BlockParams(push.pass), index);
}

// Writes an AovPixel.
void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    Aov aov = Aov(AovParams(behind_block(0u)).pixels);
    uint at = 4u * (index - push.first);
    if (!is_hit(hit)) {
        aov.v[at] = uvec4(floatBitsToUint(INFINITY), INVALID, INVALID, INVALID);
        aov.v[at + 1u] = aov.v[at + 2u] = aov.v[at + 3u] = uvec4(0u);
        return;
    }
    Ray r = centre_ray(p, index);
    Surface s = surface_at(r, hit);
    SceneRoot root = SceneRoot(push.scene);
    SubmeshRecord submesh = SubmeshRecords(root.submeshes).v[s.submesh];
    vec4 color = base_color(submesh, MaterialRecords(root.materials).v[submesh.material], s.primitive, s.uv);
    aov.v[at] = uvec4(floatBitsToUint(hit.t + clipped_length(p, r.direction)), hit.instance, hit.primitive, submesh.material);
    aov.v[at + 1u] = uvec4(floatBitsToUint(s.position), floatBitsToUint(color.r));
    aov.v[at + 2u] = uvec4(floatBitsToUint(s.ng), floatBitsToUint(color.g));
    aov.v[at + 3u] = uvec4(floatBitsToUint(s.ns), floatBitsToUint(color.b));
}
