// What the passes of the builder on the device share (src/tracer/device_builder.rs). A work-group has one tile of keys or clusters. None of them assumes a
// subgroup size, or that work-groups make progress while another one waits.
#ifndef BVH_BUILDER
#define BVH_BUILDER
#include "common/types.glsl"
#include "interface/builder.glsl"

layout(local_size_x = BUILD_LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 8) buffer BuildPairs { uvec2 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) coherent buffer BuildCounts { uint v[]; };

const uint SORT_TILE = BUILD_LANES * SORT_KEYS;

uint tile_count(uint items, uint size) { return items / size + (items % size == 0u ? 0u : 1u); }

// The tile of this work-group, and the work-groups that a number of tiles takes.
uint own_tile() { return gl_WorkGroupID.y * MAX_GROUPS_X + gl_WorkGroupID.x; }
uint[3] tile_groups(uint tiles) { return uint[3](min(tiles, MAX_GROUPS_X), tile_count(tiles, MAX_GROUPS_X), 1u); }

// Half of the surface area of a box, in units of the scene.
float half_area(vec3 low, vec3 high, float scale) {
    vec3 d = (high - low) * scale;
    return d.x * d.y + d.y * d.z + d.z * d.x;
}

// What bvh_nearest leaves beside a cluster for bvh_merge: the one it is merged with, or that it stays alone, or that another one takes it in.
const uint ALONE = INVALID;
const uint ABSORBED = INVALID - 1u;

#endif
