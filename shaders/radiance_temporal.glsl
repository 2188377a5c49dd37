// radiance_temporal: reprojects the histories of a pixel's diffuse reflection and of the rest, and adds this frame's samples to them (temporal.glsl is the same for
// ambient visibility).
//
// Diffuse reflection does not depend on the view and moves with its surface. What smooth surfaces reflect moves as if it was behind them, at its distance (Zimmer et al., "Path-space Motion
// Estimation and Decomposition for Robust Animation Filtering", EGSR 2015; here for flat mirrors). The rest depends on the view, so its history is clamped to
// this frame's samples nearby whenever the camera moves; both where objects have moved.
#include "common/radiance.glsl"
#include "common/reprojection.glsl"
#include "common/rest_parts.glsl"
#include "interface/path.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

// Minimum relative variance of samples while it is not known yet: a few equal samples say little.
const float MIN_RELATIVE_VARIANCE = 0.02;
// Radius in pixels of the neighbourhood to which a history is clamped.
const int CLAMP_RADIUS = 2;
// Roughness below which reflections move as what they show does, and not as their surface.
const float MIRROR_ROUGHNESS = 0.35;
// Roughness from which the filter's box is not narrowed.
const float WIDE_ROUGHNESS = 0.5;
// A mirror is not filtered at all.
const float SHARP_ROUGHNESS = 0.04;
// By how many frames more a history of one frame is shortened where interpolation has blurred it by one square pixel.
const float BLUR_WEIGHT = 0.1;
// Strength with which a change of view shortens histories of what is not reflected diffusely: change of the signal, relative to it, where the view turns by the width of the lobe.
const float TURN_WEIGHT = 8.0;
// Frames for which a history counts that is off by as much as the noise of the mean which tells that.
const float CHANGE_TOLERANCE = 4.0;
// Pixels with samples below which nothing is known of that, and frames for which a history counts there.
const float FEW_PIXELS = 4.0;
const float UNKNOWN_FRAMES = 0.5;
// Standard deviations by which a pixel's samples must differ from its history to be a step of light, and the same as a share of the brighter of both.
const float STEP_DEVIATIONS = 3.0;
const float LEAST_STEP = 0.15;
// Samples as which the noise nearby counts beside what a history says of its own.
const float NEARBY_SAMPLES = 4.0;
// Pixels next to one that must have stepped likewise: of those that have become darker, and brighter. Light that is rare reaches single pixels, and the edges of shadows are lines.
const int LEAST_DARKER = 1;
const int LEAST_BRIGHTER = 2;
// Pixels between the taps by which histories are compared with samples at rest.
const int AGREEMENT_STRIDE = 2;
// Share of older samples from which they are compared.
const float LEAST_OLD_SHARE = 1.0 / 64.0;

float brightness(vec3 c) { return c.r + c.g + c.b; }

// The direction in the world of what is at `c` in camera space, from the camera.
vec3 view_direction(vec4 world_to_camera[3], bool orthographic, vec3 c) {
    if (orthographic) c = vec3(0.0, 0.0, -1.0);
    return normalize(world_to_camera[0].xyz * c.x + world_to_camera[1].xyz * c.y + world_to_camera[2].xyz * c.z);
}

// By how much the direction to a point from the camera has turned, radians.
float view_change(FrameParams f, vec3 position, vec3 before) {
    vec3 now = view_direction(f.world_to_camera, f.orthographic != 0u, affine(f.world_to_camera, position));
    vec3 then = view_direction(f.previous_world_to_camera, f.previous_orthographic != 0u, affine(f.previous_world_to_camera, before));
    return length(now - then);
}

RadianceEstimate history_at(uvec2 image, Taps taps) {
    RadianceEstimate e = NO_RADIANCE;
    float weight = 0.0;
    [[unroll]] for (int k = 0; k < 4; k++) {
        float w = taps.weight[k];
        if (w == 0.0) continue;
        RadianceEstimate tap = load_radiance(image, taps.at[k]);
        if (!(tap.samples > 0.0)) continue;
        weight += w;
        e.mean += w * tap.mean;
        e.samples += w * tap.samples;
        e.variance += w * tap.variance;
    }
    if (weight < MIN_TAP_WEIGHT) return NO_RADIANCE;
    return RadianceEstimate(e.mean / weight, e.samples / weight, e.variance / weight, 0.0);
}

// A history between pixels is blurred by the interpolation, in every frame anew.
RadianceEstimate less_blurred(FrameParams f, RadianceEstimate e, vec2 place) {
    vec2 t = fract(place), blur = t * (1.0 - t);
    e.samples /= 1.0 + BLUR_WEIGHT * (blur.x + blur.y) * e.samples / float(f.rays_per_pixel);
    return e;
}

// A history, clamped to the mean of this frame's samples nearby, give or take their standard deviations.
vec3 clamped(RadianceTemporalParams p, FrameParams f, uvec2 image, uvec2 pixel, EdgeTest edge, vec3 history) {
    vec3 sum = vec3(0.0), squares = vec3(0.0);
    float n = 0.0;
    ivec2 lower = max(ivec2(pixel) - CLAMP_RADIUS, ivec2(0)), upper = min(ivec2(pixel) + CLAMP_RADIUS, ivec2(f.size) - 1);
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            uint tap = image_index(f, uvec2(x, y));
            RadianceEstimate e = load_radiance(image, tap);
            if (e.samples == 0.0 || !same_surface(edge, vec2(ivec2(x, y) - ivec2(pixel)), LOAD_PAIR(f.guide, tap))) continue;
            sum += e.mean;
            squares += e.mean * e.mean;
            n += 1.0;
        }
    }
    if (n == 0.0) return history;
    vec3 mean = sum / n, width = p.clamp_width * sqrt(max(squares / n - mean * mean, vec3(0.0)));
    return clamp(history, mean - width, mean + width);
}

// This frame's samples around a pixel against their histories.
struct Differences {
    vec3 sum, squares, variance;  // over pixels: of the differences, and the variance that the earlier samples lead to expect of this frame's
    float count;
    float noise, deviation, freedom;  // of earlier samples: sums of squared deviations and of standard deviations, and how many samples they are worth
};

// `motion`: pixels from a pixel to where its history is.
Differences differences(FrameParams f, uvec2 image, uvec2 previous, uvec2 pixel, ivec2 motion, EdgeTest edge) {
    Differences around = Differences(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, 0.0);
    ivec2 last = ivec2(f.size) - 1, lower = max(ivec2(pixel) - CLAMP_RADIUS, max(-motion, ivec2(0))), upper = min(ivec2(pixel) + CLAMP_RADIUS, min(last - motion, last));
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            uint tap = image_index(f, uvec2(x, y));
            RadianceEstimate now = load_radiance(image, tap), then = load_radiance(previous, image_index(f, uvec2(ivec2(x, y) + motion)));
            if (now.samples == 0.0 || then.samples == 0.0 || !same_surface(edge, vec2(ivec2(x, y) - ivec2(pixel)), LOAD_PAIR(f.guide, tap))) continue;
            vec3 difference = now.mean - then.mean;
            around.sum += difference;
            around.squares += difference * difference;
            around.variance += then.variance / now.samples;
            around.count += 1.0;
            float freedom = max(then.samples - 1.0, 0.0);
            float noise = brightness(then.variance) * then.samples;
            around.noise += noise;
            around.deviation += sqrt(noise * freedom);
            around.freedom += freedom;
        }
    }
    return around;
}

// Whether a pixel's samples differ from its history by more than noise: 1 where they are brighter, -1 where they are darker, else 0. `nearby`: variance of the samples of pixels around, against which darker and brighter ones are held.
float step_at(FrameParams f, uvec2 image, uvec2 previous, ivec2 pixel, ivec2 motion, vec2 nearby) {
    ivec2 before = pixel + motion;
    if (any(lessThan(min(pixel, before), ivec2(0))) || any(greaterThanEqual(max(pixel, before), ivec2(f.size)))) return 0.0;
    RadianceEstimate now = load_radiance(image, image_index(f, uvec2(pixel))), then = load_radiance(previous, image_index(f, uvec2(before)));
    if (now.samples == 0.0 || then.samples == 0.0) return 0.0;
    float a = brightness(now.mean), b = brightness(then.mean), least = LEAST_STEP * max(a, b);
    // of brightness, whose channels may all vary alike
    float variance = 3.0 * (NEARBY_SAMPLES * (a < b ? nearby.x : nearby.y) + brightness(then.variance) * then.samples) / (NEARBY_SAMPLES + max(then.samples - 1.0, 0.0));
    float expected = STEP_DEVIATIONS * STEP_DEVIATIONS * variance * (1.0 / now.samples + 1.0 / then.samples);
    return (a - b) * (a - b) > expected + least * least ? sign(a - b) : 0.0;
}

// Whether light has changed from one frame to the next at a pixel and at others beside it: 1 to more, -1 to less, else 0. The mean over more pixels does not tell where a thin shadow has come, and from where it has gone.
float light_step(FrameParams f, uvec2 image, uvec2 previous, uvec2 pixel, ivec2 motion, Differences around) {
    if (!(around.freedom > 0.0)) return 0.0;
    // what has become brighter may be light that is rare, and is held against all of the noise; few pixels in which a shadow has come or gone have most of it
    float deviation = around.deviation / around.freedom;
    vec2 nearby = vec2(deviation * deviation, around.noise / around.freedom);
    float own = step_at(f, image, previous, ivec2(pixel), motion, nearby);
    if (own == 0.0) return 0.0;
    int alike = 0;
    for (int k = 0; k < 9; k++) {
        if (k != 4 && step_at(f, image, previous, ivec2(pixel) + ivec2(k % 3, k / 3) - 1, motion, nearby) == own) alike++;
    }
    return alike >= (own < 0.0 ? LEAST_DARKER : LEAST_BRIGHTER) ? own : 0.0;
}

// No history where light has changed in one step.
RadianceEstimate after_step(RadianceEstimate history, float step_) {
    return step_ == 0.0 ? history : RadianceEstimate(vec3(0.0), 0.0, vec3(0.0), step_ < 0.0 ? LIGHT_DARKENED : LIGHT_BRIGHTENED);
}

// For how many frames a history counts after lights or materials have changed: CHANGE_TOLERANCE e / b^2. The bias b is the mean of the differences between this frame's samples and histories in the pixels nearby, without what
// the noise e of that mean explains. The noise is that of the differences, or what the variance of earlier samples leads to expect where that is more: where light is rare, all samples of a frame may miss it.
float frames_worth(Differences around) {
    float n = around.count;
    if (n < FEW_PIXELS) return UNKNOWN_FRAMES;
    vec3 mean = around.sum / n;
    float noise = dot(max(around.squares / n - mean * mean, around.variance / n), vec3(1.0 / n));
    float squared_bias = dot(mean, mean) - noise;
    // also of equal values without noise, and of squares beyond what floats hold
    return squared_bias > 0.0 ? CHANGE_TOLERANCE * noise / squared_bias : INFINITY;
}

// A history after lights or materials have changed.
RadianceEstimate after_change(FrameParams f, RadianceEstimate history, uvec2 image, uvec2 previous, uvec2 pixel, ivec2 motion, EdgeTest edge) {
    if (!(history.samples > 0.0)) return history;
    Differences around = differences(f, image, previous, pixel, motion, edge);
    history.samples = min(history.samples, float(f.rays_per_pixel) * frames_worth(around));
    return after_step(history, light_step(f, image, previous, pixel, motion, around));
}

// The share of a history that is older than the samples at rest.
float old_share(RadianceEstimate history, Rest rest) { return clamp(1.0 - rest.samples / max(history.samples, 1e-6), 0.0, 1.0); }

// How far a tap's history is from the samples at rest, relative to both, and how far their noise alone puts it. Squares.
vec2 difference(RadianceEstimate history, RadianceEstimate rest) {
    if (!(history.samples > 0.0) || !(rest.samples > 0.0)) return vec2(0.0);
    vec3 d = history.mean - rest.mean;
    float m = brightness(history.mean) + brightness(rest.mean);
    return vec2(dot(d, d), brightness(rest.variance) / rest.samples) / max(m * m, 1e-20);
}

// By how much less the older samples count, because they differ from those at rest by more than noise explains. With a share k of older samples, whose bias is b, a history differs by
// k^2 (b^2 + v / older + v / n) from the mean of n samples at rest, and the best weight of the older ones is (v / n) / (b^2 + v / older + v / n).
vec2 agreement(RadianceTemporalParams p, FrameParams f, uint at, vec2 share) {
    if (max(share.x, share.y) < LEAST_OLD_SHARE) return vec2(0.0);
    ivec2 pixel = ivec2(image_pixel(f, at));
    vec2 diffuse = vec2(0.0), specular = vec2(0.0);
    for (int k = 0; k < 9; k++) {
        ivec2 q = pixel + AGREEMENT_STRIDE * (ivec2(k % 3, k / 3) - 1);
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, ivec2(f.size)))) continue;
        uint tap = image_index(f, uvec2(q));
        Rest rest = load_rest(p.rest, tap);
        if (rest.frames < 2.0) continue;
        RestParts parts = load_parts(p.rest_parts, tap);
        diffuse += difference(load_radiance(p.previous_diffuse, tap), diffuse_at_rest(rest, parts));
        specular += difference(load_radiance(p.previous_specular, tap), specular_at_rest(rest, parts));
    }
    return clamp(share * vec2(diffuse.y, specular.y) / max(vec2(diffuse.x, specular.x), vec2(1e-20)), vec2(0.0), vec2(1.0));
}

// Samples at rest, of `n` with those that met no surface, and as much of older ones as `share` says.
RadianceEstimate rested(RadianceEstimate history, RadianceEstimate rest, float n, float share) {
    if (!(rest.samples > 0.0) || !(history.samples > 0.0)) return rest;
    // of the history: it has older samples besides those at rest
    float k = clamp(share / max(1.0 - n / history.samples, 1e-6), 0.0, 1.0);
    return RadianceEstimate(mix(rest.mean, history.mean, k), rest.samples / max(1.0 - share, 1e-3), mix(rest.variance, history.variance, k), 0.0);
}

// At rest there is no limit to samples.
RadianceEstimate added(FrameParams f, RadianceEstimate past, RadianceEstimate now, float most_past, bool rests) {
    past.samples = min(past.samples, most_past);
    if (!rests) past.samples = min(past.samples, max(f.most_samples - now.samples, 0.0));
    if (!(now.samples > 0.0)) return past;
    if (!(past.samples > 0.0)) return now;
    return all_samples(past, now);
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    RadianceTemporalParams p = RadianceTemporalParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) {
        // the next sample of the same pixel may show a surface again
        bool rests = f.has_history != 0u && f.still != 0u;
        store_radiance(p.diffuse_history, at, rests ? load_radiance(p.previous_diffuse, at) : NO_RADIANCE);
        store_radiance(p.specular_history, at, rests ? load_radiance(p.previous_specular, at) : NO_RADIANCE);
        return;
    }
    float roughness = uintBitsToFloat(Quads(p.materials).v[at].w);
    RadianceEstimate diffuse = NO_RADIANCE, specular = NO_RADIANCE;
    if (f.has_history != 0u && f.still != 0u) {
        diffuse = load_radiance(p.previous_diffuse, at);
        specular = load_radiance(p.previous_specular, at);
    } else if (f.has_history != 0u) {
        uvec2 pixel = image_pixel(f, at);
        vec3 position = surface_position(f, at), normal = surface_normal(f, at);
        vec3 before = is_null(f.previous_position) ? position : load_vec3(f.previous_position, at);
        uint id = guide.y >> 24;
        vec2 place, shift = f.previous_offset - f.offset;
        ivec2 diffuse_motion = ivec2(0), specular_motion = ivec2(0);
        if (previous_place(f, before, place)) {
            EdgeTest edge = with_normal(previous_edge(f, before, normal, place), guide);
            Taps taps = taps_around(f, place + shift, place, edge, id);
            diffuse = less_blurred(f, history_at(p.previous_diffuse, taps), place + shift);
            diffuse_motion = to_int(round(place + shift)) - ivec2(pixel);
            float reflected = FloatImage(p.distances).v[at];
            if (roughness < MIRROR_ROUGHNESS && reflected >= 0.0) {
                vec3 eye = vec3(f.camera_to_world[0].w, f.camera_to_world[1].w, f.camera_to_world[2].w);
                vec3 back = vec3(f.camera_to_world[0].z, f.camera_to_world[1].z, f.camera_to_world[2].z);
                vec3 w = f.orthographic != 0u ? -back : normalize(position - eye);
                vec2 there;
                if (previous_place(f, before + w * reflected, there)) taps = taps_around(f, there + shift, place, edge, id);
                else taps = NO_TAPS;
                place = there;
            }
            specular = less_blurred(f, history_at(p.previous_specular, taps), place + shift);
            specular_motion = to_int(round(place + shift)) - ivec2(pixel);
        }
        EdgeTest edge = with_normal(edge_test(f, f.world_to_camera, f.view, f.orthographic != 0u, position, normal, sample_place(f, vec2(pixel))), guide);
        if (p.most_past < INFINITY) {
            diffuse = after_change(f, diffuse, p.diffuse, p.previous_diffuse, pixel, diffuse_motion, edge);
            specular = after_change(f, specular, p.specular, p.previous_specular, pixel, specular_motion, edge);
        }
        float change = p.moved_count > 0u ? p.moved_weight * possible_change(p.moved, p.moved_count, f, position, normal) : 0.0;
        // most pixels have not stepped, whatever the noise nearby
        if (change > 0.0 && diffuse.samples > 0.0 && !(p.most_past < INFINITY) && step_at(f, p.diffuse, p.previous_diffuse, ivec2(pixel), diffuse_motion, vec2(0.0)) != 0.0) {
            Differences around = differences(f, p.diffuse, p.previous_diffuse, pixel, diffuse_motion, edge);
            diffuse = after_step(diffuse, light_step(f, p.diffuse, p.previous_diffuse, pixel, diffuse_motion, around));
        }
        if (change > 0.0 && diffuse.samples > 0.0) {
            // as ambient visibility: relative to the signal
            float m = max(brightness(diffuse.mean), 1e-20);
            diffuse.samples = samples_after(diffuse.samples, change, max(brightness(diffuse.variance) / (m * m), MIN_RELATIVE_VARIANCE));
            if (p.clamp_width > 0.0) diffuse.mean = clamped(p, f, p.diffuse, pixel, edge, diffuse.mean);
        }
        if (specular.samples > 0.0) {
            // of the width of the lobe; highlights move over curved surfaces in a way that neither kind of reprojection follows
            float turned = TURN_WEIGHT * view_change(f, position, before) / max(2.0 * roughness * roughness, 1e-3);
            float seen = length(vec2(change, turned));
            if (seen > 0.0) {
                float m = max(brightness(specular.mean), 1e-20);
                specular.samples = samples_after(specular.samples, seen, max(brightness(specular.variance) / (m * m), MIN_RELATIVE_VARIANCE));
            }
            if (p.clamp_width > 0.0) specular.mean = clamped(p, f, p.specular, pixel, edge, specular.mean);
        }
    }
    bool rests = f.has_history != 0u && f.still != 0u && !is_null(p.rest);
    float light = min(diffuse.narrowed, 0.0);
    diffuse = added(f, diffuse, load_radiance(p.diffuse, at), p.most_past, rests);
    specular = added(f, specular, load_radiance(p.specular, at), p.most_past, rests);
    if (rests) {
        Rest rest = load_rest(p.rest, at);
        if (rest.frames >= 2.0) {
            RestParts parts = load_parts(p.rest_parts, at);
            vec2 share = vec2(old_share(diffuse, rest), old_share(specular, rest));
            share *= agreement(p, f, at, share);
            diffuse = rested(diffuse, diffuse_at_rest(rest, parts), rest.samples, share.x);
            specular = rested(specular, specular_at_rest(rest, parts), rest.samples, share.y);
        }
    }
    diffuse.narrowed = light;
    specular.narrowed = roughness <= SHARP_ROUGHNESS ? 1.0 : 1.0 - clamp(roughness / WIDE_ROUGHNESS, 0.0, 1.0);
    store_radiance(p.diffuse_history, at, diffuse);
    store_radiance(p.specular_history, at, specular);
}
