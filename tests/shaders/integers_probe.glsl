// integers_probe: writes what divide(), to_int() and wrap_texel() make of given inputs, so that a test can hold them to whole numbers on the host.
#include "common/integers.glsl"
#include "common/types.glsl"
#include "interface/ray_set.glsl"
#include "probe.glsl"
#include "scene/texture.glsl"

// inputs: two uvec4 each: dividend, divisor, bits of a float, not used; texel, size and mode of a texture, not used
// outputs: a uvec4 each: remainder, quotient, the float as an integer, wrapped texel

layout(local_size_x = LANES) in;

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count) return;
    Probe probe = Probe(push.pass);
    uvec4 a = LOAD_QUAD(probe.inputs, 2u * k), b = LOAD_QUAD(probe.inputs, 2u * k + 1u);
    ProbeOutputs(probe.outputs).v[k] = uvec4(divide(a.x, a.y), uint(to_int(uintBitsToFloat(a.z))), wrap_texel(int(b.x), b.y, b.z));
}
