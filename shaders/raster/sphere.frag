#version 460
#include "common/extensions.glsl"
#include "raster/view.glsl"
#include "scene/material.glsl"
#include "trace/rasterized.glsl"

layout(location = 0) flat in uint primitive;
layout(location = 0) out uvec2 visible;

void main() {
    Ray world = pixel_ray(gl_FragCoord.xy);
    Ray r = to_group(world, push.first);
    vec4 sphere = uintBitsToFloat(Quads(push.rays).v[primitive]);
    float t = intersect_sphere(r.origin, r.direction, 0.0, r.tmax, sphere.xyz, sphere.w);
    if (!(t > 0.0 && t < r.tmax)) discard;
    vec4 place = to_clip((world.origin - RasterParams(push.pass).eye) + t * world.direction);
    gl_FragDepth = place.z / place.w;
    visible = uvec2(push.first + 1u, primitive);
}
