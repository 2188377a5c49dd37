// bvh_morton: a key for each leaf, by which leaves that are close in space are close in order. Each bit says in which half of its cell along the longest axis a centre
// lies (Vinkler, Bittner, Havran, "Extended Morton Codes for High Performance Bounding Volume Hierarchy Construction", HPG 2017), so that cells of flat scenes are cubes, too.
#include "bvh/builder.glsl"

vec3 unordered(uint a, uint b, uint c) {
    uvec3 bits = uvec3(a, b, c);
    return uintBitsToFloat(bits ^ mix(uvec3(0xffffffffu), uvec3(0x80000000u), greaterThanEqual(bits, uvec3(0x80000000u))));
}

void main() {
    BuildParams p = BuildParams(push.pass);
    uint i = own_tile() * BUILD_LANES + gl_LocalInvocationIndex;
    if (i >= p.count) return;
    BuildState state = BuildState(p.state);
    vec3 low = unordered(state.low[0], state.low[1], state.low[2]);
    vec3 size = unordered(state.high[0], state.high[1], state.high[2]) - low;
    BuildNode leaf = BuildNodes(p.nodes).v[i];
    vec3 at = leaf.min + leaf.max - low;
    uint code = 0u;
    for (uint bit = 0u; bit < 32u; bit++) {
        bool x = size.x >= size.y && size.x >= size.z, y = !x && size.y >= size.z;
        vec3 axis = vec3(x ? 1.0 : 0.0, y ? 1.0 : 0.0, x || y ? 0.0 : 1.0);
        size -= 0.5 * size * axis;
        float half_ = dot(size, axis), along = dot(at, axis);
        bool is_upper = along >= half_;
        at -= is_upper ? half_ * axis : vec3(0.0);
        code = code << 1 | (is_upper ? 1u : 0u);
    }
    BuildPairs(p.pairs[0]).v[i] = uvec2(code, i);
}
