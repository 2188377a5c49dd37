// The mean over pixels around that look alike: non-local means (Buades, Coll, Morel, "A non-local algorithm for image denoising", CVPR 2005), for images whose noise is known from
// their samples (Rousselle, Knaus, Zwicker, "Adaptive Rendering with Non-Local Means Filtering", SIGGRAPH Asia 2012). Two pixels are alike if the 3x3 pixels around them differ
// by no more than noise. Edges, textures and detail of geometry are in the image, so that pixels whose surroundings are unlike any plane are averaged, too. Where depths are given, however
// much noise there is nothing crosses an edge between surfaces one behind the other.
//
// Weights only need the noise to the order of magnitude; as it falls, they fall to nothing where there is any difference, and the image converges to what it is without the filter.
//
// The including shader defines a VALUE of one or several channels, BLOCK, the side of the square of pixels of a thread, and
//   VALUE load_value(image, at, out variance)        of a pixel: its value and the variance of that, summed over channels
//   float squared(value)                             a sum of squares over channels
//   void store_value(image, at, value)
#ifndef COMMON_NLMEANS
#define COMMON_NLMEANS
#include "common/types.glsl"
#include "interface/denoise.glsl"

// Half width of the window, pixels.
const int RADIUS = int(NLMEANS_RADIUS);
// A block with the pixels around it that its patches have.
const int PATCHES = BLOCK + 2;
// Difference of depths, as a share of the nearer one, from which two pixels show different surfaces.
const float DEPTH_SHARE = 0.1;
// Smallest variance, so that equal pixels without noise are alike.
const float MIN_NOISE = 1e-9;

// Whether pixels with these depths (`NlMeansParams`) may be averaged.
bool is_same(float a, float b) { return a > 0.0 && b > 0.0 ? abs(a - b) <= DEPTH_SHARE * min(a, b) : a < 0.0 && b < 0.0; }

// Each thread filters BLOCK x BLOCK pixels: patches overlap, so differences of pixels are computed once for all of them.
void main() {
    NlMeansParams p = NlMeansParams(push.pass);
    ivec2 size = ivec2(p.size);
    int across = (size.x + BLOCK - 1) / BLOCK;
    int block = int(push.first + gl_GlobalInvocationID.x);
    if (gl_GlobalInvocationID.x >= push.count) return;
    ivec2 corner = BLOCK * ivec2(block % across, block / across);
    uvec2 image = p.from, depths = p.depths;
    float sameness = p.sameness;
    VALUE own[PATCHES * PATCHES];
    float noise[PATCHES * PATCHES];
    VALUE sum[BLOCK * BLOCK];
    float weight[BLOCK * BLOCK], depth[BLOCK * BLOCK];
    // beyond the image its border is repeated
    [[unroll]] for (int y = 0; y < PATCHES; y++) {
        int row = clamp(corner.y + y - 1, 0, size.y - 1) * size.x;
        [[unroll]] for (int x = 0; x < PATCHES; x++) {
            own[y * PATCHES + x] = load_value(image, uint(row + clamp(corner.x + x - 1, 0, size.x - 1)), noise[y * PATCHES + x]);
        }
    }
    [[unroll]] for (int k = 0; k < BLOCK * BLOCK; k++) {
        sum[k] = VALUE(0.0);
        weight[k] = 0.0;
        ivec2 at = min(corner + ivec2(k % BLOCK, k / BLOCK), size - 1);
        depth[k] = is_null(depths) ? 1.0 : Floats(depths).v[at.y * size.x + at.x];
    }
    for (int dy = -RADIUS; dy <= RADIUS; dy++) {
        for (int dx = -RADIUS; dx <= RADIUS; dx++) {
            float unlike[PATCHES * PATCHES];
            VALUE other[BLOCK * BLOCK];
            [[unroll]] for (int y = 0; y < PATCHES; y++) {
                int row = clamp(corner.y + y - 1 + dy, 0, size.y - 1) * size.x;
                [[unroll]] for (int x = 0; x < PATCHES; x++) {
                    float v;
                    VALUE value = load_value(image, uint(row + clamp(corner.x + x - 1 + dx, 0, size.x - 1)), v);
                    float n = noise[y * PATCHES + x];
                    // what noise explains of the difference is taken off
                    unlike[y * PATCHES + x] = (squared(own[y * PATCHES + x] - value) - (n + min(n, v))) / (sameness * (n + v) + MIN_NOISE);
                    if (x > 0 && x <= BLOCK && y > 0 && y <= BLOCK) other[(y - 1) * BLOCK + x - 1] = value;
                }
            }
            [[unroll]] for (int x = 0; x < PATCHES; x++) {
                // sums of three rows, in the first of them
                [[unroll]] for (int y = 0; y < BLOCK; y++) {
                    unlike[y * PATCHES + x] += unlike[(y + 1) * PATCHES + x] + unlike[(y + 2) * PATCHES + x];
                }
            }
            [[unroll]] for (int y = 0; y < BLOCK; y++) {
                [[unroll]] for (int x = 0; x < BLOCK; x++) {
                    float d = unlike[y * PATCHES + x] + unlike[y * PATCHES + x + 1] + unlike[y * PATCHES + x + 2];
                    ivec2 at = corner + ivec2(x + dx, y + dy);
                    bool is_inside = at.x >= 0 && at.y >= 0 && at.x < size.x && at.y < size.y;
                    if (is_inside && !is_null(depths) && (dx | dy) != 0) is_inside = is_same(depth[y * BLOCK + x], Floats(depths).v[at.y * size.x + at.x]);
                    float w = is_inside ? exp(min(-d, 0.0) * (1.0 / 9.0)) : 0.0;
                    // differences are added up, so that a constant stays what it is
                    sum[y * BLOCK + x] += w * (other[y * BLOCK + x] - own[(y + 1) * PATCHES + x + 1]);
                    weight[y * BLOCK + x] += w;
                }
            }
        }
    }
    [[unroll]] for (int y = 0; y < BLOCK; y++) {
        [[unroll]] for (int x = 0; x < BLOCK; x++) {
            ivec2 at = corner + ivec2(x, y);
            if (at.x >= size.x || at.y >= size.y) continue;
            store_value(p.to, uint(at.y * size.x + at.x), own[(y + 1) * PATCHES + x + 1] + sum[y * BLOCK + x] / weight[y * BLOCK + x]);
        }
    }
}

#endif
