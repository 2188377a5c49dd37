// antialias: the mean over frames whose samples lie at different places within the pixels, and at rest what the image converges to.
//
// In motion the resolved image of the previous frame is reprojected with the motion of the nearest surface around a pixel, interpolated by a cubic (Catmull-Rom), which
// blurs less than a line, and clipped to this frame's values nearby (Karis, "High-Quality Temporal Supersampling", SIGGRAPH 2014 courses; Salvi, "An Excursion in
// Temporal Supersampling", GDC 2016). At rest frames are averaged, later ones with more weight, because their histories are longer.
//
// The mean of all samples since the image came to rest has neither the bias of filters nor that of clamps, but noise. It takes over where it differs from the filtered image
// by more than its noise explains (Lee 1980, as in common/filter.glsl), and everywhere in the end.
#include "common/radiance.glsl"
#include "common/reprojection.glsl"
#include "common/rest.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

// Radius in pixels of the neighbourhood that says how far the filtered image is from the mean at rest.
const int BIAS_RADIUS = 2;
// Frames at rest of which nothing is taken yet.
const float FEW_FRAMES = 8.0;
// Samples at rest from which their mean counts at least as much as the filtered image.
const float TAKE_OVER_SAMPLES = 1024.0;

// This frame's value and coverage.
vec4 value_at(AntialiasParams p, FrameParams f, uint at) {
    if (!is_null(p.composed)) return uintBitsToFloat(Quads(p.composed).v[at]);
    // coverage is that of the sample
    return vec4(vec3(FloatImage(p.visibility).v[at]), is_surface(LOAD_PAIR(f.guide, at)) ? 1.0 : 0.0);
}

// The resolved image at a place, in pixels from the centre of the one in the upper left corner; interpolated by a cubic without its corners. `frames`: of the nearest pixel.
vec4 resolved_at(AntialiasParams p, FrameParams f, vec2 at, out float frames) {
    vec2 base = floor(at), t = at - base;
    vec2 w0 = t * (-0.5 + t * (1.0 - 0.5 * t)), w1 = 1.0 + t * t * (-2.5 + 1.5 * t), w2 = t * (0.5 + t * (2.0 - 1.5 * t)), w3 = t * t * (-0.5 + 0.5 * t);
    vec4 sum = vec4(0.0), least = vec4(INFINITY), most = vec4(-INFINITY);
    float weight = 0.0;
    [[unroll]] for (int y = 0; y < 4; y++) {
        float wy = y == 0 ? w0.y : y == 1 ? w1.y : y == 2 ? w2.y : w3.y;
        [[unroll]] for (int x = 0; x < 4; x++) {
            if ((x == 0 || x == 3) && (y == 0 || y == 3)) continue;
            float w = wy * (x == 0 ? w0.x : x == 1 ? w1.x : x == 2 ? w2.x : w3.x);
            uvec2 q = uvec2(clamp(ivec2(base) + ivec2(x - 1, y - 1), ivec2(0), ivec2(f.size) - 1));
            uint tap = image_index(f, q);
            vec4 a = uintBitsToFloat(Quads(p.previous_history).v[2u * tap]), b = uintBitsToFloat(Quads(p.previous_history).v[2u * tap + 1u]);
            vec4 value = vec4(a.rgb, b.x);
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
    uint nearest = image_index(f, uvec2(clamp(ivec2(round(at)), ivec2(0), ivec2(f.size) - 1)));
    frames = uintBitsToFloat(Quads(p.previous_history).v[2u * nearest].w);
    // a cubic swings beyond what it passes through: beside a lamp below black
    return clamp(sum / weight, least, most);
}

// Where the pixel's centre was in the previous image, in pixels from the centre of the one in the upper left corner.
bool previous_pixel(FrameParams f, ivec2 pixel, out vec2 at) {
    // of the nearest surface around it, so that edges move as a whole
    uint nearest = image_index(f, uvec2(pixel));
    float depth = INFINITY;
    for (int k = 0; k < 9; k++) {
        ivec2 q = pixel + ivec2(k % 3, k / 3) - 1;
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, ivec2(f.size)))) continue;
        uint tap = image_index(f, uvec2(q));
        float d = uintBitsToFloat(LOAD_PAIR(f.guide, tap).x);
        if (d < depth) {
            depth = d;
            nearest = tap;
        }
    }
    vec3 before;
    vec2 now;
    if (depth < INFINITY) {
        before = is_null(f.previous_position) ? surface_position(f, nearest) : load_vec3(f.previous_position, nearest);
        now = sample_place(f, vec2(nearest % f.size.x, nearest / f.size.x));
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
    ivec2 pixel = ivec2(at % f.size.x, at / f.size.x);
    vec4 now = value_at(p, f, at), resolved = now;
    float frames = 1.0;
    if (p.has_history != 0u && p.most_frames > 1.0 && f.still != 0u) {
        vec4 a = uintBitsToFloat(Quads(p.previous_history).v[2u * at]), b = uintBitsToFloat(Quads(p.previous_history).v[2u * at + 1u]);
        frames = a.w + 1.0;
        resolved = mix(vec4(a.rgb, b.x), now, 2.0 / (frames + 1.0));
    } else if (p.has_history != 0u && p.most_frames > 1.0) {
        vec2 before;
        if (previous_pixel(f, pixel, before)) {
            vec4 sum = vec4(0.0), squares = vec4(0.0);
            float n = 0.0;
            for (int k = 0; k < 9; k++) {
                ivec2 q = pixel + ivec2(k % 3, k / 3) - 1;
                if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, ivec2(f.size)))) continue;
                vec4 v = value_at(p, f, image_index(f, uvec2(q)));
                sum += v;
                squares += v * v;
                n += 1.0;
            }
            vec4 mean = sum / n, width = p.clamp_width * sqrt(max(squares / n - mean * mean, vec4(0.0)));
            float past;
            vec4 history = max(clipped(resolved_at(p, f, before, past), mean, width), vec4(0.0));
            frames = min(past + 1.0, p.most_frames);
            resolved = mix(history, now, 1.0 / frames);
        }
    }
    QuadImage to = QuadImage(p.history);
    to.v[2u * at] = floatBitsToUint(vec4(resolved.rgb, frames));
    to.v[2u * at + 1u] = floatBitsToUint(vec4(resolved.a, 0.0, 0.0, 0.0));

    if (!is_null(p.rest)) {
        Rest own = load_rest(p.rest, at);
        float differences = 0.0, error = 0.0, n = 0.0;
        ivec2 lower = max(pixel - BIAS_RADIUS, ivec2(0)), upper = min(pixel + BIAS_RADIUS, ivec2(f.size) - 1);
        for (int y = lower.y; y <= upper.y; y++) {
            for (int x = lower.x; x <= upper.x; x++) {
                uint tap = image_index(f, uvec2(x, y));
                Rest r = load_rest(p.rest, tap);
                if (r.frames < 2.0) continue;
                vec3 d = value_at(p, f, tap).rgb - r.mean;
                differences += dot(d, d);
                error += rest_error(r);
                n += 1.0;
            }
        }
        if (n > 0.0 && own.frames >= 2.0) {
            // of the filtered image: what noise does not explain of the differences; a few equal samples say little about noise
            float share = differences > error ? (differences - error) / differences : 0.0;
            share *= clamp((own.frames - FEW_FRAMES) / FEW_FRAMES, 0.0, 1.0);
            share = max(share, own.samples / (own.samples + TAKE_OVER_SAMPLES));
            resolved = mix(resolved, vec4(own.mean, own.coverage), share);
        }
    }
    QuadImage(p.resolved).v[at] = floatBitsToUint(resolved);
}
