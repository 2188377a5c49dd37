// primary: camera rays, jittered within their pixels; where one meets the scene, the occlusion rays that leave from there are appended to
// the queue, one for each sample that shares the camera ray (ao/sample.glsl). A sample without a hit has no further cost.
#include "ao/hemisphere.glsl"
#include "ao/params.glsl"
#include "ao/sample.glsl"
#include "common/entry_points.glsl"
#include "common/pixel_filter.glsl"
#include "common/warp.glsl"
#include "trace/block.glsl"

#ifdef PACKET_RAYS
// What the packet kernel does for this stream (trace/packet.glsl): it starts at entry points, passes hits on with its own ids, and claims the places of occlusion rays in the
// queue for all hits of a packet together.
#define HAS_ENTRY_POINTS
#define TAKES_TRACER_HITS
#define APPENDS_RAYS_PER_HIT (1u << push.shared_bits)

// Address of the list for the packet of rays that begins at an index, or null: the root. A packet has a list if its pixels are in one bundle. The host writes no lists for
// launches of so few samples that none is.
uvec2 entry_list(uint index) {
    uvec2 lists = ao_params().entry_points;
    bool has_list = !is_null(lists) && bundle_of(index) == bundle_of(index + SUBGROUP_SIZE * PACKET_RAYS - 1u);
    return has_list ? offset_address(lists, (bundle_of(index) - first_bundle()) * ENTRY_LIST_BYTES) : uvec2(0u);
}

uvec2 queue_counter() { return ao_params().queue.count; }

// The first of the places in the queue of the rays that the next hit adds.
uint claimed_slot = 0u;
#endif

// Of the samples of a pixel that share a camera ray, the first. Both indices are those of the block.
uint first_sample(uint index) {
    return push.sample_index + ((index & ((1u << push.sample_bits) - 1u)) << push.shared_bits);
}

Ray camera_sample(BlockParams p, uint index) {
    uvec2 pixel = block_pixel(p, pixel_index(index));
    if (!in_block(p, pixel)) return no_ray();
    pixel += p.block_origin;
    vec2 u = sample_2d(p.seed, pixel, first_sample(index) >> ao_params().camera_shift, CAMERA_FILM);
    if (p.pixel_filter != FILTER_BOX) u = 0.5 + filter_offset(p.pixel_filter, u);
    return camera_ray(p, vec2(pixel) + u);
}

Ray ray(uint index) {
    BlockParams p = BlockParams(push.pass);
    Ray r = camera_sample(p, index);
    dump_ray(ao_params().ray_dump, index, r);
    return r;
}

void closest(uint index, Hit hit) {
    BlockParams p = BlockParams(push.pass);
    AoParams ao = ao_params();
    bool about_ns = ao.occlusion.hemisphere != 0u;
    if (!is_hit(hit)) {
        dump_ray(ao.occlusion_dump, index, no_ray());
        return;
    }
    Surface s;
#ifdef TAKES_TRACER_HITS
    // A geometric normal that is turned to the viewer follows from the corners alone, unless the surface is seen exactly from the side.
    bool needs_submesh = !SINGLE_LEVEL || HAS_SPHERES || about_ns || HAS_CATCHER;
    if (!needs_submesh) {
        s = surface_of_corners(hit);
        needs_submesh = !(abs(dot(s.ng, view_direction(p, s.position))) > 0.0);
    }
    if (needs_submesh) {
        hit = scene_hit(hit.t, hit.instance, hit.primitive, vec2(hit.u, hit.v));
#else
    {
#endif
        // the point on a triangle follows from its corners; only a sphere needs the ray again
        s = surface_at(HAS_SPHERES ? camera_sample(p, index) : no_ray(), hit);
    }
    Hemisphere h = hemisphere_at(p, s, about_ns);
    uvec2 pixel = block_pixel(p, pixel_index(index)) + p.block_origin;
    uint first = first_sample(index), tag = (index - push.first) << push.shared_bits;
    // what a ground occludes is not seen: its samples say whether it is occluded (occlusion.glsl)
    bool is_caught = false;
    if (HAS_CATCHER) is_caught = load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh).material == ao.catcher;
    if (is_caught) tag |= CAUGHT;
    for (uint k = 0u; k < 1u << push.shared_bits; k++) {
        vec3 w = to_world(h.axis, cosine_hemisphere(sample_2d(p.seed, pixel, first + k, AO_DIRECTION)));
        float reach = ao.occlusion.reach;
        if (HAS_CATCHER && is_caught) reach = random_reach(ao.occlusion, sample_2d(p.seed, pixel, first + k, AO_LENGTH).x);
        Ray r = occlusion_ray(s.position, s.offset, h.ng, w, reach);
        // rays are kept of launches in which no samples share a camera ray
        dump_ray(ao.occlusion_dump, index, r);
#ifdef APPENDS_RAYS_PER_HIT
        store_in_queue(ao.queue, claimed_slot + k, r, tag + k);
#else
        append_ray(ao.queue, r, tag + k);
#endif
    }
}
