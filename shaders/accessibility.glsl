// accessibility: the rays that `spawn` left in the queue. Built twice: with a falloff the nearest hit counts by its distance, without
// one any hit will do.
// stream: any closest
// rays: queue
#include "common/frame.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

// The tag of a ray is its pixel, or its place among the samples of the launch.
void add_sample(uint index, float accessibility) {
    FrameParams f = FrameParams(push.pass);
    uint tag = Words(f.queue.tags).v[index];
    if (f.rays_per_pixel > 1u) {
        FloatImage(f.samples).v[tag] = accessibility;
        return;
    }
    STORE_PAIR(f.current, tag, pack_estimate(Estimate(accessibility, 1.0, 0.0)));
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 0.0 : 1.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, is_hit(hit) ? 1.0 - exp2(-hit.t * FrameParams(push.pass).falloff_log2) : 1.0);
}
#endif
