// The fast kernels' stack of sibling groups: the top is in registers, the rest in arrays. A CPU driver writes to an array
// element by element, about ninety instructions; shifting all of the registers takes one each.
#ifndef TRACE_STACK
#define TRACE_STACK
#include "interface/hierarchy.glsl"

// STACK_SIZE is the maximum that the scene's trees need beyond those: a node visit pushes at most the rest of one sibling
// group; entering a TLAS instance pushes that and the return to the top level. The host computes it.

#define DECLARE_STACK                                                                         \
    uint top_base[STACK_IN_REGISTERS], top_group[STACK_IN_REGISTERS];                         \
    uint spilled_base[STACK_SIZE + 1u], spilled_group[STACK_SIZE + 1u];                       \
    [[unroll]] for (uint s = 0u; s < STACK_IN_REGISTERS; s++) {                               \
        top_base[s] = 0u;                                                                     \
        top_group[s] = 0u;                                                                    \
    }                                                                                         \
    uint depth = 0u;

#define PUSH(b, g)                                                                            \
    if (STACK_SIZE > 0u) {                                                                    \
        if (depth >= STACK_IN_REGISTERS) {                                                    \
            spilled_base[depth - STACK_IN_REGISTERS] = top_base[STACK_IN_REGISTERS - 1u];     \
            spilled_group[depth - STACK_IN_REGISTERS] = top_group[STACK_IN_REGISTERS - 1u];   \
        }                                                                                     \
    }                                                                                         \
    [[unroll]] for (uint s = STACK_IN_REGISTERS - 1u; s > 0u; s--) {                          \
        top_base[s] = top_base[s - 1u];                                                       \
        top_group[s] = top_group[s - 1u];                                                     \
    }                                                                                         \
    top_base[0] = (b);                                                                        \
    top_group[0] = (g);                                                                       \
    depth++;

#define POP(b, g)                                                                             \
    b = top_base[0];                                                                          \
    g = top_group[0];                                                                         \
    [[unroll]] for (uint s = 0u; s < STACK_IN_REGISTERS - 1u; s++) {                          \
        top_base[s] = top_base[s + 1u];                                                       \
        top_group[s] = top_group[s + 1u];                                                     \
    }                                                                                         \
    depth--;                                                                                  \
    if (STACK_SIZE > 0u) {                                                                    \
        if (depth >= STACK_IN_REGISTERS) {                                                    \
            top_base[STACK_IN_REGISTERS - 1u] = spilled_base[depth - STACK_IN_REGISTERS];     \
            top_group[STACK_IN_REGISTERS - 1u] = spilled_group[depth - STACK_IN_REGISTERS];   \
        }                                                                                     \
    }

#endif
