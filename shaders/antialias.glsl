// antialias: the mean over frames whose samples lie at different places within the pixels, and at rest what the image converges to.
//
// In motion the resolved image of the previous frame is reprojected with the motion of the nearest surface around a pixel, interpolated by a cubic (Catmull-Rom), which
// blurs less than a line, and clipped to this frame's values nearby (Karis, "High-Quality Temporal Supersampling", SIGGRAPH 2014 courses; Salvi, "An Excursion in
// Temporal Supersampling", GDC 2016). Along edges, whose values are far apart, and in noise the clip lets pass what was there before: where something in front has gone, and where light has changed, there is no
// history. At rest frames are averaged, later ones with more weight, because their histories are longer.
//
// The mean of all samples of ambient visibility since the image came to rest has neither the bias of filters nor that of clamps, but noise, most of which non-local means take away (common/nlmeans.glsl).
// It takes over as samples become many, and sooner where it differs from the filtered image by more than its noise explains (Lee 1980, as in common/filter.glsl). The filter of radiance has the mean at
// rest for its input.
#include "common/radiance.glsl"
#include "common/reprojection.glsl"
#include "common/rest.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

// Radius in pixels of the neighbourhood that says how far the filtered image is from the mean at rest.
const int BIAS_RADIUS = 2;
// Frames at rest of which nothing is taken yet.
const float FEW_FRAMES = 8.0;
// Where values nearby differ by less than this share of their mean, the clipped history is no different from this frame.
const float FLAT = 1.0 / 512.0;
// Pixels by which something must have moved on before another surface to have uncovered it: samples that miss what is thinner than a pixel do not say that it has gone.
const float LEAST_MOTION = 0.75;
// Maximum number of frames of what moves before a camera that rests: their edges lie where each frame's samples say.
const float MOVING_FRAMES = 2.0;
// How many times wider the clamp is where nothing moves in the image.
const float STILL_CLAMP = 3.0;
// Samples at rest from which their denoised mean counts at least as much as the filtered image.
const float TAKE_OVER_SAMPLES = 4.0;

// What taps read, fetched once: each use of a field of a record is a load.
struct Images {
    ivec2 size;
    uvec2 guide;
    uvec2 previous_guide;
    uvec2 normals;
    // null for visibility, which has no colour
    uvec2 composed;
    uvec2 visibility;
    uvec2 history;
};

uint image_index(Images m, ivec2 pixel) { return uint(pixel.y * m.size.x + pixel.x); }

// This frame's value and coverage. `guide`: of the pixel.
vec4 value_at(Images m, uvec2 guide, uint at) {
    if (!is_null(m.composed)) return load_quad(m.composed, at);
    float visibility = FloatImage(m.visibility).v[at];
    // a ground that catches shadows is black where it is occluded, and else not there
    if (HAS_CATCHER && is_surface(guide) && is_catcher(m.normals, at)) return vec4(vec3(0.0), 1.0 - visibility);
    // coverage is that of the sample
    return vec4(vec3(visibility), is_surface(guide) ? 1.0 : 0.0);
}

// The resolved image and its coverage, which has 16 bits, as has the number of frames.
vec4 load_resolved(uvec2 history, uint at, out float frames) {
    uvec4 q = LOAD_QUAD(history, at);
    frames = float(q.w & 0xffffu);
    return vec4(uintBitsToFloat(q.xyz), float(q.w >> 16) / 65535.0);
}

void store_resolved(AntialiasParams p, uint at, vec4 value, float frames) {
    uint w = uint(to_int(floor(clamp(value.a, 0.0, 1.0) * 65535.0 + 0.5))) << 16 | uint(to_int(floor(min(frames, 65535.0))));
    store_quad(p.history, at, vec4(value.rgb, uintBitsToFloat(w)));
}

// The resolved image at a place, in pixels from the centre of the one in the upper left corner; interpolated by a cubic without its corners. `frames`: of the nearest pixel.
vec4 resolved_at(Images m, vec2 at, out float frames) {
    vec2 base = floor(at), t = at - base;
    ivec2 corner = to_int(base);
    vec2 w0 = t * (-0.5 + t * (1.0 - 0.5 * t)), w1 = 1.0 + t * t * (-2.5 + 1.5 * t), w2 = t * (0.5 + t * (2.0 - 1.5 * t)), w3 = t * t * (-0.5 + 0.5 * t);
    vec4 sum = vec4(0.0), least = vec4(INFINITY), most = vec4(-INFINITY);
    float weight = 0.0;
    [[unroll]] for (int y = 0; y < 4; y++) {
        float wy = y == 0 ? w0.y : y == 1 ? w1.y : y == 2 ? w2.y : w3.y;
        [[unroll]] for (int x = 0; x < 4; x++) {
            if ((x == 0 || x == 3) && (y == 0 || y == 3)) continue;
            float w = wy * (x == 0 ? w0.x : x == 1 ? w1.x : x == 2 ? w2.x : w3.x);
            ivec2 q = clamp(corner + ivec2(x - 1, y - 1), ivec2(0), m.size - 1);
            float of_tap;
            vec4 value = load_resolved(m.history, image_index(m, q), of_tap);
            sum += w * value;
            weight += w;
            if (x == 1 || x == 2) {
                if (y == 1 || y == 2) {
                    least = min(least, value);
                    most = max(most, value);
                }
            }
        }
    }
    load_resolved(m.history, image_index(m, clamp(to_int(round(at)), ivec2(0), m.size - 1)), frames);
    // a cubic swings beyond what it passes through: beside a lamp below black
    return clamp(sum / weight, least, most);
}

// This frame's values around a pixel.
struct Neighbourhood {
    vec4 mean;
    vec4 deviation;
    vec4 middle;    // interpolated in the middle of the pixel
    uint nearest;   // the pixel of the nearest surface
    float depth;    // its distance; INFINITY: there is none
};

// `samples_at`: where samples lie, from the middle of their pixels.
Neighbourhood neighbourhood(Images m, ivec2 pixel, vec2 samples_at) {
    vec4 sum = vec4(0.0), squares = vec4(0.0), middle = vec4(0.0);
    float n = 0.0, weights = 0.0;
    Neighbourhood around = Neighbourhood(vec4(0.0), vec4(0.0), vec4(0.0), image_index(m, pixel), INFINITY);
    for (int k = 0; k < 9; k++) {
        ivec2 q = pixel + ivec2(k % 3, k / 3) - 1;
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, m.size))) continue;
        uint tap = image_index(m, q);
        uvec2 guide = LOAD_PAIR(m.guide, tap);
        float d = uintBitsToFloat(guide.x);
        if (d < around.depth) {
            around.depth = d;
            around.nearest = tap;
        }
        vec4 v = value_at(m, guide, tap);
        sum += v;
        squares += v * v;
        n += 1.0;
        vec2 near = max(1.0 - abs(vec2(q - pixel) + samples_at), 0.0);
        middle += near.x * near.y * v;
        weights += near.x * near.y;
    }
    around.middle = middle / weights;
    around.mean = sum / n;
    around.deviation = sqrt(max(squares / n - around.mean * around.mean, vec4(0.0)));
    return around;
}

// Where the pixel's centre was in the previous image, in pixels from the centre of the one in the upper left corner: it moved as the nearest surface around it, so that
// edges move as a whole.
// `before`: where that surface was, in the previous camera's space; of the background nothing.
bool previous_pixel(FrameParams f, ivec2 pixel, Neighbourhood around, out vec2 at, out vec3 before) {
    uint nearest = around.nearest;
    vec2 now;
    before = vec3(0.0);
    if (around.depth < INFINITY) {
        vec3 position = is_null(f.previous_position) ? surface_position(f, nearest) : load_vec3(f.previous_position, nearest);
        before = affine(f.previous_world_to_camera, position);
        now = sample_place(f, vec2(image_pixel(f, nearest)));
    } else {
        // infinitely far away
        now = vec2(pixel) + 0.5;
        vec3 d = unproject(f.orthographic != 0u, image_plane(f, f.view, now), 1.0);
        vec4 rows[3] = f.camera_to_world;
        vec3 w = f.orthographic != 0u ? -vec3(rows[0].z, rows[1].z, rows[2].z) : linear(rows, d);
        vec3 c = linear(f.previous_world_to_camera, w);
        if (f.orthographic != 0u || f.previous_orthographic != 0u) {
            at = vec2(pixel);
            return true;
        }
        if (!(c.z < 0.0)) return false;
        at = image_point(f, f.previous_view, c.xy / -c.z) - 0.5;
        return all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(f.size) - 0.5));
    }
    bool orthographic = f.previous_orthographic != 0u;
    if (!orthographic && !(before.z < 0.0)) return false;
    vec2 place = image_point(f, f.previous_view, orthographic ? before.xy : before.xy / -before.z);
    at = vec2(pixel) + (place - now);
    return all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(f.size) - 0.5));
}

// Returns true if a point was in one of the boxes of what has moved, and that by more than LEAST_MOTION pixels. `side`: of a pixel's footprint there.
bool has_moved_on(AntialiasParams p, vec3 position, float side) {
    MovedRecords moved = MovedRecords(p.moved);
    for (uint k = 0u; k < p.moved_count; k++) {
        MovedRecord m = moved.v[k];
        // surfaces lie on the sides of their boxes
        vec3 beyond = max(m.lower - position, position - m.upper);
        bool is_inside = max(beyond.x, max(beyond.y, beyond.z)) < side;
        if (is_inside && m.share * 0.5 * length(m.upper - m.lower) > LEAST_MOTION * side) return true;
    }
    return false;
}

// Returns true if the previous image showed something around `at` that was in front of what is seen there now, and has moved on. What is not hit now, but is still there, is thinner than a pixel. `before`: where the nearest surface
// around the pixel was, in the previous camera's space.
bool is_uncovered(AntialiasParams p, FrameParams f, Images m, ivec2 pixel, Neighbourhood around, vec2 at, vec3 before) {
    bool is_background = !(around.depth < INFINITY), orthographic = f.previous_orthographic != 0u;
    float depth = INFINITY;
    vec2 surface_at = vec2(0.0);
    EdgeTest edge;
    if (!is_background) {
        surface_at = image_point(f, f.previous_view, orthographic ? before.xy : before.xy / -before.z);
        vec3 normal = surface_normal(f, around.nearest);
        edge = edge_test(f, f.previous_view, orthographic, image_plane(f, f.previous_view, surface_at), before, linear(f.previous_world_to_camera, normal), normal);
        depth = -before.z - edge.tolerance;
    }
    ivec2 centre = to_int(round(at));
    vec2 shift = f.previous_offset + 0.5;
    // the neighbours in front of the surface, a bit each: pixels have few, but those of a vector differ in which, and a loop over all would test each for all
    uint fronts = 0u;
    for (int k = 0; k < 9; k++) {
        // at the image's borders some are looked at twice
        ivec2 q = clamp(centre + ivec2(k % 3, k / 3) - 1, ivec2(0), m.size - 1);
        float there = uintBitsToFloat(LOAD_PAIR(m.previous_guide, image_index(m, q)).x);
        bool is_front = there < depth && (is_background || in_front(edge, vec2(q) + shift - surface_at, there));
        fronts |= is_front ? 1u << k : 0u;
    }
    while (fronts != 0u) {
        int k = findLSB(fronts);
        fronts &= fronts - 1u;
        ivec2 q = clamp(centre + ivec2(k % 3, k / 3) - 1, ivec2(0), m.size - 1);
        float there = uintBitsToFloat(LOAD_PAIR(m.previous_guide, image_index(m, q)).x);
        vec3 c = unproject(orthographic, image_plane(f, f.previous_view, vec2(q) + shift), there);
        c = affine(p.previous_to_camera, c);
        // where it would be if it had moved as what is behind it
        vec2 expected = vec2(pixel) + (vec2(q) + shift - at);
        bool behind = f.orthographic == 0u && !(c.z < 0.0);
        if (behind || any(greaterThan(abs(image_point(f, f.view, f.orthographic != 0u ? c.xy : c.xy / -c.z) - expected), vec2(LEAST_MOTION)))) return true;
        if (p.moved_count > 0u && has_moved_on(p, affine(f.camera_to_world, c), footprint(f, f.view, f.orthographic != 0u, -c.z))) return true;
    }
    return false;
}

// Where two planes meet within a pixel, how much of it shows the nearer pixel's surface is known without a history.
struct Crease {
    uint other;   // a pixel next to this one, which shows the other plane
    float share;  // of the pixel that shows it
};

// The plane that a pixel shows, seen from the middle of `pixel`.
EdgeTest plane_at(FrameParams f, ivec2 pixel, uint at, uvec2 guide) {
    return edge_test(f, guide, surface_normal(f, at), sample_place(f, vec2(pixel)));
}

// The inverse depth of a plane is linear in the image. Its value at a place, and its change by pixels to the right and down.
vec3 inverse_depth(EdgeTest e, vec2 offset) { return vec3(e.at + offset.x * e.right + offset.y * e.down, e.right, e.down) / e.distance; }

Crease crease_at(FrameParams f, Images m, ivec2 pixel, uint at, uvec2 guide) {
    Crease crease = Crease(at, 0.0);
    if (!is_surface(guide) || f.orthographic != 0u) return crease;
    EdgeTest own = plane_at(f, pixel, at, guide);
    for (int k = 0; k < 4; k++) {
        ivec2 step_ = k < 2 ? ivec2(2 * k - 1, 0) : ivec2(0, 2 * k - 5), q = pixel + step_;
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, m.size))) continue;
        uint tap = image_index(m, q);
        uvec2 there = LOAD_PAIR(m.guide, tap);
        if (!is_surface(there) || same_surface(own, vec2(step_), there)) continue;
        EdgeTest other = plane_at(f, q, tap, there);
        // the samples show one plane each: the difference changes its sign between them
        vec3 from = inverse_depth(own, vec2(0.0)) - inverse_depth(other, -vec2(step_));
        vec3 to = inverse_depth(own, vec2(step_)) - inverse_depth(other, vec2(0.0));
        if (from.x * to.x >= 0.0) continue;
        vec3 centre = inverse_depth(own, -f.offset) - inverse_depth(other, -f.offset - vec2(step_));
        // of a strip of a pixel's width across the crease
        float side = abs(from.y) + abs(from.z), beyond = -centre.x * sign(from.x) / max(side, 1e-30);
        float share = clamp(0.5 + beyond, 0.0, 1.0);
        if (share > crease.share) crease = Crease(tap, share);
    }
    return crease;
}

// Returns true if the light of a pixel, or of one beside it, has changed from one frame to the next.
bool has_stepped(AntialiasParams p, Images m, ivec2 pixel) {
    if (is_null(p.changed)) return false;
    for (int k = 0; k < 9; k++) {
        ivec2 q = clamp(pixel + ivec2(k % 3, k / 3) - 1, ivec2(0), m.size - 1);
        if (load_quad(p.changed, 2u * image_index(m, q) + 1u).w < 0.0) return true;
    }
    return false;
}

// The weight of a frame of all samples at rest, most of which those before it have had, too. `frames`: in the mean, this one included; those in motion are the ones before the image came to rest.
float long_weight(AntialiasParams p, float frames) {
    if (p.rest_after <= 0.0) return 0.0;
    float past = p.motion_samples * max(frames - p.resting, 0.0);
    return 1.0 - pow((p.rest_before + past) / (p.rest_after + past), p.power);
}

// A history as near to the neighbourhood's mean as the clamp allows, on the line between them.
vec4 clipped(vec4 history, vec4 mean, vec4 width) {
    vec4 off = (history - mean) / max(width, vec4(1e-6));
    float beyond = max(max(abs(off.r), abs(off.g)), max(abs(off.b), abs(off.a)));
    return beyond > 1.0 ? mean + (history - mean) / beyond : history;
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    AntialiasParams p = AntialiasParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    ivec2 pixel = ivec2(image_pixel(f, at));
    Images m = Images(ivec2(f.size), f.guide, f.previous_guide, f.normals, p.composed, p.visibility, p.previous_history);
    vec4 now = value_at(m, LOAD_PAIR(m.guide, at), at), resolved = now;
    float frames = 1.0;
    if (p.holds != 0u) {
        // no frame adds to it any more
        resolved = load_resolved(m.history, at, frames);
    } else if (p.has_history != 0u && p.most_frames > 1.0 && f.still != 0u) {
        vec4 history = load_resolved(m.history, at, frames);
        frames += 1.0;
        resolved = mix(history, now, max(max(2.0 / (frames + 1.0), p.least_weight), long_weight(p, frames)));
    } else if (p.has_history != 0u && p.most_frames > 1.0) {
        Neighbourhood around = neighbourhood(m, pixel, p.samples_at);
        vec4 width = p.clamp_width * around.deviation;
        vec2 place;
        vec3 before;
        if (all(lessThanEqual(width, FLAT * around.mean))) {
            frames = p.most_frames;
        } else if (previous_pixel(f, pixel, around, place, before)) {
            if (p.uncovers != 0u && is_uncovered(p, f, m, pixel, around, place, before)) {
                resolved = around.middle;
                Crease crease = crease_at(f, m, pixel, at, LOAD_PAIR(m.guide, at));
                if (crease.share > 0.0) {
                    resolved = mix(now, value_at(m, LOAD_PAIR(m.guide, crease.other), crease.other), crease.share);
                    frames = p.most_frames;
                }
            } else {
                // where nothing moves, no place is interpolated, and what is uncovered has no history: more frames are as sharp, and smoother
                bool is_still = all(lessThan(abs(place - vec2(pixel)), vec2(1e-3)));
                bool camera_rests = p.camera_rests != 0u;
                float past, most = is_still ? p.most_still_frames : camera_rests ? min(p.most_frames, MOVING_FRAMES) : p.most_frames;
                if (is_still) width *= STILL_CLAMP;
                // under a camera that rests all frames' samples around a place say more of it than one
                vec4 latest = camera_rests && p.uncovers != 0u ? around.middle : now;
                vec4 history = max(clipped(resolved_at(m, place, past), around.mean, width), vec4(0.0));
                frames = min(past + 1.0, most);
                resolved = mix(history, latest, 1.0 / frames);
                if (has_stepped(p, m, pixel)) {
                    frames = 1.0;
                    resolved = around.middle;
                }
            }
        }
    }
    store_resolved(p, at, resolved, frames);

    if (!is_null(p.denoised)) {
        Rest own = load_rest(p.rest, at);
        float differences = 0.0, error = 0.0;
        ivec2 lower = max(pixel - BIAS_RADIUS, ivec2(0)), upper = min(pixel + BIAS_RADIUS, m.size - 1);
        uvec2 rests = p.rest;
        for (int y = lower.y; y <= upper.y; y++) {
            for (int x = lower.x; x <= upper.x; x++) {
                uint tap = image_index(m, ivec2(x, y));
                Rest r = load_rest(rests, tap);
                if (r.frames < 2.0) continue;
                vec3 d = vec3(FloatImage(m.visibility).v[tap]) - r.mean;
                differences += dot(d, d);
                error += rest_error(r);
            }
        }
        // of the filtered image: what noise does not explain of the differences; a few equal samples say little about noise
        float share = differences > error ? (differences - error) / differences : 0.0;
        share *= clamp((own.frames - FEW_FRAMES) / FEW_FRAMES, 0.0, 1.0);
        share = max(share, own.samples / (own.samples + TAKE_OVER_SAMPLES));
        vec4 converged = vec4(vec3(FloatImage(p.denoised).v[at]), own.coverage);
        // what passes a catcher is no value of the image, and covers nothing; where there is nothing else it is denoised, too
        if (HAS_CATCHER) converged = max(converged - (own.is_caught ? converged.r : own.passed), 0.0);
        resolved = mix(resolved, converged, share);
    }
    store_quad(p.resolved, at, resolved);
}
