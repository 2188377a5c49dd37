// sampler_probe: traces nothing; writes what the sampler and the warps make of given inputs, so that a test can hold them to
// src/sampling on every tracer and driver.
#include "common/types.glsl"
#include "common/sampler.glsl"
#include "common/warp.glsl"
#include "interface/ray_set.glsl"
#include "probe.glsl"

// inputs: two uvec4 each: seed, pixel, sample index; dimension, normal
// outputs: three uvec4 each

Ray ray(uint index) { return no_ray(); }

void any(uint index, bool occluded) {
    Probe probe = Probe(push.pass);
    Quads inputs = Quads(probe.inputs);
    uvec4 a = inputs.v[2u * index];
    uvec4 b = inputs.v[2u * index + 1u];
    vec2 u = sample_2d(a.x, a.yz, a.w, b.x);
    vec3 local = cosine_hemisphere(u);
    vec3 world = to_world(uintBitsToFloat(b.yzw), local);
    ProbeOutputs outputs = ProbeOutputs(probe.outputs);
    outputs.v[3u * index] = uvec4(sample_2d_bits(a.x, a.yz, a.w, b.x), floatBitsToUint(u));
    outputs.v[3u * index + 1u] = uvec4(floatBitsToUint(local), occluded ? 1u : 0u);
    outputs.v[3u * index + 2u] = uvec4(floatBitsToUint(world), sample_choice_bits(a.x, a.yz, a.w, b.x).x);
}
