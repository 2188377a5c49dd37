#version 460
#include "common/extensions.glsl"
#include "raster/view.glsl"

layout(location = 0) flat out uint primitive;
invariant gl_Position;

void main() {
    primitive = uint(gl_VertexIndex) / 3u;
    uint vertex = Words(push.queued).v[gl_VertexIndex];
    gl_Position = to_clip(seen_from_eye(load_vec3(push.rays, vertex)));
}
