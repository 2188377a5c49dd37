// A lane's ray against the primitives of a leaf, whose words are w0 to w7, as text for kernels in which each lane has a ray of its own (wide.glsl, few.glsl). `mine` has all bits for
// lanes that have a leaf, and none for others. A kernel defines ACCEPT(id), which stores a hit of a sphere, and ACCEPT_TRIANGLE(id, turn, p0, p1, p2) for one of a triangle with its
// corners, of which `turn` has the positions of the second and third in the mesh's order.
if (HAS_SPHERES && (FIRST_ID & SPHERE) != 0u) {
    vec3 center = uintBitsToFloat(SPHERE_LEAF_CENTER(uvec3) & mine);
    if (meets_sphere(origin, direction, center, uintBitsToFloat(SPHERE_LEAF_RADIUS & mine), world.tmin, best, t, uv)) { ACCEPT(FIRST_ID) }
} else {
    vec3 v0 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_0(uvec3) & mine), v1 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_1(uvec3) & mine);
    vec3 v2 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_2(uvec3) & mine), v3 = uintBitsToFloat(TRIANGLE_LEAF_CORNERS_3(uvec3) & mine);
    if (WATERTIGHT) {
        Corner a = make_corner(shear, origin, v0), b = make_corner(shear, origin, v1);
        Corner c = make_corner(shear, origin, v2), d = make_corner(shear, origin, v3);
        float ab = edge(b, a), bc = edge(c, b), ca = edge(a, c), cd = edge(d, c), da = edge(a, d);
        vec3 first = vec3(bc, ca, ab), second = vec3(cd, da, -ca);
        if (is_inside(first)) {
            if (meets_triangle(FIRST_ID, ORDER, instance, shear, origin, direction, v0, v1, v2, a, b, c, first, world.tmin, best, t, uv)) { ACCEPT_TRIANGLE(FIRST_ID, ORDER, v0, v1, v2) }
        }
        if (is_inside(second) && SECOND_ID != INVALID) {
            if (meets_triangle(SECOND_ID, ORDER >> 4, instance, shear, origin, direction, v0, v2, v3, a, c, d, second, world.tmin, best, t, uv)) { ACCEPT_TRIANGLE(SECOND_ID, ORDER >> 4, v0, v2, v3) }
        }
    } else {
        if (meets_moller_trumbore(FIRST_ID, ORDER, instance, origin, direction, v0, v1, v2, world.tmin, best, t, uv)) { ACCEPT_TRIANGLE(FIRST_ID, ORDER, v0, v1, v2) }
        if (meets_moller_trumbore(SECOND_ID, ORDER >> 4, instance, origin, direction, v0, v2, v3, world.tmin, best, t, uv)) { ACCEPT_TRIANGLE(SECOND_ID, ORDER >> 4, v0, v2, v3) }
    }
}
