// The slab test, shared by both kinds of BVH.
#ifndef TRACE_SLAB
#define TRACE_SLAB

// Slabs are widened by 16 half-ulps: Ize, "Robust BVH Ray Traversal" (JCGT 2013) needs 2 * gamma(3) for its own rounding;
// the rest covers the rounding of the sheared triangle test, so that a ray which that test sends into a triangle is never
// kept out of the triangle's box.
const float SLAB_SCALE = 1.0 + 16.0 * 5.9604645e-8;

// Minimum and maximum of floats by their bits: one instruction, where NaN-safe ones take three on a CPU driver. Right for the
// slab test because tmin >= 0: among negative numbers the wrong one may win, but then the interval is empty either way.
#define MIN(a, b) intBitsToFloat(min(floatBitsToInt(a), floatBitsToInt(b)))
#define MAX(a, b) intBitsToFloat(max(floatBitsToInt(a), floatBitsToInt(b)))

// Finite even where the ray runs along a slab, so that no 0 * inf = NaN arises. The host pads the boxes: a ray in the plane of
// flat geometry is strictly inside the slab, and lo < 0 < hi times a huge number lets it pass.
vec3 safe_inverse(vec3 d) {
    vec3 a = abs(d);
    float least = max(1e-20 * max(max(a.x, a.y), a.z), 1e-37);
    return 1.0 / mix(d, mix(vec3(least), vec3(-least), lessThan(d, vec3(0.0))), lessThan(a, vec3(least)));
}

#endif
