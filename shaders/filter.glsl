// filter: the mean over a pixel's neighbours on the same surface, each counting by its samples: so what has no sample yet gets its value
// from what has (joint bilateral upsampling; Kopf, Cohen, Lischinski, Uyttendaele 2007). A box whose radius is just large enough that
// the mean rests on `filter_samples` samples; or its two sides one after the other; or a small box again and again with holes that
// double (a trous; Dammertz, Sewtz, Hanika, Lensch, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering",
// HPG 2010).
//
// How far the histories in the box differ by more than their noise says how much of the difference between pixel and box is detail;
// the pixel keeps that share of its own value (Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", PAMI
// 1980), and a little more: a few pixels tell their spread badly (James, Stein, "Estimation with Quadratic Loss", 1961). Weights are 0
// or a number of samples: nothing crosses an edge, and a constant stays what it is.
// compute
#include "common/frame.glsl"

layout(local_size_x = LANES) in;

// Where few samples have told of their variance, it is taken for that of samples that are 0 or 1: the most it can be. So many samples
// count as few.
const float PRIOR_SAMPLES = 4.0;

// A pixel whose box holds fewer samples of its surface also takes those of surfaces that are turned and offset a little more.
const float LONELY = 6.0;
const float LONELY_COSINE = 0.5;
const float LONELY_TOLERANCE = 2.0;

// n times the variance of the mean of n samples, by that of one: 1 of random ones, and less where a sequence fills the square evenly
// and what is sampled is smooth, as it is with a falloff (Sequence::evenness in src/sampling/sequence.rs).
float mean_variance(FrameParams f, float n) {
    return f.evenness > 0.0 ? pow(max(n, 1.0), -f.evenness) : 1.0;
}

// A step of the filter, in the push constants: estimates from `rays` to `queued`, or accessibility to the result where that is null.
// Sides of the box on which it reaches to the radius, and the distance of its taps.
const uint STEP_HORIZONTAL = 1u;
const uint STEP_VERTICAL = 2u;

// Pixels to each side.
int box_radius(FrameParams f, float samples) {
    float side = sqrt(f.filter_samples / max(samples, 0.25));
    return int(clamp(ceil(0.5 * (side - 1.0)), 0.0, float(push.sample_bits)));
}

// Bent normals beside them are at `bent` of the frame's parameters; from where to where is in `first`.
vec3 load_bent(FrameParams f, uint at) {
    return load_vec3(f.bent[push.first & 3u], at);
}

void finish(FrameParams f, uint at, Estimate e, vec3 bent) {
    if (BENT) {
        bool open = is_null(push.queued) && e.samples == 0.0;
        store_vec3(f.bent[push.first >> 2], at, open ? (2.0 / 3.0) * surface_normal(f, at) : bent);
    }
    if (!is_null(push.queued)) {
        STORE_PAIR(push.queued, at, pack_estimate(e));
        return;
    }
    // where nobody knows: as if nothing were in the way
    FloatImage(f.result).v[at] = e.samples > 0.0 ? e.mean : 1.0;
}

// Of the pixels around, whatever they show: for one that is the only one of its surface, before it has had its turn. A guess, but a
// better one than that nothing is in the way.
Estimate around(FrameParams f, uvec2 estimates, ivec2 pixel) {
    ivec2 lower = max(pixel - 1, ivec2(0)), upper = min(pixel + 1, ivec2(f.size) - 1);
    float sum = 0.0, n = 0.0;
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            // background has no samples
            Estimate e = unpack_estimate(LOAD_PAIR(estimates, uint(y) * f.size.x + uint(x)));
            sum += e.mean * e.samples;
            n += e.samples;
        }
    }
    return n > 0.0 ? Estimate(sum / n, n, 0.0) : Estimate(0.0, 0.0, 0.0);
}

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    if (!is_surface(LOAD_PAIR(f.guide, at))) {
        if (is_null(push.queued)) FloatImage(f.result).v[at] = 0.0;
        else STORE_PAIR(push.queued, at, uvec2(0u));
        if (BENT) store_vec3(f.bent[push.first >> 2], at, vec3(0.0));
        return;
    }
    uvec2 guides = f.guide, estimates = push.rays;
    Estimate own = unpack_estimate(LOAD_PAIR(estimates, at));
    vec3 own_bent = BENT ? load_bent(f, at) : vec3(0.0);
    int stride = int(push.sample_index >> 2);
    // a step with holes is of one size; it is left out where there are samples enough
    int radius = stride > 1 ? (own.samples < f.filter_samples ? int(push.sample_bits) : 0) : box_radius(f, own.samples);
    if (radius == 0) {
        finish(f, at, own, own_bent);
        return;
    }
    uint width = f.size.x;
    ivec2 pixel = ivec2(at % width, at / width);
    EdgeTest edge = edge_test(f, f.world_to_camera, f.view, f.orthographic != 0u, surface_position(f, at), surface_normal(f, at), vec2(pixel) + 0.5);
    ivec2 reach = radius * ivec2(push.sample_index & STEP_HORIZONTAL, (push.sample_index & STEP_VERTICAL) >> 1);
    // taps within the image
    ivec2 lower = max(-reach, -(pixel / stride)), upper = min(reach, (ivec2(f.size) - 1 - pixel) / stride);
    float sum, squares, n, variances, count, noise;
    vec3 bent;
    for (int attempt = 0; attempt < 2; attempt++) {
        sum = squares = n = variances = count = noise = 0.0;
        bent = vec3(0.0);
        for (int y = lower.y; y <= upper.y; y++) {
            for (int x = lower.x; x <= upper.x; x++) {
                ivec2 offset = stride * ivec2(x, y);
                uint tap = uint(int(at) + offset.y * int(width) + offset.x);
                if (!same_surface(edge, vec2(offset), LOAD_PAIR(guides, tap))) continue;
                Estimate e = unpack_estimate(LOAD_PAIR(estimates, tap));
                sum += e.mean * e.samples;
                squares += e.mean * e.mean * e.samples;
                variances += e.variance * e.samples;
                if (BENT) bent += load_bent(f, tap) * e.samples;
                n += e.samples;
                count += e.samples > 0.0 ? 1.0 : 0.0;
                // its samples times the variance of their mean
                noise += e.samples > 0.0 ? mean_variance(f, e.samples) : 0.0;
            }
        }
        if (n >= LONELY) break;
        // geometry as fine as pixels: neighbours that are nearly so, rather than next to nothing
        edge.cosine = LONELY_COSINE;
        edge.tolerance *= LONELY_TOLERANCE;
    }
    if (n == 0.0) {
        finish(f, at, is_null(push.queued) ? around(f, estimates, pixel) : own, own_bent);
        return;
    }
    float mean = sum / n;
    float spread = max(squares / n - mean * mean, 0.0);
    // about their own pixels' means, so that each pixel has one less to tell
    float variance = (variances + mean * (1.0 - mean) * PRIOR_SAMPLES) / (max(n - count, 0.0) + PRIOR_SAMPLES);
    float keep = 0.0;
    if (own.samples > 0.0) {
        float own_noise = variance * mean_variance(f, own.samples) / own.samples;
        // of the pixel about the box: detail, which is what noise does not explain of the spread, and its own noise
        float unlike = spread * count / max(count - 1.0, 1.0) - variance * noise / n + own_noise;
        // with 3 of `count` pixels taken off, the sum of squared errors of what is kept is never above that of the pixels as they are;
        // so it is for histories that are as long as they get. For short ones it is too careful, and 1 does better.
        float careful = 1.0 + 2.0 * min(own.samples / f.most_samples, 1.0);
        keep = unlike > 0.0 ? clamp(1.0 - max(count - careful, 0.0) / count * own_noise / unlike, 0.0, 1.0) : 0.0;
    }
    finish(f, at, Estimate(mix(mean, own.mean, keep), mix(n, own.samples, keep), variance), mix(bent / n, own_bent, keep));
}
