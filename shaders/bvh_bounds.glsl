// bvh_bounds: the bounds of the leaves' centres. Least and greatest do not depend on the order of work-groups, so that atomics may find them.
#include "bvh/builder.glsl"

shared vec3 lower[BUILD_LANES], upper[BUILD_LANES];

// Numbers that are compared as the floats are.
uvec3 ordered(vec3 v) {
    uvec3 bits = floatBitsToUint(v);
    return bits ^ mix(uvec3(0x80000000u), uvec3(0xffffffffu), greaterThanEqual(bits, uvec3(0x80000000u)));
}

void main() {
    BuildParams p = BuildParams(push.pass);
    BuildNodes nodes = BuildNodes(p.nodes);
    uint lane = gl_LocalInvocationIndex, first = own_tile() * SORT_TILE;
    if (first >= p.count) return;
    vec3 low = vec3(INFINITY), high = vec3(-INFINITY);
    for (uint k = lane; k < SORT_TILE; k += BUILD_LANES) {
        if (first + k < p.count) {
            vec3 center = nodes.v[first + k].min + nodes.v[first + k].max;
            low = min(low, center);
            high = max(high, center);
        }
    }
    lower[lane] = low;
    upper[lane] = high;
    barrier();
    for (uint reach = BUILD_LANES >> 1; reach > 0u; reach >>= 1) {
        if (lane < reach) {
            lower[lane] = min(lower[lane], lower[lane + reach]);
            upper[lane] = max(upper[lane], upper[lane + reach]);
        }
        barrier();
    }
    if (lane == 0u) {
        BuildState state = BuildState(p.state);
        uvec3 l = ordered(lower[0]), h = ordered(upper[0]);
        for (uint axis = 0u; axis < 3u; axis++) {
            atomicMin(state.low[axis], l[axis]);
            atomicMax(state.high[axis], h[axis]);
        }
    }
}
