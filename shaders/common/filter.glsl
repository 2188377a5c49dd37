// The mean over a pixel's neighbours on the same surface, weighted by their samples, so that pixels without samples get their value
// from neighbours (joint bilateral upsampling; Kopf, Cohen, Lischinski, Uyttendaele 2007). The kernel is a box whose radius is just large enough for
// the mean to have `filter_samples` samples; or its two axes one after the other; or a small box repeatedly with strides that
// double (a trous; Dammertz, Sewtz, Hanika, Lensch, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering",
// HPG 2010).
//
// How far the pixels in the box differ by more than their noise says how much of the difference between pixel and box is detail;
// the pixel keeps that share of its own value (Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", PAMI
// 1980), and a little more: a few pixels tell their spread badly (James, Stein, "Estimation with Quadratic Loss", 1961). Weights are 0
// or a number of samples: nothing crosses an edge, and a constant stays what it is.
//
// The including shader defines what is filtered, a VALUE of one or several channels, and an ESTIMATE of it, with a mean, the
// number of samples behind it and the variance of one. Furthermore:
//   uint filtered_pixel()                          the pixel of this thread
//   ESTIMATE load_estimate(image, at)
//   ESTIMATE estimate_of(own, mean, n, variance)   a pixel's estimate with another mean, number of samples and variance
//   bool is_neighbour(edge, offset, own, guide)    whether two pixels show the same surface
//   VALUE prior_variance(mean, spread, samples)    the variance to assume while there are few samples: from the mean of a box,
//                                                  the variance of its pixels and the samples per pixel
//   int limited(radius, p, own)                    the radius, or a smaller one for this pixel
//   float total(value)                             a sum over channels
//   ESTIMATE guess(p, f, image, pixel, own)        the value of a pixel without samples in its box
//   void finish(p, f, at, estimate, bent)          writes the result; finish_nothing(p, f, at): for a pixel that is not filtered
//   PRIOR_SAMPLES                                  weight of the prior variance, in samples
//   LONELY                                         a pixel whose box has fewer samples of its surface than this also takes those of surfaces whose normals
//                                                  and planes differ a little more
#ifndef COMMON_FILTER
#define COMMON_FILTER
#include "common/frame.glsl"
#include "interface/passes.glsl"

const float LONELY_COSINE = 0.5;
const float LONELY_TOLERANCE = 2.0;

// n times the variance of the mean of n samples, by that of one: 1 of random ones, and less where a sequence fills the square evenly
// and what is sampled is smooth, as it is with a falloff (Sequence::evenness in src/sampling/sequence.rs).
float mean_variance(FilterParams p, float n) {
    return p.evenness > 0.0 ? pow(max(n, 1.0), -p.evenness) : 1.0;
}

// Radius in pixels.
int box_radius(FilterParams p, float samples) {
    float side = sqrt(p.samples / max(samples, 0.25));
    return int(clamp(ceil(0.5 * (side - 1.0)), 0.0, float(p.radius)));
}

vec3 load_bent(FilterParams p, uint at) {
    return load_vec3(p.bent_from, at);
}

void main() {
    uint at = filtered_pixel();
    if (at >= push.count) return;
    FilterParams p = FilterParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    uvec2 own_guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(own_guide)) {
        finish_nothing(p, f, at);
        return;
    }
    uvec2 guides = f.guide, estimates = p.from;
    ESTIMATE own = load_estimate(estimates, at);
    vec3 own_bent = BENT_NORMALS ? load_bent(p, at) : vec3(0.0);
    int stride = int(p.stride);
    // a step with strides has a fixed radius; it is skipped where there are enough samples
    int radius = limited(stride > 1 ? (own.samples < p.samples ? int(p.radius) : 0) : box_radius(p, own.samples), p, own);
    if (radius == 0) {
        finish(p, f, at, own, own_bent);
        return;
    }
    uint width = f.size.x;
    ivec2 pixel = ivec2(at % width, at / width);
    EdgeTest edge = edge_test(f, f.world_to_camera, f.view, f.orthographic != 0u, surface_position(f, at), surface_normal(f, at), sample_place(f, vec2(pixel)));
    ivec2 reach = radius * ivec2(p.sides & STEP_HORIZONTAL, (p.sides & STEP_VERTICAL) >> 1);
    // taps within the image
    ivec2 lower = max(-reach, -(pixel / stride)), upper = min(reach, (ivec2(f.size) - 1 - pixel) / stride);
    VALUE sum, squares, variances;
    float n, count, noise;
    vec3 bent;
    for (int attempt = 0; attempt < 2; attempt++) {
        sum = squares = variances = VALUE(0.0);
        n = count = noise = 0.0;
        bent = vec3(0.0);
        for (int y = lower.y; y <= upper.y; y++) {
            for (int x = lower.x; x <= upper.x; x++) {
                ivec2 offset = stride * ivec2(x, y);
                uint tap = uint(int(at) + offset.y * int(width) + offset.x);
                if (!is_neighbour(edge, vec2(offset), own_guide, LOAD_PAIR(guides, tap))) continue;
                ESTIMATE e = load_estimate(estimates, tap);
                sum += e.mean * e.samples;
                squares += e.mean * e.mean * e.samples;
                variances += e.variance * e.samples;
                if (BENT_NORMALS) bent += load_bent(p, tap) * e.samples;
                n += e.samples;
                count += e.samples > 0.0 ? 1.0 : 0.0;
                // its samples times the variance of their mean
                noise += e.samples > 0.0 ? mean_variance(p, e.samples) : 0.0;
            }
        }
        if (n >= LONELY) break;
        // geometry as fine as pixels: neighbours that are nearly so, rather than next to nothing
        edge.cosine = LONELY_COSINE;
        edge.tolerance *= LONELY_TOLERANCE;
    }
    if (n == 0.0) {
        finish(p, f, at, guess(p, f, estimates, pixel, own), own_bent);
        return;
    }
    VALUE mean = sum / n;
    VALUE spread = max(squares / n - mean * mean, VALUE(0.0));
    // about their own pixels' means, so that each pixel has one less to tell
    VALUE variance = (variances + prior_variance(mean, spread, n / max(count, 1.0)) * PRIOR_SAMPLES) / (max(n - count, 0.0) + PRIOR_SAMPLES);
    float keep = 0.0;
    if (own.samples > 0.0) {
        float own_noise = total(variance) * mean_variance(p, own.samples) / own.samples;
        // of the pixel about the box: detail, which is what noise does not explain of the spread, and its own noise
        float unlike = total(spread) * count / max(count - 1.0, 1.0) - total(variance) * noise / n + own_noise;
        // with 3 of `count` pixels taken off, the sum of squared errors of what is kept is never above that of the pixels as they are;
        // so it is for histories that are as long as they get. For short ones it is too careful, and 1 does better.
        float careful = 1.0 + 2.0 * min(own.samples / f.most_samples, 1.0);
        keep = unlike > 0.0 ? clamp(1.0 - max(count - careful, 0.0) / count * own_noise / unlike, 0.0, 1.0) : 0.0;
    }
    finish(p, f, at, estimate_of(own, mix(mean, own.mean, keep), mix(n, own.samples, keep), variance), mix(bent / n, own_bent, keep));
}

#endif
