// Rays that are suspended where a driver leaves any loop after a number of iterations, of all loops of an invocation together: a ray that passes very many surfaces needs more. A lane
// whose loop is about to end stores its ray here, with all that traversal knows of it, and another launch resumes it. Macros, because a stack of arrays is no argument: they are about the variables of `wide.glsl`.
#ifndef TRACE_SUSPEND
#define TRACE_SUSPEND
#include "interface/hierarchy.glsl"
#include "trace/launch.glsl"
#include "trace/spread.glsl"
#include "trace/stack.glsl"

// The iteration in which a ray is suspended (`resumptions` in src/tracer/lane_budget.rs). Loops of alpha tests count, too.
const uint SUSPEND_ITERATION = 2u * MAX_ITERATIONS - (MAX_ITERATIONS >> 3);

const uint SUSPENDED_STRIDE = SUSPENDED_WORDS + 2u * (STACK_IN_REGISTERS + STACK_SIZE + 1u);

// Rays that a work-group resumes at most: as many as the widest vectors of processors have lanes.
const uint RESUMED_LANES = 16u;
// The number of work-groups that resume rays is a multiple of this, so that all threads of a processor have as many.
const uint RESUMED_GROUPS = 4u;

#define SUSPENDED_WORD(k) LaunchFlags(suspended).v[state + (k)]

// The place of a ray that is suspended for the first time. Beyond the last it is not stored, and stays unfinished.
uint suspend_new(uvec2 suspended) {
    uint place = atomicAdd(LaunchFlags(suspended).v[0], 1u);
    if (place < SUSPENDED_RAYS) atomicMax(LaunchFlags(suspended).v[1], (place / (RESUMED_LANES * RESUMED_GROUPS) + 1u) * RESUMED_GROUPS);
    return place;
}

// The place of the ray that an invocation resumes, or none. Each work-group has its share of them.
uint resumed_place() {
    return gl_LocalInvocationID.x < RESUMED_LANES ? gl_LocalInvocationID.x * gl_NumWorkGroups.x + part_of_dispatch() : INVALID;
}

#define STORE_SUSPENDED                                                                        \
    SUSPENDED_WORD(0u) = index;                                                                \
    SUSPENDED_WORD(1u) = block;                                                                \
    SUSPENDED_WORD(2u) = base;                                                                 \
    SUSPENDED_WORD(3u) = group;                                                                \
    SUSPENDED_WORD(4u) = depth;                                                                \
    SUSPENDED_WORD(5u) = entry_depth;                                                          \
    SUSPENDED_WORD(6u) = at_top;                                                               \
    SUSPENDED_WORD(7u) = instance;                                                             \
    SUSPENDED_WORD(8u) = floatBitsToUint(best);                                                \
    SUSPENDED_WORD(9u) = best_instance;                                                        \
    SUSPENDED_WORD(10u) = best_primitive;                                                      \
    SUSPENDED_WORD(11u) = floatBitsToUint(best_uv.x);                                          \
    SUSPENDED_WORD(12u) = floatBitsToUint(best_uv.y);                                          \
    for (uint k = 0u; k < 3u; k++) {                                                           \
        SUSPENDED_WORD(13u + k) = floatBitsToUint(origin[k]);                                  \
        SUSPENDED_WORD(16u + k) = floatBitsToUint(direction[k]);                               \
    }                                                                                          \
    [[unroll]] for (uint k = 0u; k < STACK_IN_REGISTERS; k++) {                                \
        SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k) = top_base[k];                                \
        SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k + 1u) = top_group[k];                          \
    }                                                                                          \
    for (uint k = STACK_IN_REGISTERS; k < depth; k++) {                                        \
        SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k) = spilled_base[k - STACK_IN_REGISTERS];       \
        SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k + 1u) = spilled_group[k - STACK_IN_REGISTERS]; \
    }

#define LOAD_SUSPENDED                                                                         \
    index = SUSPENDED_WORD(0u);                                                                \
    SUSPENDED_WORD(0u) = INVALID; /* unless it is suspended again */                           \
    world = take_ray(index);                                                                   \
    block = SUSPENDED_WORD(1u);                                                                \
    base = SUSPENDED_WORD(2u);                                                                 \
    group = SUSPENDED_WORD(3u);                                                                \
    depth = SUSPENDED_WORD(4u);                                                                \
    entry_depth = SUSPENDED_WORD(5u);                                                          \
    at_top = SUSPENDED_WORD(6u);                                                               \
    instance = SUSPENDED_WORD(7u);                                                             \
    best = uintBitsToFloat(SUSPENDED_WORD(8u));                                                \
    best_instance = SUSPENDED_WORD(9u);                                                        \
    best_primitive = SUSPENDED_WORD(10u);                                                      \
    best_uv = uintBitsToFloat(uvec2(SUSPENDED_WORD(11u), SUSPENDED_WORD(12u)));                \
    SET_RAY(uintBitsToFloat(uvec3(SUSPENDED_WORD(13u), SUSPENDED_WORD(14u), SUSPENDED_WORD(15u))),  \
            uintBitsToFloat(uvec3(SUSPENDED_WORD(16u), SUSPENDED_WORD(17u), SUSPENDED_WORD(18u))))  \
    [[unroll]] for (uint k = 0u; k < STACK_IN_REGISTERS; k++) {                                \
        top_base[k] = SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k);                                \
        top_group[k] = SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k + 1u);                          \
    }                                                                                          \
    for (uint k = STACK_IN_REGISTERS; k < depth; k++) {                                        \
        spilled_base[k - STACK_IN_REGISTERS] = SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k);       \
        spilled_group[k - STACK_IN_REGISTERS] = SUSPENDED_WORD(SUSPENDED_WORDS + 2u * k + 1u); \
    }

#endif
