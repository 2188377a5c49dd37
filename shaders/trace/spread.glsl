// Distribution of a stream's work over work-groups. CPU drivers give each thread an equal range of consecutive work-groups. Where the work is at
// one end, as in a queue that is not full, all other threads would be idle. So consecutive runs of work-groups get runs of parts that are
// SPREAD runs apart. The host dispatches the work-groups of a run along x, runs along y, and SPREAD of those along z.
#ifndef TRACE_SPREAD
#define TRACE_SPREAD

// The part of a dispatch that a work-group processes.
uint part_of_dispatch() {
    return gl_WorkGroupID.x + gl_NumWorkGroups.x * (gl_WorkGroupID.z + SPREAD * gl_WorkGroupID.y);
}

// The ray of a launch that an invocation traces.
uint ray_of_dispatch() {
    return part_of_dispatch() * LANES + gl_LocalInvocationID.x;
}

#endif
