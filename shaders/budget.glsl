// budget: distributes a given number of occlusion rays over the pixels of a frame.
//
// The variance of a pixel's mean is v / n: of one sample, by the samples that its history has. Its sum over the image is least when n is
// in proportion to sqrt(v) (Neyman, "On the Two Different Aspects of the Representative Method", 1934), so a pixel with n samples wants
// level * sqrt(v) - n more, between none and the most that a frame gives it; the level is where these numbers of desired samples meet the budget. It is found
// in two rounds, each of which adds up the desired samples of one of sixteen pixels at 64 levels; integers, so that the sum does not depend on the
// order.
//
// Samples that decide how many follow them bias a mean (Kirk and Arvo, "Unbiased Sampling Techniques for Image Synthesis", SIGGRAPH
// 1991). Two things keep that small. v starts from what samples of 0 and 1 can have at most, so that a few equal samples do not
// end a pixel's share. And a pixel takes the points of its sequence in their order, none left out: where points belonged to frames,
// those that a frame without rays leaves out would not be any points, since what comes next in a sequence of low discrepancy is unlike
// what came before, and what came before decides.
#include "common/occlusion.glsl"
#include "common/budget.glsl"

layout(local_size_x = LANES) in;

// Number of samples that the largest variance counts as.
const float PRIOR_SAMPLES = 16.0;
const float PRIOR_VARIANCE = 0.25;

shared vec2 tile[LANES];
shared uint counts[LANES];
shared uint first_above, list_begin;

// The history of the nearest pixel in the previous frame, if it shows the same surface.
Estimate nearest_history(FrameParams f, uint at) {
    Estimate none = Estimate(0.0, 0.0, 0.0);
    if (f.has_history == 0u) return none;
    if (f.still != 0u) return unpack_estimate(LOAD_PAIR(f.previous_history, at));
    vec3 position = surface_position(f, at), normal = surface_normal(f, at);
    vec3 before = is_null(f.previous_position) ? position : load_vec3(f.previous_position, at);
    vec3 c = affine(f.previous_world_to_camera, before);
    bool orthographic = f.previous_orthographic != 0u;
    if (!orthographic && !(c.z < 0.0)) return none;
    vec2 place = image_point(f, f.previous_view, orthographic ? c.xy : c.xy / -c.z);
    if (!(all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(f.size))))) return none;
    EdgeTest edge = edge_test(f, f.previous_world_to_camera, f.previous_view, orthographic, before, normal, place);
    uvec2 q = uvec2(place);
    uint tap = image_index(f, q);
    uvec2 guide = LOAD_PAIR(f.previous_guide, tap);
    if (guide.y >> 24 != LOAD_PAIR(f.guide, at).y >> 24 || !same_surface(edge, vec2(q) + 0.5 + f.previous_offset - place, guide)) return none;
    return unpack_estimate(LOAD_PAIR(f.previous_history, tap));
}

// Standard deviation of one sample, and number of samples. The deviation is negative for a pixel that is not sampled in this frame, and 0 for the background.
vec2 wish_of(FrameParams f, uvec2 pixel) {
    if (any(greaterThanEqual(pixel, f.size))) return vec2(0.0);
    uint at = image_index(f, pixel);
    if (!is_surface(LOAD_PAIR(f.guide, at))) return vec2(0.0);
    Estimate e = nearest_history(f, at);
    float known = max(e.samples - 1.0, 0.0);
    float deviation = sqrt((e.variance * known + PRIOR_VARIANCE * PRIOR_SAMPLES) / (known + PRIOR_SAMPLES));
    return vec2(is_sampled(f, pixel) ? deviation : -deviation, e.samples);
}

// The desired number of rays of a pixel at a level.
float wanted(BudgetParams p, vec2 wish, float level) {
    if (!(wish.x > 0.0)) return 0.0;
    return clamp(level * wish.x - wish.y, wish.y > 0.0 ? 0.0 : 1.0, float(p.most_rays));
}

float coarse_level(float k) {
    return exp2(-4.0 + 22.0 / 63.0 * k);
}

// The index of the first of 64 sums that is not below the budget; 64 if all are below.
uint crossing(BudgetSums sums, uint from, uint target, uint lane) {
    if (lane == 0u) first_above = 64u;
    barrier();
    if (sums.v[from + lane] >= target) atomicMin(first_above, lane);
    barrier();
    uint found = first_above;
    barrier();
    return found;
}

void add_levels(BudgetParams p, BudgetSums sums, uint to, float level, uint lane) {
    float sum = 0.0;
    for (uint k = 0u; k < LANES; k++) sum += wanted(p, tile[k], level);
    atomicAdd(sums.v[to + lane], uint(sum * SUM_UNITS + 0.5));
}

void main() {
    BudgetParams p = BudgetParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    BudgetSums sums = BudgetSums(p.sums);
    uint k = gl_GlobalInvocationID.x, lane = gl_LocalInvocationID.x, stage = p.stage;
    if (stage == STAGE_DESIRED_SAMPLES) {
        STORE_PAIR(p.desired_samples, k, floatBitsToUint(wish_of(f, tile_pixel(f, k))));
        return;
    }
    if (stage == STAGE_COARSE || stage == STAGE_FINE) {
        // one pixel of sixteen, another in each frame, represents all
        uint place = BUDGET_SHARE * k + (hash_combine(k, f.frame) & (BUDGET_SHARE - 1u));
        tile[lane] = place < push.count ? uintBitsToFloat(LOAD_PAIR(p.desired_samples, place)) : vec2(0.0);
        barrier();
    }
    if (stage == STAGE_COARSE) {
        add_levels(p, sums, SUMS_COARSE, coarse_level(float(lane)), lane);
        if (lane == 0u) {
            float deviations = 0.0;
            uint pixels = 0u;
            for (uint j = 0u; j < LANES; j++) {
                deviations += max(tile[j].x, 0.0);
                pixels += tile[j].x > 0.0 ? 1u : 0u;
            }
            atomicAdd(sums.v[SUMS_DEVIATION], uint(deviations * DEVIATION_UNITS + 0.5));
            atomicAdd(sums.v[SUMS_PIXELS], pixels);
        }
        return;
    }
    uint target = uint(float(sums.v[SUMS_PIXELS] * f.rays_per_pixel) * SUM_UNITS);
    uint coarse = crossing(sums, SUMS_COARSE, target, lane);
    float low = coarse > 0u ? coarse_level(float(coarse) - 1.0) : 0.0;
    float high = coarse_level(float(min(coarse, 63u)));
    if (stage == STAGE_FINE) {
        add_levels(p, sums, SUMS_FINE, mix(low, high, float(lane + 1u) / 64.0), lane);
        return;
    }
    uvec2 pixel = tile_pixel(f, k);
    vec2 wish = uintBitsToFloat(LOAD_PAIR(p.desired_samples, k));
    uint fine = crossing(sums, SUMS_FINE, target, lane);
    float level = high;
    if (fine < 64u) {
        float below = fine > 0u ? float(sums.v[SUMS_FINE + fine - 1u]) : 0.0, above = float(sums.v[SUMS_FINE + fine]);
        float part = above > below ? (float(target) - below) / (above - below) : 1.0;
        level = mix(low, high, (float(fine) + clamp(part, 0.0, 1.0)) / 64.0);
    }
    // the maximum history length is distributed likewise
    float mean_deviation = float(sums.v[SUMS_DEVIATION]) / (DEVIATION_UNITS * float(max(sums.v[SUMS_PIXELS], 1u)));
    float full = f.most_samples / max(mean_deviation, 1e-3);
    if (f.rest != 0u) level = min(level, full);
    float expected = wanted(p, wish, level);
    // every pixel rounds up as often as its fraction says, at times far apart
    uint phase = hash_combine(hash_combine(hash_combine(f.seed, pixel.x), pixel.y), 0x62756467u) + f.frame * 0x9e3779b9u;
    uint count = uint(expected + float(phase >> 8) * (1.0 / 16777216.0));
    counts[lane] = count;
    barrier();
    uint before = 0u, all = 0u;
    for (uint j = 0u; j < LANES; j++) {
        before += j < lane ? counts[j] : 0u;
        all += counts[j];
    }
    if (lane == 0u) list_begin = atomicAdd(sums.v[SUMS_LISTED], all);
    barrier();
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    FrameWords taken = FrameWords(p.taken);
    uint first = f.has_history != 0u ? taken.v[at] : 0u;
    taken.v[at] = first + count;
    float most = min(full * abs(wish.x), MAX_CAP);
    STORE_PAIR(p.plan, at, uvec2(first << 8 | count, floatBitsToUint(most)));
    FrameWords list = FrameWords(p.list);
    for (uint j = 0u; j < count; j++) list.v[list_begin + before + j] = at << 4 | j;
}
