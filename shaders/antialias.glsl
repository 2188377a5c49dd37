// antialias: the mean over frames whose samples lie at different places within the pixels, and at rest what the image converges to.
//
// In motion the resolved image of the previous frame is reprojected with the motion of the nearest surface around a pixel, interpolated by a cubic (Catmull-Rom), which
// blurs less than a line, and clipped to this frame's values nearby (Karis, "High-Quality Temporal Supersampling", SIGGRAPH 2014 courses; Salvi, "An Excursion in
// Temporal Supersampling", GDC 2016). At rest frames are averaged, later ones with more weight, because their histories are longer.
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
// Samples at rest from which their denoised mean counts at least as much as the filtered image.
const float TAKE_OVER_SAMPLES = 4.0;

// What taps read, fetched once: each use of a field of a record is a load.
struct Images {
    ivec2 size;
    uvec2 guide;
    // null for visibility, which has no colour
    uvec2 composed;
    uvec2 visibility;
    uvec2 history;
};

uint image_index(Images m, ivec2 pixel) { return uint(pixel.y * m.size.x + pixel.x); }

// This frame's value and coverage. `guide`: of the pixel.
vec4 value_at(Images m, uvec2 guide, uint at) {
    if (!is_null(m.composed)) return load_quad(m.composed, at);
    // coverage is that of the sample
    return vec4(vec3(FloatImage(m.visibility).v[at]), is_surface(guide) ? 1.0 : 0.0);
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
    uint nearest;   // the pixel of the nearest surface
    float depth;    // its distance; INFINITY: there is none
};

Neighbourhood neighbourhood(Images m, ivec2 pixel) {
    vec4 sum = vec4(0.0), squares = vec4(0.0);
    float n = 0.0;
    Neighbourhood around = Neighbourhood(vec4(0.0), vec4(0.0), image_index(m, pixel), INFINITY);
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
    }
    around.mean = sum / n;
    around.deviation = sqrt(max(squares / n - around.mean * around.mean, vec4(0.0)));
    return around;
}

// Where the pixel's centre was in the previous image, in pixels from the centre of the one in the upper left corner: it moved as the nearest surface around it, so that
// edges move as a whole.
bool previous_pixel(FrameParams f, ivec2 pixel, Neighbourhood around, out vec2 at) {
    uint nearest = around.nearest;
    vec3 before;
    vec2 now;
    if (around.depth < INFINITY) {
        before = is_null(f.previous_position) ? surface_position(f, nearest) : load_vec3(f.previous_position, nearest);
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
    vec3 c = affine(f.previous_world_to_camera, before);
    bool orthographic = f.previous_orthographic != 0u;
    if (!orthographic && !(c.z < 0.0)) return false;
    vec2 place = image_point(f, f.previous_view, orthographic ? c.xy : c.xy / -c.z);
    at = vec2(pixel) + (place - now);
    return all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(f.size) - 0.5));
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
    Images m = Images(ivec2(f.size), f.guide, p.composed, p.visibility, p.previous_history);
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
        Neighbourhood around = neighbourhood(m, pixel);
        vec4 width = p.clamp_width * around.deviation;
        vec2 before;
        if (all(lessThanEqual(width, FLAT * around.mean))) {
            frames = p.most_frames;
        } else if (previous_pixel(f, pixel, around, before)) {
            float past;
            vec4 history = max(clipped(resolved_at(m, before, past), around.mean, width), vec4(0.0));
            frames = min(past + 1.0, p.most_frames);
            resolved = mix(history, now, 1.0 / frames);
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
                vec3 d = value_at(m, LOAD_PAIR(m.guide, tap), tap).rgb - r.mean;
                differences += dot(d, d);
                error += rest_error(r);
            }
        }
        // of the filtered image: what noise does not explain of the differences; a few equal samples say little about noise
        float share = differences > error ? (differences - error) / differences : 0.0;
        share *= clamp((own.frames - FEW_FRAMES) / FEW_FRAMES, 0.0, 1.0);
        share = max(share, own.samples / (own.samples + TAKE_OVER_SAMPLES));
        resolved = mix(resolved, vec4(vec3(FloatImage(p.denoised).v[at]), own.coverage), share);
    }
    store_quad(p.resolved, at, resolved);
}
