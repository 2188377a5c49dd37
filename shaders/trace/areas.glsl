// Influence areas of the binary kernels: which of them a ray starts in, and where it leaves it (Falcone 2024, chapter 5;
// docs/design/bvh.md). The host makes them a little larger, and their trees larger still: what rounding does here never
// takes a ray out of the space over which the area's tree is complete. See src/tracer/local_trees.rs.
#ifndef TRACE_AREAS
#define TRACE_AREAS
#include "interface/hierarchy.glsl"

// Whether a ray starts in an area and agrees with its rays, forwards or backwards.
bool is_affine(AreaRecord area, vec3 origin, vec3 direction) {
    if (any(lessThan(origin, area.bounds_min.xyz)) || any(greaterThan(origin, area.bounds_max.xyz))) return false;
    for (uint k = 0u; k < 6u; k++) {
        if (dot(area.planes[k].xyz, origin) > area.planes[k].w) return false;
    }
    vec3 along = area.rays.w * origin - area.rays.xyz;
    float squared = dot(along, along);
    float cosine = dot(along, direction);
    // a ray that starts where the area's rays meet has any direction
    bool is_at_point = area.rays.w != 0.0 && squared <= area.bounds_max.w;
    return is_at_point || cosine * cosine >= area.bounds_min.w * squared * dot(direction, direction);
}

// The first area that a ray is affine to; INVALID: none.
uint area_of(AreasRecord areas, vec3 origin, vec3 direction) {
    uint first = 0u, count = areas.count;
    bool has_cells = !is_null(areas.cells);
    if (has_cells) {
        // the octree's cell around the origin
        vec3 lo = areas.bounds_min.xyz, hi = areas.bounds_max.xyz;
        if (any(lessThan(origin, lo)) || any(greaterThan(origin, hi))) return INVALID;
        uvec2 cell = LOAD_PAIR(areas.cells, 0u);
        while ((cell.x & DIVIDED) != 0u) {
            vec3 middle = lo * 0.5 + hi * 0.5;
            bvec3 upper = greaterThan(origin, middle);
            lo = mix(lo, middle, upper);
            hi = mix(middle, hi, upper);
            uint part = uint(upper.x) | uint(upper.y) << 1 | uint(upper.z) << 2;
            cell = LOAD_PAIR(areas.cells, (cell.x & ~DIVIDED) + part);
        }
        first = cell.x;
        count = cell.y;
    }
    AreaRecords records = AreaRecords(areas.areas);
    for (uint k = first; k < first + count; k++) {
        uint number = has_cells ? Words(areas.members).v[k] : k;
        if (is_affine(records.v[number], origin, direction)) return number;
    }
    return INVALID;
}

// The parameter at which a ray that starts in an area leaves it.
float leave_area(AreaRecord area, vec3 origin, vec3 direction) {
    float until = INFINITY;
    for (uint k = 0u; k < 6u; k++) {
        float along = dot(area.planes[k].xyz, direction);
        if (along > 0.0) until = min(until, (area.planes[k].w - dot(area.planes[k].xyz, origin)) / along);
    }
    return until;
}

#endif
