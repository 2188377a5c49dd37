// gbuffer: one camera ray through each pixel's centre; stores the surface for the following passes of the frame.
#include "ao/hemisphere.glsl"
#include "common/frame.glsl"
#include "interface/gbuffer.glsl"
#include "scene/motion.glsl"

Ray ray(uint index) {
    return centre_ray(BlockParams(push.pass), index);
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return;
    GbufferParams g = GbufferParams(behind_block(0u));
    FrameParams f = FrameParams(g.frame);
    bool about_ns = g.hemisphere != 0u;
    uint at = image_index(f, pixel);
    if (!is_hit(hit)) {
        STORE_PAIR(f.guide, at, uvec2(floatBitsToUint(INFINITY), 0u));
        return;
    }
    // the point on a triangle follows from its corners; only a sphere needs the ray again
    Surface s = surface_at(HAS_SPHERES ? centre_ray(p, index) : no_ray(), hit);
    vec4 back = f.world_to_camera[2];
    float depth = -(dot(back.xyz, s.position) + back.w);
    Hemisphere h = hemisphere_at(p, s, about_ns);
    STORE_PAIR(f.guide, at, make_guide(depth, h.ng, hit.instance));
    store_surface(f, at, s.position, s.offset, h.ng);
    if (g.catcher != INVALID && load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh).material == g.catcher) store_caught(f, at, h.ng);
    if (about_ns) {
        FloatImage axes = FloatImage(f.axes);
        for (uint k = 0u; k < 3u; k++) axes.v[3u * at + k] = h.axis[k];
    }
    if (!is_null(f.previous_position)) {
        vec3 before = previous_position(hit, s);
        FloatImage previous = FloatImage(f.previous_position);
        for (uint k = 0u; k < 3u; k++) previous.v[3u * at + k] = before[k];
    }
}
