// Exclusive prefix sums, of a work-group and of an array in memory. The work-group of a dispatch that finishes last sums up what all of them have counted: none
// waits for another, as a sum in one pass over the array would (Merrill and Garland, "Single-pass Parallel Prefix Scan with Decoupled Look-back", 2016).
#ifndef BVH_SCAN
#define BVH_SCAN
#include "bvh/builder.glsl"

const uint SCAN_SIZE = SORT_DIGITS * BUILD_LANES;

shared uint counters[SCAN_SIZE];
shared uint lane_sums[BUILD_LANES];
shared bool is_last;

// The sum over the invocations before this one; `total`: over all.
uint scan_lanes(uint value, out uint total) {
    uint lane = gl_LocalInvocationIndex;
    lane_sums[lane] = value;
    barrier();
    for (uint reach = 1u; reach < BUILD_LANES; reach <<= 1) {
        uint before = lane >= reach ? lane_sums[lane - reach] : 0u;
        barrier();
        lane_sums[lane] += before;
        barrier();
    }
    uint sum = lane_sums[lane];
    total = lane_sums[BUILD_LANES - 1u];
    barrier();
    return sum - value;
}

// Replaces each of `counters` by the sum of those before it, and returns the sum of all.
uint scan_counters() {
    uint first = gl_LocalInvocationIndex * SORT_DIGITS, sum = 0u, total;
    for (uint k = 0u; k < SORT_DIGITS; k++) sum += counters[first + k];
    uint before = scan_lanes(sum, total);
    for (uint k = 0u; k < SORT_DIGITS; k++) {
        uint own = counters[first + k];
        counters[first + k] = before;
        before += own;
    }
    barrier();
    return total;
}

// The same for the first `size` words of an array, by one work-group.
void scan_array(uvec2 array, uint size) {
    BuildCounts counts = BuildCounts(array);
    uint before = 0u;
    for (uint first = 0u; first < size; first += SCAN_SIZE) {
        for (uint k = gl_LocalInvocationIndex; k < SCAN_SIZE; k += BUILD_LANES) counters[k] = first + k < size ? counts.v[first + k] : 0u;
        barrier();
        uint sum = scan_counters();
        for (uint k = gl_LocalInvocationIndex; k < SCAN_SIZE; k += BUILD_LANES) {
            if (first + k < size) counts.v[first + k] = counters[k] + before;
        }
        before += sum;
        barrier();
    }
    memoryBarrierBuffer();
    barrier();
}

// Whether this work-group is the last of so many that gets here. It sees what the others have written before.
bool finishes_last(BuildSteps steps, uint step, uint groups) {
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0u) is_last = atomicAdd(steps.v[step].finished, 1u) == groups - 1u;
    barrier();
    memoryBarrierBuffer();
    return is_last;
}

#endif
