// Reductions over the lanes of a subgroup of 8 or 16. Constant broadcasts are one instruction on a CPU driver; the built-in reductions, ballots, shuffles of more than eight
// lanes and quad swaps are loops there.
#ifndef TRACE_REDUCE
#define TRACE_REDUCE

#define REDUCE_8(op, k)                                                                                                             \
    r = op(op(op(r, subgroupBroadcast(x, k)), op(subgroupBroadcast(x, k + 1), subgroupBroadcast(x, k + 2))),                        \
            op(op(subgroupBroadcast(x, k + 3), subgroupBroadcast(x, k + 4)),                                                        \
                    op(subgroupBroadcast(x, k + 5), op(subgroupBroadcast(x, k + 6), subgroupBroadcast(x, k + 7)))));
#define REDUCE(op)                          \
    uint r = x;                             \
    REDUCE_8(op, 0)                         \
    if (SUBGROUP_SIZE > 8u) { REDUCE_8(op, 8) }  \
    return r;

uint bitwise_or(uint a, uint b) { return a | b; }

// The bitwise or over all lanes.
uint or_over_lanes(uint x) { REDUCE(bitwise_or) }

// The minimum over all lanes.
uint min_over_lanes(uint x) { REDUCE(min) }

#endif
