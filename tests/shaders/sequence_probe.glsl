// sequence_probe: writes what the sequences make of given inputs, so that a test can hold them to src/sampling/sequence.rs.
#include "common/types.glsl"
#include "common/sequence.glsl"
#include "interface/ray_set.glsl"
#include "probe.glsl"

// inputs: two uvec4 each: sequence, seed, pixel; frame, index, count
// outputs: a uvec4 each: the bits, and as fractions

layout(local_size_x = LANES) in;

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count) return;
    Probe probe = Probe(push.pass);
    uvec4 a = Quads(probe.inputs).v[2u * k], b = Quads(probe.inputs).v[2u * k + 1u];
    uvec2 bits = sequence_bits(a.x, a.y, a.zw, b.x, b.y, b.z);
    vec2 unit = sequence_2d(a.x, a.y, a.zw, b.x, b.y, b.z);
    ProbeOutputs(probe.outputs).v[k] = uvec4(bits, floatBitsToUint(unit));
}
