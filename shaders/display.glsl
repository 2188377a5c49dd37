// display: converts a buffer of the frame to 8-bit sRGB: a word per pixel, red in the lowest byte, opaque.
//
// Every buffer becomes a linear colour first, is multiplied by the exposure, and is then encoded. The bytes are those of
// src/colour.rs on any device: a driver's power function only gives an approximate byte, and the smallest values that the host encodes as
// this byte and the next one decide.
#include "common/frame.glsl"
#include "interface/display.glsl"
#include "interface/shown.glsl"
#include "common/srgb.glsl"
#include "common/tone_map.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer DisplayWords { uint v[]; };

// Maximum variance of samples in [0, 1].
const float WHITE_VARIANCE = 0.25;
// Motion in pixels that is shown by half of the range of colours.
const float MIDDLE_MOTION = 8.0;

uint srgb_byte(uvec2 thresholds, float linear) {
    // also for NaN
    if (!(linear > 0.0)) return 0u;
    if (linear >= 1.0) return 255u;
    float coded = srgb_encode(linear);
    uint byte = min(uint(255.0 * max(coded, 0.0) + 0.5), 255u);
    Floats smallest = Floats(thresholds);
    if (linear < smallest.v[byte]) return byte - 1u;
    return byte < 255u && linear >= smallest.v[byte + 1u] ? byte + 1u : byte;
}

// Maps to a space that repeats every two units, without a discontinuity.
vec3 fold(vec3 v) {
    return abs(2.0 * fract(0.5 * v) - 1.0);
}

// A colour for the 8 bits of an id: its hue by the golden ratio, so that similar ids differ most, and three steps of saturation and brightness.
vec3 id_colour(uint id) {
    vec3 hue = clamp(abs(fract(float(id) * 0.61803399 + vec3(0.0, 2.0, 1.0) / 3.0) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
    return mix(vec3(1.0), hue, 0.45 + 0.25 * float(id % 3u)) * (1.0 - 0.3 * float(id / 3u % 3u));
}

// Motion of a pixel's surface in the image since the previous frame, pixels.
vec2 motion(FrameParams f, uint at) {
    if (f.still != 0u) return vec2(0.0);
    vec3 before = is_null(f.previous_position) ? surface_position(f, at) : load_vec3(f.previous_position, at);
    vec3 c = affine(f.previous_world_to_camera, before);
    bool orthographic = f.previous_orthographic != 0u;
    // behind the previous camera
    if (!orthographic && !(c.z < 0.0)) return vec2(0.0);
    vec2 now = sample_place(f, vec2(image_pixel(f, at)));
    return now - image_point(f, f.previous_view, orthographic ? c.xy : c.xy / -c.z);
}

vec3 colour(DisplayParams d, FrameParams f, uint at) {
    if (d.shown == SHOWN_RESULT && !is_null(d.resolved)) return uintBitsToFloat(Quads(d.resolved).v[at].xyz);
    if (d.shown == SHOWN_RESULT || d.shown == SHOWN_UNFILTERED && d.has_history == 0u) return vec3(FloatImage(d.result).v[at]);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) return vec3(0.0);
    if (d.shown == SHOWN_DEPTH) return vec3(d.unit / (d.unit + uintBitsToFloat(guide.x)));
    if (d.shown == SHOWN_NORMAL) return 0.5 + 0.5 * surface_normal(f, at);
    if (d.shown == SHOWN_POSITION) return fold(surface_position(f, at) / d.unit);
    if (d.shown == SHOWN_BENT) return 0.5 + 0.5 * load_vec3(d.bent, at);
    if (d.shown == SHOWN_IDS) return id_colour(guide.y >> 24);
    if (d.shown == SHOWN_MOTION) {
        vec2 m = motion(f, at);
        return vec3(0.5 + 0.5 * m / (abs(m) + MIDDLE_MOTION), 0.5);
    }
    if (d.shown == SHOWN_RAYS) return vec3(unpack_estimate(LOAD_PAIR(d.current, at)).samples / d.rays_per_pixel);
    Estimate e = unpack_estimate(LOAD_PAIR(d.history, at));
    if (d.shown == SHOWN_SAMPLES) return vec3(e.samples / f.most_samples);
    return vec3(d.shown == SHOWN_VARIANCE ? e.variance / WHITE_VARIANCE : e.mean);
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    DisplayParams d = DisplayParams(push.pass);
    vec3 linear = colour(d, FrameParams(d.frame), at) * d.gain;
    bool is_radiance = (d.flags & DISPLAY_RADIANCE) != 0u && d.shown == SHOWN_RESULT;
    if (is_radiance) linear = tone_mapped(d.tone_map, linear);
    uint red = srgb_byte(d.thresholds, linear.r);
    uint word = 0xff000000u | red * 0x010101u;
    if (is_radiance || d.shown >= SHOWN_NORMAL) word = 0xff000000u | red | srgb_byte(d.thresholds, linear.g) << 8 | srgb_byte(d.thresholds, linear.b) << 16;
    DisplayWords(d.words).v[at] = word;
}
