// How the fast kernels' work is divided among work-groups.
#ifndef TRACE_SPREAD
#define TRACE_SPREAD

// Which part of a dispatch a work-group does. CPU drivers give each thread an equal range of consecutive work-groups: where the work lies at
// one end, as it does in a queue that is not full, all others would be idle. So consecutive work-groups take parts that are SPREAD
// apart. The host dispatches a multiple of SPREAD.
uint part_of_dispatch() {
    uint rows = gl_NumWorkGroups.x / SPREAD;
    return gl_WorkGroupID.x % rows * SPREAD + gl_WorkGroupID.x / rows;
}

#endif
