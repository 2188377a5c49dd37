// occlusion: traces the rays that `primary` left in the queue, and stores what each sample adds to its pixel. Compiled twice: with a falloff the
// nearest hit counts by its distance, without one any hit is enough.
#include "ao/params.glsl"
#include "ao/sample.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Samples { float v[]; };

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

// The tag of a ray is the index of its sample in the launch. A ground that catches shadows is black where it is occluded, and else not there.
void add_sample(uint index, bool occluded, float occlusion) {
    AoParams p = ao_params();
    uint at = Words(p.queue.tags).v[index];
    float visibility = 1.0 - occlusion;
    if (HAS_CATCHER && (at & CAUGHT) != 0u) {
        at &= ~CAUGHT;
        visibility = occluded ? 0.0 : CAUGHT_UNOCCLUDED;
    }
    Samples(p.samples).v[at] = visibility;
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded, occluded ? 1.0 : 0.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, is_hit(hit), occlusion_of(ao_params().occlusion.falloff_log2, hit));
}
#endif
