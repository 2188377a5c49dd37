// Watertight ray against triangle: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013).
#ifndef TRACE_TRIANGLE
#define TRACE_TRIANGLE

// Without WATERTIGHT it is the test of Möller and Trumbore, for benchmarks of the cost of watertightness (docs/design/tracers.md).

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

// By a power of two, which rounds nothing.
Wide3 scaled(Wide3 a, float factor) { return Wide3(a.hi * factor, a.lo * factor); }

float wide_dot(Wide3 a, Wide3 b) {
    Wide3 p = wide_product(a, b);
    Wide3 s = wide_sum(wide_sum(p, Wide3(p.hi.yzx, p.lo.yzx)), Wide3(p.hi.zxy, p.lo.zxy));
    return s.hi.x;
}

// The power of two by which a positive number becomes one in [1, 2); products of corners would leave the range of floats without.
float scale_to_one(float x) {
    return uintBitsToFloat(clamp(254u - (floatBitsToUint(x) >> 23), 1u, 254u) << 23);
}

// Distance t at which the ray meets the triangle's plane; NaN or infinite for a ray within it. `scale` brings the corners' distances from the origin to about one.
float plane_distance(vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, float scale) {
    Wide3 e1 = scaled(two_difference(v1, v0), scale), e2 = scaled(two_difference(v2, v0), scale);
    Wide3 normal = wide_sum(
        wide_product(Wide3(e1.hi.yzx, e1.lo.yzx), Wide3(e2.hi.zxy, e2.lo.zxy)),
        negated(wide_product(Wide3(e1.hi.zxy, e1.lo.zxy), Wide3(e2.hi.yzx, e2.lo.yzx))));
    return wide_dot(scaled(two_difference(v0, origin), scale), normal) / (scale * wide_dot(Wide3(direction, vec3(0.0)), normal));
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

// The same edge functions, edge(c, b), edge(a, c), edge(b, a), with twice the digits from the corners in space on; of corners that are `scale` times as far from the origin.
vec3 exact_edges(Shear shear, vec3 origin, vec3 v0, vec3 v1, vec3 v2, float scale) {
    vec3 o = permute(origin, shear.axis), a = permute(v0, shear.axis), b = permute(v1, shear.axis), c = permute(v2, shear.axis);
    Wide3 z = scaled(two_difference(vec3(a.z, b.z, c.z), vec3(o.z)), -scale);
    Wide3 x = scaled(two_difference(vec3(a.x, b.x, c.x), vec3(o.x)), scale), y = scaled(two_difference(vec3(a.y, b.y, c.y), vec3(o.y)), scale);
    x = wide_sum(x, wide_product(Wide3(vec3(shear.s.x), vec3(0.0)), z));
    y = wide_sum(y, wide_product(Wide3(vec3(shear.s.y), vec3(0.0)), z));
    return wide_sum(wide_product(Wide3(x.hi.zxy, x.lo.zxy), Wide3(y.hi.yzx, y.lo.yzx)),
        negated(wide_product(Wide3(x.hi.yzx, x.lo.yzx), Wide3(y.hi.zxy, y.lo.zxy)))).hi;
}

// Whether the ray passes between the edges. Each is opposite a corner, and zero counts as inside.
bool is_inside(vec3 e) {
    return !(any(lessThan(e, vec3(0.0))) && any(greaterThan(e, vec3(0.0))));
}

const float HALF_ULP = 5.9604645e-8;
// Bound on the error of a distance, as a share of it, from which on it is computed again. Errors are a quarter of the bound at most; and any hit
// needs nothing but the side of tmin that it is on, for which an error of half of the distance does no harm. Rays that have just left a wall are computed again the more
// often the less this is.
#ifdef STREAM_ANY
const float LARGEST_ERROR = 2.0;
#else
const float LARGEST_ERROR = 1.0 / 16.0;
#endif

// For a ray that passes between the edges of corners a, b, c: the distance of the hit, if within (tmin, tmax), and the corners'
// weights. To be called under `if`: most rays do not get here, and denormal numbers in lanes without a triangle
// would cost a CPU a hundred times the cycles of normal ones.
bool meets_between(Shear shear, vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2, Corner a, Corner b, Corner c, vec3 edges,
        float tmin, float tmax, out float t, out vec3 weights) {
    // Seen from far beside it a small triangle's edges may all be zero but one, which looks like a hit of a corner.
    if (any(equal(edges, vec3(0.0)))) edges += edge_rests(a, b, c);
    bool inside = is_inside(edges);
    float det = edges.x + edges.y + edges.z;
    bool plausible = inside && abs(det) > 1e-37 && abs(det) < 1e37;
    float inverse_det = 1.0 / (plausible ? det : 1.0);
    weights = edges * inverse_det;
    float along = edges.x * a.z + edges.y * b.z + edges.z * c.z;
    t = (plausible ? along : 0.0) * shear.s.z * inverse_det;
    // Edge functions round in proportion to the corners' distances from the ray, which is decimetres of t where a wall of a
    // kilometre is met at a centimetre. A surface just in front of the ray must not be lost, nor one found again that the ray has
    // just left. So where the error of t, and of the point that the weights mean, may be too large a share of t, both are
    // computed again with twice the digits. The bound is for roundings as they come: were all of them at
    // their worst, it would be 36 of its units instead of 8 (after pbrt-v4, 6.8.7).
    vec3 x = max(abs(vec3(a.p.x, b.p.x, c.p.x)), abs(vec3(a.p.y, b.p.y, c.p.y))), z = vec3(a.z, b.z, c.z) * shear.s.z;
    float aside = max(max(x.x, x.y), x.z), first = min(min(z.x, z.y), z.z), last = max(max(z.x, z.y), z.z);
    float farthest = max(-first, last);
    float error = (8.0 * HALF_ULP) * abs(aside * inverse_det) * (aside + farthest) * (aside + (last - first));
    if (plausible && error > LARGEST_ERROR * abs(t) && t + error > tmin && t - error < tmax) {
        float scale = scale_to_one(max(aside, farthest));
        vec3 exact = exact_edges(shear, origin, v0, v1, v2, scale);
        exact = exact.x + exact.y + exact.z < 0.0 ? -exact : exact;
        bool is_beside = any(lessThan(exact, vec3(0.0)));
        exact = max(exact, vec3(0.0));
        float sum = exact.x + exact.y + exact.z;
        if (sum > 0.0) weights = exact / sum;
        // A ray that passes just beside the triangle, between its rounded edges, meets the plane elsewhere, or never; and its neighbour
        // does not expect it. It must not slip through: it meets the edge.
        // A needle's plane is all rounding: a hit is no nearer and no farther than its corners.
        float in_plane = plane_distance(origin, direction, v0, v1, v2, scale), slack = 4.0 * HALF_ULP * farthest;
        bool is_within = in_plane >= first - slack && in_plane <= last + slack;
        t = is_beside || !is_within ? dot(weights, z) : in_plane;
    }
    return plausible && t > tmin && t < tmax;
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
