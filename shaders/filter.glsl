// filter: the mean over a pixel's neighbours on the same surface, each counting by its samples; a box whose radius is just large
// enough that the mean rests on `filter_samples` samples.
//
// How far the histories in the box differ by more than their noise says how much of the difference between pixel and box is detail;
// the pixel keeps that share of its own value (Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", PAMI
// 1980). Weights are 0 or a number of samples: nothing crosses an edge, and a constant stays what it is.
// compute
#include "common/frame.glsl"

layout(local_size_x = LANES) in;

// Where few samples have told of their variance, it is taken for that of samples that are 0 or 1: the most it can be. So many samples
// count as few.
const float PRIOR_SAMPLES = 4.0;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    FloatImage result = FloatImage(f.result);
    if (!is_surface(LOAD_PAIR(f.guide, at))) {
        result.v[at] = 0.0;
        return;
    }
    Estimate own = unpack_estimate(LOAD_PAIR(f.history, at));
    float side = sqrt(f.filter_samples / max(own.samples, 0.25));
    int radius = int(clamp(ceil(0.5 * (side - 1.0)), 0.0, float(f.filter_radius)));
    if (radius == 0 && own.samples > 0.0) {
        result.v[at] = own.mean;
        return;
    }
    uvec2 guides = f.guide, histories = f.history;
    uint width = f.size.x;
    ivec2 pixel = ivec2(at % width, at / width);
    EdgeTest edge = edge_test(f, f.world_to_camera, f.view, f.orthographic != 0u, surface_position(f, at), surface_normal(f, at), vec2(pixel) + 0.5);
    ivec2 lower = max(pixel - radius, ivec2(0)), upper = min(pixel + radius, ivec2(f.size) - 1);
    float sum = 0.0, squares = 0.0, n = 0.0, variances = 0.0, count = 0.0;
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            uint tap = uint(y) * width + uint(x);
            if (!same_surface(edge, vec2(ivec2(x, y) - pixel), LOAD_PAIR(guides, tap))) continue;
            Estimate e = unpack_estimate(LOAD_PAIR(histories, tap));
            sum += e.mean * e.samples;
            squares += e.mean * e.mean * e.samples;
            variances += e.variance * e.samples;
            n += e.samples;
            count += e.samples > 0.0 ? 1.0 : 0.0;
        }
    }
    if (n == 0.0) {
        // nobody knows: as if nothing were in the way
        result.v[at] = 1.0;
        return;
    }
    float mean = sum / n;
    float spread = max(squares / n - mean * mean, 0.0);
    // about their own pixels' means, so that each pixel has one less to tell
    float variance = (variances + mean * (1.0 - mean) * PRIOR_SAMPLES) / (max(n - count, 0.0) + PRIOR_SAMPLES);
    // what noise alone makes of the spread: each mean has the variance of a sample by its samples
    float detail = max(spread - variance * count / n, 0.0);
    float keep = own.samples > 0.0 && detail > 0.0 ? detail / (detail + variance / own.samples) : 0.0;
    result.v[at] = mix(mean, own.mean, keep);
}
