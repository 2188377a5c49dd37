#version 460
#include "common/extensions.glsl"
#include "raster/view.glsl"

layout(location = 0) flat in uint primitive;
layout(location = 0) out uvec2 visible;

void main() {
    visible = uvec2(push.first + 1u, primitive);
}
