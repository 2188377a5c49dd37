// rest_samples: adds the samples of a long frame at rest, of ambient visibility, to those since the image came to rest (common/rest.glsl): one thread per pixel, in the order of the samples.
// They lie anywhere within their pixel, as those of a still. Their mean becomes the history of the pixel's surface, and counts little where the pixel shows others, too.
#include "common/frame.glsl"
#include "common/rest.glsl"
#include "interface/ao.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Samples { float v[]; };

// Log2 of the number of samples that count as a group: what one group says differs from the others by noise.
const uint GROUP_BITS = 2u;

// Samples for which the history of a pixel of several surfaces counts.
const float MIXED_SAMPLES = 8.0;

// Returns true if the pixels around show the same surface, so that the pixel shows no other.
bool is_within_surface(FrameParams f, ivec2 pixel, uint at) {
    EdgeTest edge = edge_test(
        f, f.world_to_camera, f.view, f.orthographic != 0u, surface_position(f, at), surface_normal(f, at), sample_place(f, vec2(pixel)));
    uvec2 guides = f.guide;
    ivec2 size = ivec2(f.size);
    for (int k = 0; k < 4; k++) {
        ivec2 off = ivec2(k & 1, ~k & 1) * ((k & 2) - 1), q = pixel + off;
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, size))) continue;
        if (!same_surface(edge, vec2(off), LOAD_PAIR(guides, uint(q.y * size.x + q.x)))) return false;
    }
    return true;
}

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= push.count >> push.sample_bits) return;
    RestSamplesParams p = RestSamplesParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 pixel = tile_pixel(f, (push.first >> push.sample_bits) + k);
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    Rest rest = load_rest(p.rest, at);
    Samples samples = Samples(p.samples);
    uint first = k << push.sample_bits, count = 1u << push.sample_bits, group = min(count, 1u << GROUP_BITS), hits = 0u;
    for (uint s = 0u; s < count; s += group) {
        float sum = 0.0;
        uint covered = 0u, passed = 0u;
        bool is_caught = HAS_CATCHER;
        for (uint i = 0u; i < group; i++) {
            float visibility = samples.v[first + s + i];
            if (HAS_CATCHER) {
                if (visibility == CAUGHT_UNOCCLUDED) {
                    visibility = 1.0;
                    passed++;
                } else if (visibility != 0.0) {
                    is_caught = false;
                }
            }
            // a camera ray that missed counts as 0
            if (visibility < 0.0) continue;
            sum += visibility;
            covered++;
        }
        hits += covered;
        rest = add_rest(rest, vec3(sum / float(group)), float(group), float(covered) / float(group), float(passed) / float(group), is_caught);
    }
    store_rest(p.rest, at, rest);
    if (hits > 0u) atomicAdd(QueueCount(p.ray_count).v[0], hits);

    if (rest.coverage == 0.0) {
        STORE_PAIR(p.history, at, LOAD_PAIR(f.previous_history, at));
        return;
    }
    // of the samples that meet a surface, and of three equal channels
    Estimate history = Estimate(min(rest.mean.r / rest.coverage, 1.0), min(rest.samples, f.most_samples), rest.variance / 3.0 * rest.samples / max(rest.frames - 1.0, 1.0));
    if (rest.coverage < 1.0 || !is_surface(LOAD_PAIR(f.guide, at)) || !is_within_surface(f, ivec2(pixel), at)) {
        // a mean over several surfaces: better than few samples of one, and soon to be replaced by more
        history.samples = min(history.samples, MIXED_SAMPLES);
        history.variance = history.mean * (1.0 - history.mean);
    }
    STORE_PAIR(p.history, at, pack_estimate(history));
}
