// A queue of rays in device memory (src/tracer/queue.rs): one pass appends rays, a later stream traces them, and their number never
// reaches the host (Laine, Karras, Aila, "Megakernels Considered Harmful: Wavefront Path Tracing on GPUs", HPG 2013).
//
// The order of the rays differs from run to run. A stream over a queue must therefore store a result by the tag of its ray,
// once per tag: then the result does not depend on that order.
#ifndef COMMON_QUEUE
#define COMMON_QUEUE
#include "common/ray_seed.glsl"
#include "common/types.glsl"
#include "interface/queue.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) buffer QueueCount { uint v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer QueueTags { uint v[]; };

// Returns a distinct number for each active lane, counting up at an address.
uint claim(uvec2 counter) {
#ifdef BALLOT
    // one atomic for all lanes, because a CPU driver locks the bus for each
    uvec4 lanes = subgroupBallot(true);
    uint first = 0u;
    // subgroupElect() would be one more loop over lanes
    if (gl_SubgroupInvocationID == subgroupBallotFindLSB(lanes)) first = atomicAdd(QueueCount(counter).v[0], subgroupBallotBitCount(lanes));
    return subgroupBroadcastFirst(first) + subgroupBallotExclusiveBitCount(lanes);
#else
    return atomicAdd(QueueCount(counter).v[0], 1u);
#endif
}

// Seed of the next ray that is appended (common/ray_seed.glsl); 0 for rays without one.
uint next_ray_seed = 0u;

// Stores a ray and its tag in a place that is claimed already.
void store_in_queue(QueueRecord queue, uint slot, Ray ray, uint tag) {
    store_ray(queue.rays, slot, ray);
    QueueTags(queue.tags).v[slot] = tag;
}

// Returns the index of the ray in the queue, with which a stream over the queue calls ray().
uint append_ray(QueueRecord queue, Ray ray, uint tag) {
    uint slot = claim(queue.count);
    if (next_ray_seed != 0u) {
        ray.tmin = tmin_of_seed(next_ray_seed);
        next_ray_seed = hash(next_ray_seed);
    }
    store_in_queue(queue, slot, ray, tag);
    return slot;
}

#endif
