// Watertight ray against triangle: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013).
#ifndef TRACE_TRIANGLE
#define TRACE_TRIANGLE

// Without WATERTIGHT it is the test of Möller and Trumbore, for benchmarks of the cost of watertightness (docs/traversal.md).

// The ray's frame: z is the axis of the largest direction component, and the shear aligns the ray with z.
struct Shear {
    uint axis;
    vec3 s;
};

// cyclic rotation of the axes that brings the ray's main axis to z
vec3 permute(vec3 v, uint axis) {
    return axis == 0u ? v.yzx : axis == 1u ? v.zxy : v.xyz;
}

Shear make_shear(vec3 d) {
    vec3 a = abs(d);
    uint axis = a.x > a.y ? (a.x > a.z ? 0u : 2u) : (a.y > a.z ? 1u : 2u);
    vec3 p = permute(d, axis);
    return Shear(axis, vec3(p.xy / p.z, 1.0 / p.z));
}

// Likewise, with a given inverse of the direction. Any shear is watertight, as long as it is the same for all triangles.
Shear make_shear(vec3 d, vec3 inverse) {
    vec3 a = abs(d);
    uint axis = a.x > a.y ? (a.x > a.z ? 0u : 2u) : (a.y > a.z ? 1u : 2u);
    float z = permute(inverse, axis).z;
    return Shear(axis, vec3(permute(d, axis).xy * z, z));
}

// Double-word arithmetic, with numbers as unevaluated sums hi + lo: Dekker, "A floating-point technique for extending the available
// precision" (1971). The product splits its factors, because fma is not fused on every device.
struct Wide3 {
    vec3 hi;
    vec3 lo;
};

Wide3 two_difference(vec3 a, vec3 b) {
    precise vec3 s = a - b;
    precise vec3 bb = s - a;
    precise vec3 aa = s - bb;
    precise vec3 ra = a - aa;
    precise vec3 rb = b + bb;
    precise vec3 r = ra - rb;
    return Wide3(s, r);
}

Wide3 wide_sum(Wide3 a, Wide3 b) {
    precise vec3 s = a.hi + b.hi;
    precise vec3 bb = s - a.hi;
    precise vec3 aa = s - bb;
    precise vec3 ra = a.hi - aa;
    precise vec3 rb = b.hi - bb;
    precise vec3 r = ra + rb;
    precise vec3 low = a.lo + b.lo;
    precise vec3 lo = r + low;
    precise vec3 hi = s + lo;
    precise vec3 back = hi - s;
    precise vec3 rest = lo - back;
    return Wide3(hi, rest);
}

vec3 upper_half(vec3 a) {
    precise vec3 c = 4097.0 * a;
    precise vec3 d = c - a;
    precise vec3 hi = c - d;
    return hi;
}

// Rounding error of a product.
vec3 product_rest(vec3 a, vec3 b) {
    precise vec3 p = a * b;
    precise vec3 ah = upper_half(a), bh = upper_half(b);
    precise vec3 al = a - ah, bl = b - bh;
    precise vec3 e0 = ah * bh;
    precise vec3 e1 = e0 - p;
    precise vec3 e2 = e1 + ah * bl;
    precise vec3 e3 = e2 + al * bh;
    precise vec3 e4 = e3 + al * bl;
    return e4;
}

Wide3 wide_product(Wide3 a, Wide3 b) {
    precise vec3 p = a.hi * b.hi;
    precise vec3 lo = product_rest(a.hi, b.hi) + (a.hi * b.lo + a.lo * b.hi);
    return Wide3(p, lo);
}

Wide3 negated(Wide3 a) { return Wide3(-a.hi, -a.lo); }

float wide_dot(Wide3 a, Wide3 b) {
    Wide3 p = wide_product(a, b);
    Wide3 s = wide_sum(wide_sum(p, Wide3(p.hi.yzx, p.lo.yzx)), Wide3(p.hi.zxy, p.lo.zxy));
    return s.hi.x;
}

// Distance t at which the ray meets the triangle's plane; NaN or infinite for a ray within it.
float plane_distance(vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2) {
    Wide3 e1 = two_difference(v1, v0), e2 = two_difference(v2, v0);
    Wide3 normal = wide_sum(
        wide_product(Wide3(e1.hi.yzx, e1.lo.yzx), Wide3(e2.hi.zxy, e2.lo.zxy)),
        negated(wide_product(Wide3(e1.hi.zxy, e1.lo.zxy), Wide3(e2.hi.yzx, e2.lo.yzx))));
    return wide_dot(two_difference(v0, origin), normal) / wide_dot(Wide3(direction, vec3(0.0)), normal);
}

// A corner in the ray's frame: offset from the ray, and distance along its main axis.
struct Corner {
    vec2 p;
    float z;
};

Corner make_corner(Shear shear, vec3 origin, vec3 vertex) {
    precise vec3 a = permute(vertex - origin, shear.axis);
    precise vec2 p = a.xy - shear.s.xy * a.z;
    return Corner(p, a.z);
}

// Edge function: on which side of the ray the edge between two corners passes. Positive, negative, or zero; edge(p, q) = -edge(q, p) exactly.
float edge(Corner p, Corner q) {
    precise float a = p.p.x * q.p.y;
    precise float b = p.p.y * q.p.x;
    precise float e = a - b;
    return e;
}

// Rounding errors of edge(c, b), edge(a, c), edge(b, a): nearly all of the value where that is zero, and then the sign is right.
vec3 edge_rests(Corner a, Corner b, Corner c) {
    precise vec3 rest = product_rest(vec3(c.p.x, a.p.x, b.p.x), vec3(b.p.y, c.p.y, a.p.y))
        - product_rest(vec3(c.p.y, a.p.y, b.p.y), vec3(b.p.x, c.p.x, a.p.x));
    return rest;
}

// Whether the ray passes between the edges. Each is opposite a corner, and zero counts as inside.
bool is_inside(vec3 e) {
    return !(any(lessThan(e, vec3(0.0))) && any(greaterThan(e, vec3(0.0))));
}

// For a ray that passes between the edges of corners a, b, c: the distance of the hit, if within (tmin, tmax), and the corners'
// weights. To be called under `if`: most rays do not get here, and denormal numbers in lanes without a triangle
// would cost a CPU a hundred times the cycles of normal ones.
bool meets_between(Shear shear, vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, Corner a, Corner b, Corner c, vec3 edges,
        float tmin, float tmax, out float t, out vec3 weights) {
    // Seen from far beside it a small triangle's edges may all be zero but one, which looks like a hit of a corner.
    if (any(equal(edges, vec3(0.0)))) edges += edge_rests(a, b, c);
    bool inside = is_inside(edges);
    float u = edges.x, v = edges.y, w = edges.z;
    float det = u + v + w;
    bool plausible = inside && abs(det) > 1e-37 && abs(det) < 1e37;
    float inverse_det = 1.0 / (plausible ? det : 1.0);
    weights = edges * inverse_det;
    float scaled = u * a.z + v * b.z + w * c.z;
    t = (plausible ? scaled : 0.0) * shear.s.z * inverse_det;
    bool met = plausible && t > tmin && t < tmax;
    vec3 z = abs(vec3(a.z, b.z, c.z) * shear.s.z);
    float max_z = max(max(z.x, z.y), z.z);
    // A ray that has just left this surface may find it again at a t that is all rounding, thin triangles above all; and a
    // surface just in front of it must not be lost. Where t is below the bound on its error (pbrt-v4, 6.8.7; gamma(n) = n
    // half-ulps) it is computed again with twice the digits. That matters only where t is small beside the distance of the
    // triangle's corners, so most hits are spared even the bound.
    if (met && t < 0.05 * max_z) {
        const float GAMMA = 5.9604645e-8;
        vec3 x = abs(vec3(a.p.x, b.p.x, c.p.x)), y = abs(vec3(a.p.y, b.p.y, c.p.y)), e = abs(vec3(u, v, w));
        float max_x = max(max(x.x, x.y), x.z), max_y = max(max(y.x, y.y), y.z);
        float max_e = max(max(e.x, e.y), e.z);
        float delta_x = 5.0 * GAMMA * (max_x + max_z), delta_y = 5.0 * GAMMA * (max_y + max_z), delta_z = 3.0 * GAMMA * max_z;
        float delta_e = 2.0 * (2.0 * GAMMA * max_x * max_y + delta_y * max_x + delta_x * max_y);
        float delta_t = 3.0 * (3.0 * GAMMA * max_e * max_z + delta_e * max_z + delta_z * max_e) * abs(inverse_det);
        if (t < tmin + delta_t) {
            t = plane_distance(origin, direction, v0, v1, v2);
            met = t > tmin && t < tmax;
        }
    }
    return met;
}

// Moeller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (JGT 1997), double-sided. Each triangle rounds the shared
// edge in its own way, so rays slip between neighbours; and t is as rounding leaves it.
bool intersect_moller_trumbore(vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, float tmin, float tmax, out float t, out vec2 uv) {
    // Edges of the corners as seen from the origin: in lanes that hold no triangle, corners are often denormal, and so would
    // their differences be; less the origin they are none.
    vec3 a = v0 - origin;
    vec3 e1 = (v1 - origin) - a, e2 = (v2 - origin) - a;
    vec3 p = cross(direction, e2);
    float det = dot(e1, p);
    bool plausible = abs(det) > 1e-37 && abs(det) < 1e37;
    float inverse_det = 1.0 / (plausible ? det : 1.0);
    vec3 s = -a;
    vec3 q = cross(s, e1);
    uv = vec2(dot(s, p), dot(direction, q)) * inverse_det;
    t = dot(e2, q) * inverse_det;
    return plausible && uv.x >= 0.0 && uv.y >= 0.0 && uv.x + uv.y <= 1.0 && t > tmin && t < tmax;
}

// Why no ray slips between two triangles that share an edge: a corner's sheared position depends on the corner and the ray
// alone, so both triangles see the same numbers; and the sign of fl(a*b) - fl(c*d) is never wrong, at worst zero, because
// rounding is monotonic. `precise` keeps the compiler from fusing a product into the difference, which would break the symmetry.
// A zero is resolved with what rounding took from the products (the paper computes in double precision), and if that is zero too,
// both triangles are hit, at the same t, which no stream can tell apart.
bool intersect_triangle(Shear shear, vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, float tmin, float tmax, out float t, out vec2 uv) {
    if (!WATERTIGHT) return intersect_moller_trumbore(origin, direction, v0, v1, v2, tmin, tmax, t, uv);
    Corner a = make_corner(shear, origin, v0), b = make_corner(shear, origin, v1), c = make_corner(shear, origin, v2);
    vec3 edges = vec3(edge(c, b), edge(a, c), edge(b, a));
    bool met = false;
    t = tmax;
    uv = vec2(0.0);
    if (is_inside(edges)) {
        vec3 weights;
        met = meets_between(shear, origin, direction, v0, v1, v2, a, b, c, edges, tmin, tmax, t, weights);
        if (met) uv = weights.yz;
    }
    return met;
}

#endif
