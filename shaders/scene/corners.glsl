// Positions of a hit triangle's corners in its group, in the mesh's order. A kernel that defines KEEPS_CORNERS sets them before it delivers a hit: it had them at hand
// when it found the hit, while reading them from the mesh takes twelve gathers.
#ifndef SCENE_CORNERS
#define SCENE_CORNERS
#include "scene/material.glsl"

struct Corners {
    vec3 p[3];
};

#ifdef KEEPS_CORNERS
Corners hit_corners;

vec3 pick_corner(vec3 p0, vec3 p1, vec3 p2, uint k) {
    return k == 0u ? p0 : k == 1u ? p1 : p2;
}

Corners corners_of_hit(SubmeshRecord submesh, uint primitive) { return hit_corners; }
#else
Corners corners_of_hit(SubmeshRecord submesh, uint primitive) {
    uvec3 k = triangle_indices(submesh, primitive);
    return Corners(vec3[3](load_vec3(submesh.positions, k.x), load_vec3(submesh.positions, k.y), load_vec3(submesh.positions, k.z)));
}
#endif

#endif
