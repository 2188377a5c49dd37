// bvh_sort_scatter: the keys of a tile, each to where bvh_sort_count says that its digit goes.
#include "bvh/scan.glsl"

shared uint starts[SORT_DIGITS];

void main() {
    BuildParams p = BuildParams(push.pass);
    uint pass = push.first, lane = gl_LocalInvocationIndex;
    uint tiles = tile_count(p.count, SORT_TILE), tile = own_tile();
    if (tile >= tiles) return;
    BuildPairs from = BuildPairs(p.pairs[pass & 1u]), to = BuildPairs(p.pairs[~pass & 1u]);
    // an invocation has consecutive keys, so that a counter for each digit and invocation gives every key its place
    uint first = tile * SORT_TILE + lane * SORT_KEYS;
    for (uint d = 0u; d < SORT_DIGITS; d++) counters[d * BUILD_LANES + lane] = 0u;
    for (uint k = 0u; k < SORT_KEYS; k++) {
        if (first + k < p.count) counters[(from.v[first + k].x >> 4u * pass & SORT_DIGITS - 1u) * BUILD_LANES + lane]++;
    }
    barrier();
    scan_counters();
    if (lane < SORT_DIGITS) starts[lane] = BuildCounts(p.counts).v[lane * tiles + tile] - counters[lane * BUILD_LANES];
    barrier();
    for (uint k = 0u; k < SORT_KEYS; k++) {
        if (first + k < p.count) {
            uvec2 pair = from.v[first + k];
            uint digit = pair.x >> 4u * pass & SORT_DIGITS - 1u, counter = digit * BUILD_LANES + lane;
            to.v[starts[digit] + counters[counter]] = pair;
            counters[counter]++;
        }
    }
}
