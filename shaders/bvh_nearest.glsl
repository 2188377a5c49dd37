// bvh_nearest: a round of clustering, first half. Each cluster looks for the nearest of its neighbours along the Morton curve, and two that choose each other will be merged
// (Meister, Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG 2018). The distance of two is the area of the box around them,
// less half of their own areas: without that, trees cost up to a twentieth more (docs/design/bvh.md). As in Benthin, Drabinski, Tessari, Dittebrandt, "PLOC++" (HPG 2022), a
// work-group repeats the search of its tile's neighbours, so that one dispatch does. Where two are as near, that one is nearest whose number differs least in binary: of equal
// boxes all are merged in pairs, and some pair is in each round.
#include "bvh/scan.glsl"

const uint SPAN = BUILD_LANES + 2u * SEARCH_RADIUS;

shared vec3 lower[SPAN], upper[SPAN];
shared float half_areas[SPAN];
shared uint nearest[BUILD_LANES];
shared uint kept, merged;

void main() {
    BuildParams p = BuildParams(push.pass);
    BuildSteps steps = BuildSteps(p.steps);
    uint round_ = push.first, step = FIRST_ROUND + round_, lane = gl_LocalInvocationIndex;
    uint count = steps.v[step].count, tiles = tile_count(count, CLUSTER_TILE), tile = own_tile();
    if (tile >= tiles) return;
    BuildPairs clusters = BuildPairs(p.pairs[round_ & 1u]);
    // numbers below zero are large ones
    uint first = tile * CLUSTER_TILE - 2u * SEARCH_RADIUS;
    for (uint k = lane; k < SPAN; k += BUILD_LANES) {
        if (first + k < count) {
            BuildNode node = BuildNodes(p.nodes).v[clusters.v[first + k].y];
            lower[k] = node.min;
            upper[k] = node.max;
            half_areas[k] = 0.5 * half_area(node.min, node.max, p.scale);
        }
    }
    if (lane == 0u) {
        kept = 0u;
        merged = 0u;
    }
    barrier();

    uint own = first + SEARCH_RADIUS + lane, best = INVALID;
    // neighbours in order, where as many rounds or levels are left as that takes
    uint levels = count <= 1u ? 0u : uint(findMSB(count - 1u)) + 1u;
    BuildState state = BuildState(p.state);
    bool in_order = round_ + levels >= MAX_ROUNDS || state.height + levels >= state.max_height;
    if (own < count && in_order) {
        best = (own ^ 1u) < count ? own ^ 1u : INVALID;
    } else if (own < count) {
        vec3 low = lower[lane + SEARCH_RADIUS], high = upper[lane + SEARCH_RADIUS];
        float least = INFINITY;
        for (uint k = lane; k <= lane + 2u * SEARCH_RADIUS; k++) {
            uint other = first + k;
            if (other < count && other != own) {
                // the same number from both sides: areas of one box are computed once
                float distance_ = half_area(min(low, lower[k]), max(high, upper[k]), p.scale) - (half_areas[k] + half_areas[lane + SEARCH_RADIUS]);
                if (distance_ < least || (distance_ == least && (own ^ other) < (own ^ best))) {
                    least = distance_;
                    best = other;
                }
            }
        }
    }
    nearest[lane] = best;
    barrier();

    if (lane >= SEARCH_RADIUS && lane < SEARCH_RADIUS + CLUSTER_TILE && own < count) {
        bool is_mutual = best != INVALID && nearest[best - first - SEARCH_RADIUS] == own;
        uint partner = !is_mutual ? ALONE : own < best ? best : ABSORBED;
        clusters.v[own].x = partner;
        if (partner != ABSORBED) atomicAdd(kept, 1u);
        if (is_mutual && own < best) atomicAdd(merged, 1u);
    }
    barrier();
    BuildCounts counts = BuildCounts(p.counts);
    if (lane == 0u) {
        counts.v[tile] = kept;
        counts.v[tiles + tile] = merged;
    }
    if (finishes_last(steps, step, tiles)) {
        scan_array(p.counts, 2u * tiles);
        if (lane == 0u) {
            uint left = counts.v[tiles];
            steps.v[step + 1u].count = left;
            if (left > 1u) steps.v[step + 1u].groups = tile_groups(tile_count(left, CLUSTER_TILE));
        }
    }
}
