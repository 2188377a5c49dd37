// Light samples: which light a sample is for, where on it, and with which density.
//
// Lights form two groups (src/integrators/path/lights): placed ones, among which a tree chooses by what each may bring to a point, and distant ones, which are chosen by
// the irradiance that they bring. The first vertex of a path samples a light of each group, others one of both: by irradiance, but each group gets a share whatever
// it brings, because what is thought bright may be hidden.
//
// One two-dimensional sample does it all: its first number chooses the light, and what is left of it places the point. Every light then gets points
// that are as evenly distributed as the samples are, where a choice by a number of its own would give each light a random subset of them.
#ifndef PATH_LIGHTS
#define PATH_LIGHTS
#include "path/light_tree.glsl"
#include "interface/light_dispatch.glsl"

// Fraction of a vertex's light samples that go to both groups in equal parts.
const float EVEN_GROUPS = 0.5;
// Fraction of the samples of placed lights that go to all of them in equal parts, but to the parts of one triangle by their brightness.
const float EVEN_LIGHTS = 0.125;
// With more placed lights than this, the number that chooses one is scrambled as suits a choice among many.
const uint MANY_LIGHTS = 64u;
const float BELOW_1 = 0.99999994;

// Probabilities with which a light sample of a vertex is one of a placed light, and of a distant one. Where there is a sample of each, both are 1.
struct LightShares {
    float placed;
    float distant;
};

const LightShares ONE_OF_EACH = LightShares(1.0, 1.0);

// Shares of one sample at a point.
LightShares light_shares(PathParams p, vec3 from) {
    if (!WITH_LIGHT_GROUPS) return ONE_OF_EACH;
    float placed = light_importance(load_light_node(p.light_tree, 0u), from);
    // no placed light reaches the point
    if (!(placed > 0.0)) return LightShares(0.0, 1.0);
    placed = mix(1.0 / (1.0 + p.distant_irradiance / placed), 0.5, EVEN_GROUPS);
    return LightShares(placed, 1.0 - placed);
}

// Chooses one of `count` outcomes by their cumulative distribution, which begins at `first`. Returns its index in `starts`. u: uniformly distributed in [0, 1), and what
// is left of it.
uint choose_by_starts(Words starts, uint first, uint count, inout float u) {
    if (count <= 1u) return first;
    uint bits = uint(u * 4294967296.0);
    uint low = first;
    while (count > 1u) {
        uint half_ = count >> 1;
        if (starts.v[low + half_] <= bits) low += half_;
        count -= half_;
    }
    uint start = starts.v[low];
    // the last ends at 2^32, which is 0
    u = min(float(bits - start) / float(starts.v[low + 1u] - start), BELOW_1);
    return low;
}

// Chooses a distant light. u: as above.
uint choose_distant_light(PathParams p, inout float u) {
    if (!WITH_LIGHT_CHOICE) return p.placed_lights;
    // the distribution of placed lights, which has an entry more than there are lights, comes first
    return choose_by_starts(Words(p.light_starts), p.placed_lights + 1u, p.distant_lights, u) - 1u;
}

// Probability with which a placed light is chosen that the tree chooses with this one. A light that the tree knows not to reach the point is never chosen.
float placed_probability(LightRecord light, float of_tree) { return of_tree > 0.0 ? mix(of_tree, light.probability, EVEN_LIGHTS) : 0.0; }

// Chooses a placed light. Returns the probability with which the tree chooses it; 0: none reaches the point. u: as above.
float choose_placed_light(PathParams p, vec3 from, inout float u, out uint light) {
    light = 0u;
    if (!WITH_LIGHT_TREE) return WITH_LIGHT_GROUPS && !(light_importance(load_light_node(p.light_tree, 0u), from) > 0.0) ? 0.0 : 1.0;
    bool is_even = u < EVEN_LIGHTS;
    uvec2 trail = uvec2(0u);
    if (is_even) {
        u *= 1.0 / EVEN_LIGHTS;
        trail = light_trail(p.lights, choose_by_starts(Words(p.light_starts), 0u, p.placed_lights, u));
    } else {
        u = min((u - EVEN_LIGHTS) / (1.0 - EVEN_LIGHTS), BELOW_1);
    }
    return descend_light_tree(p.light_tree, from, is_even, trail, u, light);
}

// What a light sample is for.
const uint ANY_LIGHT = 0u;
const uint PLACED_LIGHT = 1u;
const uint DISTANT_LIGHT = 2u;

// A light for a point of a surface, and a point on it. u: a point of a two-dimensional sequence. shares: those of one sample, or ONE_OF_EACH.
LightSample sample_light(PathParams p, vec3 from, Shading m, vec2 u, uint wanted, LightShares shares) {
    LightRecord light = p.only_light;
    float probability = 1.0;
    if (WITH_LIGHT_GROUPS || WITH_LIGHT_CHOICE || WITH_LIGHT_TREE) {
        bool is_distant = WITH_LIGHT_GROUPS ? wanted == DISTANT_LIGHT : WITH_LIGHT_CHOICE;
        if (WITH_LIGHT_GROUPS && wanted == ANY_LIGHT) {
            is_distant = u.x >= shares.placed;
            u.x = min(is_distant ? (u.x - shares.placed) / shares.distant : u.x / shares.placed, BELOW_1);
        }
        uint k;
        float of_tree = 1.0;
        if (is_distant) {
            k = choose_distant_light(p, u.x);
        } else {
            of_tree = choose_placed_light(p, from, u.x, k);
            if (!(of_tree > 0.0)) return NO_LIGHT_SAMPLE;
        }
        light = load_light_record(p.lights, k);
        probability = is_distant ? shares.distant : WITH_LIGHT_TREE ? shares.placed * placed_probability(light, of_tree) : shares.placed;
    }
    LightSample l = light_sample(p, light, from, m, u);
    l.pdf *= probability;
    return l;
}

// Density per solid angle with which sample_light samples the emitter that a ray from a point hit; 0: it cannot.
float met_light_pdf(PathParams p, Hit hit, vec3 from, vec3 wi, LightShares shares) {
    if (!WITH_SURFACE_LIGHTS) return 0.0;
    uint first = Words(p.light_of).v[hit.instance];
    if (first == INVALID) return 0.0;
    uint k = Words(p.light_of).v[first + hit.primitive];
    if (k == INVALID) return 0.0;
    LightRecord light = p.only_light;
    if (WITH_LIGHT_GROUPS || WITH_LIGHT_TREE) light = load_light_record(p.lights, k);
    uint part = part_at(light, vec2(hit.u, hit.v));
    if (part != 0u) light = load_light_record(p.lights, k + part);
    float probability = shares.placed;
    if (WITH_LIGHT_TREE) {
        float u = 0.0;
        uint leaf;
        probability *= placed_probability(light, descend_light_tree(p.light_tree, from, true, uvec2(light.trail_low, light.trail_high), u, leaf));
    }
    return probability > 0.0 ? probability * light_pdf(light, from, wi, hit.t) : 0.0;
}

#endif
