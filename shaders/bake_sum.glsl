// bake_sum: adds the samples of a launch to the sums of their points, in the order of the samples, so that the result is deterministic.
#include "common/camera.glsl"
#include "interface/bake.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count >> push.sample_bits) return;
    BakeParams p = BakeParams(push.pass);
    uint point = pixel_index(push.first) + k, begin = k << push.sample_bits;
    vec4 sum = load_quad(p.sums, 2u * point), squares = load_quad(p.sums, 2u * point + 1u);
    for (uint s = begin; s < begin + (1u << push.sample_bits); s++) {
        vec4 x = p.has_directions != 0u ? load_quad(p.samples, s) : vec4(0.0, 0.0, 0.0, Floats(p.samples).v[s]);
        sum += x;
        squares += x * x;
    }
    store_quad(p.sums, 2u * point, sum);
    store_quad(p.sums, 2u * point + 1u, squares);
}
