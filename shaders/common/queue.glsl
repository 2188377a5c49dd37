// A queue of rays in device memory (src/tracer/queue.rs): what one pass appends, a later stream traces without the host ever
// knowing how many there are (Laine, Karras, Aila, "Megakernels Considered Harmful: Wavefront Path Tracing on GPUs", HPG 2013).
//
// The order in which rays arrive differs from run to run. A stream over a queue must therefore write to a place that the ray's
// tag names, once per tag: then its result does not depend on that order.
#ifndef COMMON_QUEUE
#define COMMON_QUEUE
#include "common/ray_seed.glsl"
#include "common/types.glsl"
#include "interface/queue.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) buffer QueueCount { uint v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer QueueTags { uint v[]; };

// A number for each lane that asks, counting up at an address.
uint claim(uvec2 counter) {
#ifdef BALLOT
    // one atomic for all lanes: on a CPU driver the bus is locked as often as it counts
    uvec4 lanes = subgroupBallot(true);
    uint first = 0u;
    if (subgroupElect()) first = atomicAdd(QueueCount(counter).v[0], subgroupBallotBitCount(lanes));
    return subgroupBroadcastFirst(first) + subgroupBallotExclusiveBitCount(lanes);
#else
    return atomicAdd(QueueCount(counter).v[0], 1u);
#endif
}

// Seed of the next ray that is appended (common/ray_seed.glsl); 0: rays have none.
uint next_ray_seed = 0u;

// Returns the ray's place in the queue: the index with which a stream over the queue will be called.
uint append_ray(QueueRecord queue, Ray ray, uint tag) {
    uint slot = claim(queue.count);
    if (next_ray_seed != 0u) {
        ray.tmin = tmin_of_seed(next_ray_seed);
        next_ray_seed = hash(next_ray_seed);
    }
    store_ray(queue.rays, slot, ray);
    QueueTags(queue.tags).v[slot] = tag;
    return slot;
}

#endif
