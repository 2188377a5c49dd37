// bvh_merge: a round of clustering, second half. Clusters that are merged become a node of the binary tree, and those that are left move together. A new node learns at once
// what its subtree costs as at most one to seven wide ones, from what its children know: the dynamic program of Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal
// on GPUs Through Compressed Wide BVHs" (HPG 2017), section 3.1, as in src/accel/wide.rs.
#include "bvh/scan.glsl"

// A subtree as at most 1 to 7 wide ones.
struct Cuts {
    float cost[7];
    uint blocks[7];
};

Cuts cuts_of(BuildParams p, uint id, BuildNode node) {
    Cuts cuts;
    if (id < p.count) {
        float area = half_area(node.min, node.max, p.scale);
        [[unroll]] for (uint k = 0u; k < 7u; k++) {
            cuts.cost[k] = area;
            cuts.blocks[k] = 1u;
        }
    } else {
        BuildInner inner = BuildInners(p.inners).v[id - p.count];
        cuts.cost = inner.cost;
        cuts.blocks = inner.blocks;
    }
    return cuts;
}

// How many of c wide subtrees are least expensive on the left, with what they cost, and their blocks. The loops are unrolled, so that no array is indexed.
#define SPLIT(c)                                                                 \
    [[unroll]] for (uint k = 1u; k < c; k++) {                                   \
        float cost = left.cost[k - 1u] + right.cost[c - k - 1u];                 \
        if (k == 1u || cost < least) {                                           \
            least = cost;                                                        \
            choice = k;                                                          \
            blocks = left.blocks[k - 1u] + right.blocks[c - k - 1u];             \
        }                                                                        \
    }

// At most c subtrees: c - 1 are as good where c cost no less.
#define CUT(c)                                                                   \
    {                                                                            \
        SPLIT(c)                                                                 \
        bool pays = least < inner.cost[c - 2u];                                  \
        inner.cost[c - 1u] = pays ? least : inner.cost[c - 2u];                  \
        inner.blocks[c - 1u] = pays ? blocks : inner.blocks[c - 2u];             \
        node.choices |= pays ? choice << 3u * (c - 1u) : 0u;                     \
    }

// Makes a node of two, and returns its height.
uint join(BuildParams p, uint a, uint b, uint id) {
    BuildNodes nodes = BuildNodes(p.nodes);
    BuildNode of_left = nodes.v[a], of_right = nodes.v[b], node;
    Cuts left = cuts_of(p, a, of_left), right = cuts_of(p, b, of_right);
    node.min = min(of_left.min, of_right.min);
    node.max = max(of_left.max, of_right.max);
    BuildInner inner;
    inner.children = uint[2](a, b);
    float least;
    uint choice, blocks;
    SPLIT(7u)
    inner.cost[0] = half_area(node.min, node.max, p.scale) + least;
    inner.blocks[0] = 1u + blocks;
    node.choices = choice;
    CUT(2u)
    CUT(3u)
    CUT(4u)
    CUT(5u)
    CUT(6u)
    CUT(7u)
    node.blocks = inner.blocks[0];
    uint height = max(of_left.choices >> HEIGHT_SHIFT, of_right.choices >> HEIGHT_SHIFT) + 1u;
    node.choices |= height << HEIGHT_SHIFT;
    nodes.v[id] = node;
    BuildInners(p.inners).v[id - p.count] = inner;
    return height;
}

shared uint height;

void main() {
    BuildParams p = BuildParams(push.pass);
    uint round_ = push.first, lane = gl_LocalInvocationIndex;
    uint count = BuildSteps(p.steps).v[FIRST_ROUND + round_].count, tiles = tile_count(count, CLUSTER_TILE), tile = own_tile();
    if (tile >= tiles) return;
    BuildPairs from = BuildPairs(p.pairs[round_ & 1u]), to = BuildPairs(p.pairs[~round_ & 1u]);
    uint own = tile * CLUSTER_TILE + lane;
    uvec2 cluster = lane < CLUSTER_TILE && own < count ? from.v[own] : uvec2(ABSORBED, 0u);
    bool is_kept = cluster.x != ABSORBED, merges = is_kept && cluster.x != ALONE;
    if (lane == 0u) height = 0u;
    // both counts in one sum
    uint total, before = scan_lanes((is_kept ? 1u : 0u) | (merges ? 0x10000u : 0u), total);
    if (is_kept) {
        BuildCounts counts = BuildCounts(p.counts);
        uint id = cluster.y;
        if (merges) {
            // each merger before has made one cluster less, and a node
            id = 2u * p.count - count + counts.v[tiles + tile] - counts.v[tiles] + (before >> 16);
            atomicMax(height, join(p, cluster.y, from.v[cluster.x].y, id));
        }
        to.v[counts.v[tile] + (before & 0xffffu)] = uvec2(0u, id);
    }
    barrier();
    if (lane == 0u) atomicMax(BuildState(p.state).height, height);
}
