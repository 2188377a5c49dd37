// temporal: reprojects the history of a pixel's surface and adds this frame's samples to it.
//
// The surface point is reprojected to the previous image; of the four pixels around it, those count that show the same
// surface (distance from its plane, normal, id). A history has a number of samples, by which it is weighted, up to a limit
// (Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007). Occlusion does not depend on the view, so a moving
// camera invalidates no history. Moving geometry does, near it and by the fraction of the hemisphere that it covers: that is taken for
// the variance that a frame adds (a Kalman filter's process noise), and there the history is also clamped to this frame's
// samples nearby (Karis, "High-Quality Temporal Supersampling", 2014, with the standard error of their mean as the width).
#include "common/reprojection.glsl"

layout(local_size_x = LANES) in;

// Minimum variance of samples while it is not known yet: a few equal samples say little.
const float MIN_VARIANCE = 0.02;
// Radius in pixels of the neighbourhood to which a history is clamped.
const int CLAMP_RADIUS = 3;

// Mean of this frame's samples over the surrounding pixels of the same surface; `variance` is that of the mean.
Estimate surroundings(TemporalParams p, FrameParams f, ivec2 pixel, EdgeTest edge) {
    float sum = 0.0, squares = 0.0, n = 0.0;
    uvec2 current = p.current, guide = f.guide;
    uint width = f.size.x;
    ivec2 lower = max(pixel - CLAMP_RADIUS, ivec2(0)), upper = min(pixel + CLAMP_RADIUS, ivec2(f.size) - 1);
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            uint at = uint(y) * width + uint(x);
            Estimate e = unpack_estimate(LOAD_PAIR(current, at));
            if (e.samples == 0.0 || !same_surface(edge, vec2(ivec2(x, y) - pixel), LOAD_PAIR(guide, at))) continue;
            sum += e.mean * e.samples;
            squares += e.mean * e.mean * e.samples;
            n += e.samples;
        }
    }
    if (n == 0.0) return Estimate(0.0, 0.0, 0.0);
    float mean = share_of(sum, n);
    return Estimate(mean, n, (max(squares / n - mean * mean, 0.0) + MIN_VARIANCE) / n);
}

// The history of a surface point; zero samples if there is none. `bent`: the history of its bent normal.
Estimate reprojected(TemporalParams p, FrameParams f, vec3 before, vec3 normal, uint id, inout vec3 bent) {
    Estimate none = Estimate(0.0, 0.0, 0.0);
    vec2 at;
    if (!previous_place(f, before, at)) return none;
    Taps taps = taps_around(f, at, at, previous_edge(f, before, normal, at), id);
    float weight = 0.0, mean = 0.0, samples = 0.0, variance = 0.0;
    vec3 bents = vec3(0.0);
    [[unroll]] for (int k = 0; k < 4; k++) {
        float w = taps.weight[k];
        if (w == 0.0) continue;
        Estimate e = unpack_estimate(LOAD_PAIR(f.previous_history, taps.at[k]));
        if (!(e.samples > 0.0)) continue;
        weight += w;
        mean += w * e.mean;
        samples += w * e.samples;
        variance += w * e.variance;
        if (BENT_NORMALS) bents += w * load_vec3(p.previous_bent_history, taps.at[k]);
    }
    if (weight < MIN_TAP_WEIGHT) return none;
    if (BENT_NORMALS) bent = bents / weight;
    return Estimate(share_of(mean, weight), samples / weight, variance / weight);
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    TemporalParams p = TemporalParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) {
        // the next sample of the same pixel may show a surface again
        bool rests = f.has_history != 0u && f.still != 0u;
        STORE_PAIR(p.history, at, rests ? LOAD_PAIR(f.previous_history, at) : uvec2(0u));
        return;
    }
    Estimate now = unpack_estimate(LOAD_PAIR(p.current, at));
    // NaN never enters a history
    if (!(now.mean >= 0.0 && now.mean <= 1.0)) now = Estimate(0.0, 0.0, 0.0);
    Estimate past = Estimate(0.0, 0.0, 0.0);
    vec3 bent = vec3(0.0);
    if (f.has_history != 0u) {
        if (f.still != 0u) {
            past = unpack_estimate(LOAD_PAIR(f.previous_history, at));
            if (BENT_NORMALS) bent = load_vec3(p.previous_bent_history, at);
        } else {
            vec3 position = surface_position(f, at), normal = surface_normal(f, at);
            vec3 before = is_null(f.previous_position) ? position : load_vec3(f.previous_position, at);
            past = reprojected(p, f, before, normal, guide.y >> 24, bent);
            float change = p.moved_count > 0u && past.samples > 0.0 ? p.moved_weight * possible_change(p.moved, p.moved_count, f, position, normal) : 0.0;
            if (change > 0.0) {
                past.samples = samples_after(past.samples, change, max(past.variance, MIN_VARIANCE));
                if (p.clamp_width > 0.0) {
                    uvec2 pixel = image_pixel(f, at);
                    EdgeTest edge = edge_test(f, f.world_to_camera, f.view, f.orthographic != 0u, position, normal, sample_place(f, vec2(pixel)));
                    Estimate around = surroundings(p, f, ivec2(pixel), edge);
                    if (around.samples > 0.0) {
                        float width = p.clamp_width * sqrt(around.variance);
                        past.mean = clamp(past.mean, around.mean - width, around.mean + width);
                    }
                }
            }
        }
    }
    past.samples = min(past.samples, max(f.most_samples - now.samples, 0.0));
    float total = past.samples + now.samples;
    Estimate e = Estimate(0.0, total, 0.0);
    if (total > 0.0) {
        float share = now.samples / total;
        float difference = now.mean - past.mean;
        e.mean = past.mean + share * difference;
        // variance of all samples about their common mean
        e.variance = mix(past.variance, now.variance, share) + share * (1.0 - share) * difference * difference;
        // a pixel without samples has no value
        if (BENT_NORMALS && now.samples > 0.0) bent = mix(bent, load_vec3(p.current_bent, at), share);
    }
    STORE_PAIR(p.history, at, pack_estimate(e));
    if (BENT_NORMALS) store_vec3(p.bent_history, at, bent);
}
