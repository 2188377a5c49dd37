// larsen_light: the number of point lights that are visible from each pixel, with a shadow ray each.
#include "common/larsen.glsl"

Ray ray(uint index) {
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uvec2 pixel = larsen_pixel(f.size, index / l.light_count);
    if (any(greaterThanEqual(pixel, f.size))) return no_ray();
    uint at = image_index(f, pixel);
    if (larsen_nothing(f, at)) return no_ray();
    vec3 p = uintBitsToFloat(Quads(f.surface).v[at].xyz), n = uintBitsToFloat(Quads(f.normals).v[at].xyz);
    vec3 origin = p + LARSEN_BIAS * l.unit * n;
    vec3 to = uintBitsToFloat(Quads(l.lights).v[index % l.light_count].xyz) - origin;
    float d = length(to);
    return d > 0.0 ? Ray(origin, 0.0, to / d, d) : no_ray();
}

void any(uint index, bool occluded) {
    LarsenParams l = LarsenParams(push.pass);
    FrameParams f = FrameParams(l.frame);
    uvec2 pixel = larsen_pixel(f.size, index / l.light_count);
    if (occluded || any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    if (!larsen_nothing(f, at)) atomicAdd(QueueCount(l.lit).v[at], 1u);
}
