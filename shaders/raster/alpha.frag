#version 460
#include "common/extensions.glsl"
#include "raster/view.glsl"
#include "scene/material.glsl"
#include "trace/rasterized.glsl"

layout(location = 0) flat in uint primitive;
layout(location = 0) out uvec2 visible;

void main() {
    float t;
    vec2 uv;
    intersect_rasterized(pixel_ray(gl_FragCoord.xy), push.first, primitive, t, uv);
    if (!alpha_passes(push.first, primitive, uv, 0.0)) discard;
    visible = uvec2(push.first + 1u, primitive);
}
