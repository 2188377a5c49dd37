// Where a surface was in the previous image, and what may have changed around it since.
#ifndef COMMON_REPROJECTION
#define COMMON_REPROJECTION
#include "common/frame.glsl"
#include "interface/passes.glsl"

// The pixels around a place of the previous image, with their bilinear weights; 0 for those that show another surface.
struct Taps {
    uint at[4];
    float weight[4];
};

// Sum of the weights of taps below which there is no history: less than a hundredth of the footprint was visible.
const float MIN_TAP_WEIGHT = 0.01;

const Taps NO_TAPS = Taps(uint[4](0u, 0u, 0u, 0u), float[4](0.0, 0.0, 0.0, 0.0));

// The place of a point in the previous image, in pixels from the sample of the pixel in the upper left corner; false if it was not there.
bool previous_place(FrameParams f, vec3 before, out vec2 at) {
    vec3 c = affine(f.previous_world_to_camera, before);
    bool orthographic = f.previous_orthographic != 0u;
    at = vec2(-2.0);
    if (!orthographic && !(c.z < 0.0)) return false;
    at = image_point(f, f.previous_view, orthographic ? c.xy : c.xy / -c.z) - 0.5 - f.previous_offset;
    // also for NaN
    return all(greaterThan(at, vec2(-1.0))) && all(lessThan(at, vec2(f.size)));
}

// What tells the surface of a point apart in the previous image, in which it was at `at`.
EdgeTest previous_edge(FrameParams f, vec3 before, vec3 normal, vec2 at) {
    return edge_test(f, f.previous_world_to_camera, f.previous_view, f.previous_orthographic != 0u, before, normal, at + 0.5 + f.previous_offset);
}

// The guide's normals of radiance are shading normals, by which lighting differs; planes are those of the true surface.
EdgeTest with_normal(EdgeTest edge, uvec2 guide) {
    edge.normal = guide_normal(guide);
    return edge;
}

// The pixels around `at` that show the surface which `edge` tells, and which was at `surface_at`.
Taps taps_around(FrameParams f, vec2 at, vec2 surface_at, EdgeTest edge, uint id) {
    Taps taps = NO_TAPS;
    // far outside stays outside
    ivec2 base = to_int(clamp(floor(at), -1e6, 1e6));
    vec2 inside = at - vec2(base);
    // a pixel that is hit at its centre is taken alone: a static view is not blurred
    inside = mix(inside, round(inside), lessThan(abs(inside - round(inside)), vec2(1e-3)));
    [[unroll]] for (int k = 0; k < 4; k++) {
        ivec2 corner = ivec2(k & 1, k >> 1);
        ivec2 q = base + corner;
        vec2 w2 = mix(1.0 - inside, inside, vec2(corner));
        float w = w2.x * w2.y;
        if (w == 0.0 || any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, ivec2(f.size)))) continue;
        uint tap = image_index(f, uvec2(q));
        uvec2 guide = LOAD_PAIR(f.previous_guide, tap);
        if (guide.y >> 24 != id || !same_surface(edge, vec2(q) - surface_at, guide)) continue;
        taps.at[k] = tap;
        taps.weight[k] = w;
    }
    return taps;
}

// Maximum change of a point's ambient visibility in this frame: the fraction of the cosine-weighted hemisphere that is covered by the bounding
// spheres of what moved.
float possible_change(uvec2 moved_records, uint count, FrameParams f, vec3 position, vec3 normal) {
    float change = 0.0;
    MovedRecords moved = MovedRecords(moved_records);
    for (uint k = 0u; k < count; k++) {
        MovedRecord m = moved.v[k];
        vec3 nearest = clamp(position, m.lower, m.upper) - position;
        float gap2 = dot(nearest, nearest);
        if (gap2 > f.reach * f.reach) continue;
        vec3 to = 0.5 * (m.lower + m.upper) - position;
        float radius = 0.5 * length(m.upper - m.lower);
        float far2 = dot(to, to);
        // entirely below the horizon
        if (dot(normal, to) < -radius) continue;
        float cover = min(radius * radius / max(far2, 1e-30), 1.0);
        if (gap2 == 0.0) cover = 1.0;
        change += m.share * cover * exp2(-sqrt(gap2) * f.falloff_log2);
    }
    return min(change, 1.0);
}

// Number of samples that a history still counts for after such a change, of a signal whose samples have this variance: the change is taken for the variance
// that a frame adds (a Kalman filter's process noise).
float samples_after(float samples, float change, float variance) {
    return samples / (1.0 + samples * change * change / variance);
}

#endif
