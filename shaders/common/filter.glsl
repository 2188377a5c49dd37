// The mean over a pixel's neighbours on the same surface, weighted by their samples, so that pixels without samples get their value
// from neighbours (joint bilateral upsampling; Kopf, Cohen, Lischinski, Uyttendaele 2007). The kernel is a box whose radius is just large enough for
// the mean to have FilterParams.samples samples; or a small box repeatedly with strides that double (a trous; Dammertz, Sewtz, Hanika, Lensch, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering",
// HPG 2010).
//
// How far the pixels in the box differ by more than their noise says how much of the difference between pixel and box is detail;
// the pixel keeps that share of its own value (Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", PAMI
// 1980), and a little more: a few pixels tell their spread badly (James, Stein, "Estimation with Quadratic Loss", 1961). Weights are 0
// or a number of samples: nothing crosses an edge, and a constant stays what it is.
//
// The including shader defines what is filtered, a VALUE of one or several channels, and an ESTIMATE of it, with a mean, the
// number of samples behind it and the variance of one. Furthermore:
//   ESTIMATE load_estimate(image, at)
//   ESTIMATE estimate_of(own, mean, n, variance)   a pixel's estimate with another mean, number of samples and variance
//   bool is_neighbour(edge, offset, own, guide, normal)   whether two pixels show the same surface; `normal`: guide_normal() of the second's
//   vec3 edge_normal(normal, guide)                the normal that neighbours' normals are compared with: the surface's, or what the guide has
//   VALUE prior_variance(mean, spread, samples)    the variance to assume while there are few samples: from the mean of a box,
//                                                  the variance of its pixels and the samples per pixel
//   float filter_class(estimate)                   pixels of different classes are not averaged
//   int limited(radius, p, own)                    the radius, or a smaller one for this pixel
//   VALUE noise_variance(own, variance, noisy)     the variance of a pixel's samples, from what its estimate says and from that of its box, which
//                                                  is that of so many noisy pixels among quiet ones
//   COUNTS_NOISY_PIXELS                            whether noise_variance needs their number
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
// How many times less noise than those of its box a pixel has whose noise is another: estimates from a few samples differ by less.
const float QUIET = 8.0;

// n times the variance of the mean of n samples, by that of one: 1 of random ones, and less where a sequence fills the square evenly
// and what is sampled is smooth, as it is with a falloff (Sequence::evenness in src/sampling/sequence.rs).
float mean_variance(FilterParams p, float n) {
    return p.evenness > 0.0 ? pow(max(n, 1.0), -p.evenness) : 1.0;
}

// Radius in pixels.
int box_radius(FilterParams p, float samples) {
    float side = sqrt(p.samples / max(samples, 0.25));
    return to_int(clamp(ceil(0.5 * (side - 1.0)), 0.0, float(p.radius)));
}

vec3 load_bent(FilterParams p, uint at) {
    return load_vec3(p.bent_from, at);
}

// Where a pixel of a thread is: in a square of four, or with strides in a row.
ivec2 place_in_strip(int k) { return FILTER_STRIDES ? ivec2(k, 0) : ivec2(k & 1, k >> 1); }

// A pixel, and what its box adds up to.
struct Filtered {
    ivec2 lower, upper;   // taps within its box and the image, x in pixels from the thread's first one, y in strides; lower.x > upper.x: none, or no more
    EdgeTest edge;
    VALUE sum, squares, variances;
    vec3 bent;
    float n, count, squared_variances;
};

bool is_active(Filtered e) { return e.lower.x <= e.upper.x; }

void stop(inout Filtered e) {
    e.lower = ivec2(1);
    e.upper = ivec2(0);
}

// From how many pixels of its box the variance comes: as many equally noisy ones among pixels without noise would have variances of the same mean and mean square.
float noisy_pixels(Filtered e) {
    float sum = total(e.variances);
    return e.squared_variances > 0.0 ? e.count / e.n * sum * (sum / e.squared_variances) : 0.0;
}

// The result of a pixel from what its box adds up to.
void finish_box(FilterParams p, FrameParams f, uvec2 estimates, uint at, ESTIMATE own, Filtered e) {
    vec3 own_bent = BENT_NORMALS ? load_bent(p, at) : vec3(0.0);
    if (e.n == 0.0) {
        ivec2 pixel = ivec2(image_pixel(f, at));
        finish(p, f, at, guess(p, f, estimates, pixel, own), own_bent);
        return;
    }
    VALUE mean = mean_of(e.sum, e.n);
    VALUE spread = max(e.squares / e.n - mean * mean, VALUE(0.0));
    // about their own pixels' means, so that each pixel has one less to tell
    VALUE variance = (e.variances + prior_variance(mean, spread, e.n / max(e.count, 1.0)) * PRIOR_SAMPLES) / (max(e.n - e.count, 0.0) + PRIOR_SAMPLES);
    float keep = 0.0;
    VALUE kept = VALUE(0.0);
    if (own.samples > 0.0) {
        VALUE own_variance = noise_variance(own, variance, COUNTS_NOISY_PIXELS ? noisy_pixels(e) : 0.0);
        float own_noise = total(own_variance) * mean_variance(p, own.samples) / own.samples;
        // of the pixel about the box: detail, which is what noise does not explain of the spread, and its own noise
        float box_noise = total(variance) * mean_variance(p, e.n / e.count) * e.count / e.n;
        float unlike = total(spread) * e.count / max(e.count - 1.0, 1.0) - box_noise + own_noise;
        // with 3 of `count` pixels taken off, the sum of squared errors of what is kept is never above that of the pixels as they are;
        // so it is for histories that are as long as they get. For short ones it is too careful, and 1 does better.
        float careful = 1.0 + 2.0 * min(own.samples / f.most_samples, 1.0);
        float taken = max(e.count - careful, 0.0) / e.count * own_noise;
        // A few glints may explain all of the spread by their noise. A much quieter pixel is unlike their mean by at least that mean's own noise.
        unlike = max(unlike, taken + max(box_noise - QUIET * own_noise, 0.0) / e.count);
        keep = unlike > 0.0 ? clamp(1.0 - taken / unlike, 0.0, 1.0) : 0.0;
        // The next step weighs the result by all samples of the box, whatever it kept: what it keeps follows values, and weights that do are biased. That it is
        // noisier than their mean, to which its own samples belong, its variance says.
        kept = keep * keep * (own_variance * max(e.n / own.samples, 1.0) - variance);
    }
    // in two products, so that of a mean a billion times as bright nothing is left in what is kept whole
    finish(p, f, at, estimate_of(own, (1.0 - keep) * mean + keep * own.mean, e.n, variance + kept), mix(e.bent / e.n, own_bent, keep));
}

// Each thread filters FILTER_STRIP pixels, whose boxes overlap: a tap is loaded once for all of them. Threads that run together filter tiles
// rather than long rows: their boxes are about as large, and the largest says how long all take.
void main() {
    uint index = push.first + FILTER_STRIP * gl_GlobalInvocationID.x;
    if (index >= push.count) return;
    FilterParams p = FilterParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    ivec2 corner = ivec2(divide(index >> 6, f.tiles_x) * 8u + (FILTER_STRIDES ? uvec2(index & 7u, index >> 3 & 7u) : morton_pixel(index & 63u)));
    if (any(greaterThanEqual(corner, ivec2(f.size)))) return;
    uint first = image_index(f, uvec2(corner));
    uvec2 guides = f.guide, estimates = p.from;
    // strides are powers of two: quotients would be taken one lane at a time
    int width = int(f.size.x), stride = int(p.stride), stride_bits = findMSB(stride);
    Filtered strip[FILTER_STRIP];
    uvec2 own_guides[FILTER_STRIP];
    float own_classes[FILTER_STRIP];
    [[unroll]] for (int k = 0; k < FILTER_STRIP; k++) {
        ivec2 pixel = corner + place_in_strip(k);
        uint at = image_index(f, uvec2(pixel));
        stop(strip[k]);
        if (any(greaterThanEqual(pixel, ivec2(f.size)))) continue;
        own_guides[k] = LOAD_PAIR(guides, at);
        if (!is_surface(own_guides[k])) {
            finish_nothing(p, f, at);
            continue;
        }
        ESTIMATE own = load_estimate(estimates, at);
        own_classes[k] = filter_class(own);
        // a step with strides has a fixed radius; it is skipped where there are enough samples
        int radius = limited(stride > 1 ? (own.samples < p.samples ? int(p.radius) : 0) : box_radius(p, own.samples), p, own);
        if (radius == 0) {
            finish(p, f, at, own, BENT_NORMALS ? load_bent(p, at) : vec3(0.0));
            continue;
        }
        strip[k].edge = edge_test(f, own_guides[k], surface_normal(f, at), sample_place(f, vec2(pixel)));
        strip[k].edge.normal = edge_normal(strip[k].edge.normal, own_guides[k]);
        ivec2 lower = max(ivec2(-radius), -(pixel >> stride_bits)), upper = min(ivec2(radius), (ivec2(f.size) - 1 - pixel) >> stride_bits);
        strip[k].lower = place_in_strip(k) + ivec2(lower.x << stride_bits, lower.y);
        strip[k].upper = place_in_strip(k) + ivec2(upper.x << stride_bits, upper.y);
    }
    for (int attempt = 0; attempt < 2; attempt++) {
        // taps of all
        ivec2 lower = ivec2(1 << 20), upper = ivec2(-(1 << 20));
        [[unroll]] for (int k = 0; k < FILTER_STRIP; k++) {
            if (!is_active(strip[k])) continue;
            lower = min(lower, strip[k].lower);
            upper = max(upper, strip[k].upper);
            strip[k].sum = strip[k].squares = strip[k].variances = VALUE(0.0);
            strip[k].n = strip[k].count = strip[k].squared_variances = 0.0;
            strip[k].bent = vec3(0.0);
        }
        for (int y = lower.y; y <= upper.y; y++) {
            int row = int(first) + y * stride * width;
            // numbers of taps in this row
            uint counts[FILTER_STRIP];
            [[unroll]] for (int k = 0; k < FILTER_STRIP; k++) counts[k] = y >= strip[k].lower.y && y <= strip[k].upper.y ? uint(strip[k].upper.x + 1 - strip[k].lower.x) : 0u;
            for (int x = lower.x; x <= upper.x; x++) {
                uint tap = uint(row + x);
                uvec2 guide = LOAD_PAIR(guides, tap);
                ESTIMATE e = load_estimate(estimates, tap);
                vec3 normal = guide_normal(guide), bent = BENT_NORMALS ? load_bent(p, tap) * e.samples : vec3(0.0);
                VALUE sum = e.mean * e.samples, squares = e.mean * e.mean * e.samples, variances = e.variance * e.samples;
                float count = e.samples > 0.0 ? 1.0 : 0.0, squared_variances = COUNTS_NOISY_PIXELS ? total(e.variance) * total(variances) : 0.0;
                [[unroll]] for (int k = 0; k < FILTER_STRIP; k++) {
                    int dx = x - place_in_strip(k).x;
                    bool is_inside = uint(x - strip[k].lower.x) < counts[k] && (!FILTER_STRIDES || (dx & stride - 1) == 0);
                    // apart: what no lane of a subgroup does is skipped
                    if (!is_inside) continue;
                    if (filter_class(e) != own_classes[k]) continue;
                    if (!is_neighbour(strip[k].edge, vec2(dx, (y - place_in_strip(k).y) * stride), own_guides[k], guide, normal)) continue;
                    strip[k].sum += sum;
                    strip[k].squares += squares;
                    strip[k].variances += variances;
                    if (BENT_NORMALS) strip[k].bent += bent;
                    strip[k].n += e.samples;
                    strip[k].count += count;
                    if (COUNTS_NOISY_PIXELS) strip[k].squared_variances += squared_variances;
                }
            }
        }
        bool is_done = true;
        [[unroll]] for (int k = 0; k < FILTER_STRIP; k++) {
            if (!is_active(strip[k])) continue;
            if (attempt > 0 || strip[k].n >= LONELY) {
                uint at = first + uint(place_in_strip(k).y * width + place_in_strip(k).x);
                finish_box(p, f, estimates, at, load_estimate(estimates, at), strip[k]);
                stop(strip[k]);
                continue;
            }
            // geometry as fine as pixels: neighbours that are nearly so, rather than next to nothing
            strip[k].edge.cosine = LONELY_COSINE;
            strip[k].edge.tolerance *= LONELY_TOLERANCE;
            is_done = false;
        }
        if (is_done) break;
    }
}

#endif
