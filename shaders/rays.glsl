// rays: traces a set of rays from memory; writes a hit record for each, or whether it is occluded.
#include "common/types.glsl"
#include "interface/ray_set.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Results { uint v[]; };

Ray ray(uint index) {
    return load_ray(RaySet(push.pass).rays, index);
}

#ifdef STREAM_ANY
void any(uint index, bool occluded) {
    Results(RaySet(push.pass).results).v[index] = occluded ? 1u : 0u;
}
#else
void closest(uint index, Hit hit) {
    Results r = Results(RaySet(push.pass).results);
    r.v[5u * index] = floatBitsToUint(hit.t);
    r.v[5u * index + 1u] = hit.instance;
    r.v[5u * index + 2u] = hit.primitive;
    r.v[5u * index + 3u] = floatBitsToUint(hit.u);
    r.v[5u * index + 4u] = floatBitsToUint(hit.v);
}
#endif
