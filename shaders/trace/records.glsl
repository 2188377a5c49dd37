// Primitive records of the readable kernels: 40 bytes, five pairs. A triangle: three corners and a number; a sphere: centre,
// radius and a number. The numbers are those of the fast kernels too.
#ifndef TRACE_RECORDS
#define TRACE_RECORDS

// Flags above the primitive's number in its group.
const uint ALPHA_TESTED = 0x80000000u;
const uint SPHERE = 0x40000000u;
const uint NUMBER = 0x3fffffffu;

#endif
