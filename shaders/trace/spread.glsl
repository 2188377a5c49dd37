// How a stream's work is divided among work-groups. CPU drivers give each thread an equal range of consecutive work-groups: where the work lies at
// one end, as it does in a queue that is not full, all others would be idle. So runs of work-groups that follow each other take runs of parts that are
// SPREAD runs apart. The host dispatches runs along x, one after the other along y, SPREAD of those along z.
#ifndef TRACE_SPREAD
#define TRACE_SPREAD

// Which part of a dispatch a work-group does.
uint part_of_dispatch() {
    return gl_WorkGroupID.x + gl_NumWorkGroups.x * (gl_WorkGroupID.z + SPREAD * gl_WorkGroupID.y);
}

// Which ray of a launch an invocation traces.
uint ray_of_dispatch() {
    return part_of_dispatch() * LANES + gl_LocalInvocationID.x;
}

#endif
