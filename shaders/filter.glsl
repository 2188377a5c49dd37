// filter: the mean over a pixel's neighbours on the same surface, each counting by its samples; a box whose radius is just large
// enough that the mean rests on `filter_samples` samples.
//
// How far the histories in the box differ by more than their noise says how much of the difference between pixel and box is detail;
// the pixel keeps that share of its own value (Lee, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics", PAMI
// 1980). Weights are 0 or a number of samples: nothing crosses an edge, and a constant stays what it is.
// compute
#include "common/frame.glsl"

layout(local_size_x = LANES) in;

// Variance of a sample that too few have told of.
const float PRIOR_VARIANCE = 0.1;
const float PRIOR_SAMPLES = 2.0;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    FloatImage result = FloatImage(f.result);
    uvec2 guide = Pairs(f.guide).v[at];
    if (!is_surface(guide)) {
        result.v[at] = 0.0;
        return;
    }
    Estimate own = unpack_estimate(Pairs(f.history).v[at]);
    float side = sqrt(f.filter_samples / max(own.samples, 0.25));
    int radius = int(clamp(ceil(0.5 * (side - 1.0)), 0.0, float(f.filter_radius)));
    if (radius == 0 && own.samples > 0.0) {
        result.v[at] = own.mean;
        return;
    }
    bool orthographic = f.orthographic != 0u;
    ivec2 pixel = ivec2(at % f.size.x, at / f.size.x);
    float depth = uintBitsToFloat(guide.x);
    Plane plane;
    plane.world_normal = unpack_normal(guide.y);
    plane.normal = linear(f.world_to_camera, plane.world_normal);
    plane.distance = dot(plane.normal, unproject(orthographic, image_plane(f, f.view, vec2(pixel) + 0.5), depth));
    plane.tolerance = f.depth_tolerance * footprint(f, f.view, orthographic, depth);
    float sum = 0.0, squares = 0.0, n = 0.0, noise = 0.0, count = 0.0;
    ivec2 lower = max(pixel - radius, ivec2(0)), upper = min(pixel + radius, ivec2(f.size) - 1);
    for (int y = lower.y; y <= upper.y; y++) {
        for (int x = lower.x; x <= upper.x; x++) {
            uint tap = uint(y) * f.size.x + uint(x);
            uvec2 g = Pairs(f.guide).v[tap];
            if (!same_surface(plane, orthographic, image_plane(f, f.view, vec2(x, y) + 0.5), g, f.normal_tolerance)) continue;
            Estimate e = unpack_estimate(Pairs(f.history).v[tap]);
            if (!(e.samples > 0.0)) continue;
            float variance = (e.variance * e.samples + PRIOR_VARIANCE * PRIOR_SAMPLES) / (e.samples + PRIOR_SAMPLES);
            sum += e.mean * e.samples;
            squares += e.mean * e.mean * e.samples;
            n += e.samples;
            // the variance of a mean, weighted by its samples
            noise += variance;
            count += 1.0;
        }
    }
    if (n == 0.0) {
        result.v[at] = own.samples > 0.0 ? own.mean : 1.0;
        return;
    }
    float mean = sum / n;
    float spread = max(squares / n - mean * mean, 0.0);
    float detail = max(spread - noise / n, 0.0);
    float variance = (own.variance * own.samples + PRIOR_VARIANCE * PRIOR_SAMPLES) / (own.samples + PRIOR_SAMPLES);
    float keep = own.samples > 0.0 ? detail / (detail + variance / own.samples) : 0.0;
    result.v[at] = mix(mean, own.mean, keep);
}
