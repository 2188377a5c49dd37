// bvh_sort_count: how many keys of each tile have each digit, and from that where the first of them goes. With bvh_sort_scatter a pass of a radix sort
// (Satish, Harris, Garland, "Designing Efficient Sorting Algorithms for Manycore GPUs", IPDPS 2009): keys that are equal stay in order.
#include "bvh/scan.glsl"

shared uint histogram[SORT_DIGITS];

void main() {
    BuildParams p = BuildParams(push.pass);
    uint pass = push.first, lane = gl_LocalInvocationIndex;
    uint tiles = tile_count(p.count, SORT_TILE), tile = own_tile();
    if (tile >= tiles) return;
    BuildPairs keys = BuildPairs(p.pairs[pass & 1u]);
    if (lane < SORT_DIGITS) histogram[lane] = 0u;
    barrier();
    for (uint k = lane; k < SORT_TILE; k += BUILD_LANES) {
        uint i = tile * SORT_TILE + k;
        if (i < p.count) atomicAdd(histogram[keys.v[i].x >> 4u * pass & SORT_DIGITS - 1u], 1u);
    }
    barrier();
    if (lane < SORT_DIGITS) BuildCounts(p.counts).v[lane * tiles + tile] = histogram[lane];
    if (finishes_last(BuildSteps(p.steps), pass, tiles)) scan_array(p.counts, SORT_DIGITS * tiles);
}
