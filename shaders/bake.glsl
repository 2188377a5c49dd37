// bake: rays from the points of texels: occlusion rays over the hemisphere outside of the surface, or rays into it, whose lengths are its thickness.
// Compiled twice: with a falloff, or for thickness, the nearest hit counts by its distance, without them any hit is enough.
#include "ao/sample.glsl"
#include "common/camera.glsl"
#include "common/warp.glsl"
#include "interface/bake.glsl"
#include "scene/surface.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Samples { float v[]; };

BakePoint point_of(BakeParams p, uint index) {
    return BakePoints(p.points).v[pixel_index(index)];
}

Surface surface_of(BakePoint point) {
    return surface_at(no_ray(), Hit(0.0, point.instance, point.primitive, point.u, point.v));
}

// Direction of a sample, about the geometric normal or the shading normal.
vec3 direction_of(BakeParams p, BakePoint point, Surface s, uint index) {
    uvec2 texel = uvec2(point.texel & 0xffffu, point.texel >> 16);
    vec3 axis = p.occlusion.hemisphere != 0u ? s.ns : s.ng;
    vec2 u = sample_2d(p.seed, texel, point.first_sample + sample_index(index), AO_DIRECTION);
    return to_world(p.is_inward != 0u ? -axis : axis, cosine_hemisphere(u));
}

Ray ray(uint index) {
    BakeParams p = BakeParams(push.pass);
    BakePoint point = point_of(p, index);
    Surface s = surface_of(point);
    vec3 w = direction_of(p, point, s, index);
    return occlusion_ray(s.position, s.offset, s.ng, w, p.occlusion.reach);
}

void add_sample(uint index, float value) {
    BakeParams p = BakeParams(push.pass);
    if (p.has_directions == 0u) {
        Samples(p.samples).v[index - push.first] = value;
        return;
    }
    BakePoint point = point_of(p, index);
    vec3 w = direction_of(p, point, surface_of(point), index);
    store_quad(p.samples, index - push.first, vec4(value * w, value));
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 0.0 : 1.0);
}
#else
void closest(uint index, Hit hit) {
    BakeParams p = BakeParams(push.pass);
    float share = is_hit(hit) ? hit.t / p.occlusion.reach : 1.0;
    add_sample(index, p.has_lengths != 0u ? share : 1.0 - occlusion_of(p.occlusion.falloff_log2, hit));
}
#endif
