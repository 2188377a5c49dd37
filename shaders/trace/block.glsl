// Blocks of the wide BVH, and sibling groups of their children. A block is 64 bytes: a cache line.
#ifndef TRACE_BLOCK
#define TRACE_BLOCK
#include "common/types.glsl"
#include "interface/hierarchy.glsl"

// On a CPU driver a divergent load is one gather, of 32 or of 64 bits alike: load pairs where 64-bit integers exist.
#ifdef LOAD64
#define WORD64 uint64_t
#define PAIR(q) unpackUint2x32(q)
#else
#define WORD64 uvec2
#define PAIR(q) (q)
#endif
layout(buffer_reference, std430, buffer_reference_align = 64) readonly buffer Block8 { WORD64 q0, q1, q2, q3, q4, q5, q6, q7; };
layout(buffer_reference, std430, buffer_reference_align = 32) readonly buffer Block4 { WORD64 q0, q1, q2, q3; };

// The 64-bit sum is made once; the loads add constants to it.
uvec2 offset_address(uvec2 address, uint offset) {
    uint carry;
    uint low = uaddCarry(address.x, offset, carry);
    return uvec2(low, address.y + carry);
}

uvec2 block_address(uvec2 blocks, uint block) {
    uvec2 address = offset_address(blocks, block << 6);
    return uvec2(address.x, address.y + (block >> 26));
}

#define BYTE(w, k) ((k) == 0 ? (w).x & 0xffu : (k) == 3 ? (w).x >> 24 : (k) < 3 ? ((w).x >> ((k) * 8)) & 0xffu : (k) == 4 ? (w).y & 0xffu : ((w).y >> (((k) - 4) * 8)) & 0xffu)

// A sibling group: the uppermost byte has the children not yet visited, the first along the ray's octant in the highest bit; below it are the slots
// that hold children, whose blocks are consecutive.
const uint ROOT_GROUP = 0x80000000u;

bool has_siblings(uint group) { return group > 0x00ffffffu; }

// Permutes bits by slot to bits by rank along the octant: bit k goes to k ^ octant.
uint make_group(uint hits, uint present, uint octant) {
    hits = (octant & 1u) != 0u ? ((hits & 0x55u) << 1) | ((hits >> 1) & 0x55u) : hits;
    hits = (octant & 2u) != 0u ? ((hits & 0x33u) << 2) | ((hits >> 2) & 0x33u) : hits;
    hits = (octant & 4u) != 0u ? ((hits & 0x0fu) << 4) | (hits >> 4) : hits;
    return (hits << 24) | (present << 16);
}

#endif
