#version 460
#include "common/extensions.glsl"
#include "raster/view.glsl"

layout(location = 0) flat out uint primitive;

// Scale of a box around the sphere: a ray that hits the sphere leaves the box through a back face, wherever it starts.
const float MARGIN = 1.001;

float determinant_of(vec4 rows[3]) {
    return dot(cross(rows[0].xyz, rows[1].xyz), rows[2].xyz);
}

void main() {
    primitive = uint(gl_VertexIndex) / 36u;
    uint k = uint(gl_VertexIndex) % 36u;
    // two faces of an axis, two triangles of a face, corners counter-clockwise from outside
    uint axis = k / 12u;
    bool upper = k % 12u >= 6u;
    uint corner = k % 6u;
    vec2 square = vec2(corner == 1u || corner == 2u || corner == 4u ? 1.0 : -1.0, corner == 2u || corner >= 4u ? 1.0 : -1.0);
    if (!upper) square = square.yx;
    vec3 p = vec3(square, upper ? 1.0 : -1.0);
    p = axis == 0u ? p.zxy : axis == 1u ? p.yzx : p;
    // where transforms reverse the winding, the box is reflected in its centre, which reverses it again
    float turned = RasterParams(push.pass).turned;
    if (!SINGLE_LEVEL) {
        turned *= determinant_of(InstanceRecords(SceneRoot(push.scene).instances).v[push.first].group_to_world) < 0.0 ? -1.0 : 1.0;
    }
    vec4 sphere = uintBitsToFloat(Quads(push.rays).v[primitive]);
    gl_Position = to_clip(seen_from_eye(sphere.xyz + (turned * MARGIN * sphere.w) * p));
    // clipping planes cut the sphere, in the fragment shader, and not its box
    gl_Position.z = RasterParams(push.pass).box_depth;
}
