// Primitive records of the readable kernels: 40 bytes, five pairs. A triangle: three corners and a number; a sphere: centre,
// radius and a number. The numbers are those of the fast kernels too.
#ifndef TRACE_RECORDS
#define TRACE_RECORDS

// Flags above the primitive's number in its group.
const uint ALPHA_TESTED = 0x80000000u;
const uint SPHERE = 0x40000000u;
const uint NUMBER = 0x3fffffffu;

// On a CPU driver a divergent load is one gather, of 32 or of 64 bits alike: load pairs where 64-bit integers exist.
#ifdef LOAD64
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Words64 { uint64_t v[]; };
#define LOAD_PAIR(base, i) unpackUint2x32(Words64(base).v[i])
#else
#define LOAD_PAIR(base, i) Pairs(base).v[i]
#endif

#endif
