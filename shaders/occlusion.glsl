// occlusion: traces the rays that `primary` left in the queue, and stores what each sample adds to its pixel. Compiled twice: with a falloff the
// nearest hit counts by its distance, without one any hit is enough.
#include "ao/params.glsl"
#include "ao/sample.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Samples { float v[]; };

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

// The tag of a ray is the index of its sample in the launch.
void add_sample(uint index, float occlusion) {
    AoParams p = ao_params();
    Samples(p.samples).v[Words(p.queue.tags).v[index]] = 1.0 - occlusion;
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    add_sample(index, occluded ? 1.0 : 0.0);
}
#else
void closest(uint index, Hit hit) {
    add_sample(index, occlusion_of(ao_params().occlusion.falloff_log2, hit));
}
#endif
