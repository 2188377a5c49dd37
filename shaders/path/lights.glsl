// Light samples: how a light is chosen (by power, or from a tree) and sampled, and with which density.
//
// One two-dimensional sample does it all: its first number chooses the light, and what is left of it places the point. Every light then gets points
// that are as evenly distributed as the samples are, where a choice by a number of its own would give each light a random subset of them.
#ifndef PATH_LIGHTS
#define PATH_LIGHTS
#include "path/light_tree.glsl"
#include "interface/light_dispatch.glsl"

// Chooses a light by its power. bits: uniformly distributed; u: what is left of them, in [0, 1).
uint choose_light(PathParams p, uint bits, out float u) {
    Words starts = Words(p.light_starts);
    uint low = 0u, count = p.light_count;
    while (count > 1u) {
        uint half_ = count >> 1;
        if (starts.v[low + half_] <= bits) low += half_;
        count -= half_;
    }
    uint start = starts.v[low];
    // the last ends at 2^32, which is 0
    u = min(float(bits - start) / float(starts.v[low + 1u] - start), 0.99999994);
    return p.light_first + low;
}

// A light for a point of a surface, and a point on it. bits: a point of a two-dimensional sequence.
LightSample sample_light(PathParams p, vec3 from, Shading m, uvec2 bits) {
    vec2 u = vec2(bits >> 8) * (1.0 / 16777216.0);
    LightRecord light = p.only_light;
    uint k = p.light_first;
    if (WITH_LIGHT_CHOICE) {
        k = choose_light(p, bits.x, u.x);
        light = load_light_record(p.lights, k);
    }
    // the last of those that are chosen by power is the tree
    if (WITH_LIGHT_TREE && k == p.light_first + p.light_count - 1u) {
        float of_leaf = sample_leaf(p.light_tree, from, u.x, k);
        if (!(of_leaf > 0.0)) return NO_LIGHT_SAMPLE;
        light = load_light_record(p.lights, k);
        light.probability = p.tree_probability * of_leaf;
    }
    return light_sample(p, light, from, m, u);
}

// Density per solid angle with which sample_light samples the emitter that a ray from a point hit; 0: it cannot.
float met_light_pdf(PathParams p, Hit hit, vec3 from, vec3 wi) {
    if (!WITH_SURFACE_LIGHTS) return 0.0;
    uint first = Words(p.light_of).v[hit.instance];
    if (first == INVALID) return 0.0;
    uint k = Words(p.light_of).v[first + hit.primitive];
    if (k == INVALID) return 0.0;
    LightRecord light = p.only_light;
    // the only choice may be the tree, which is no light itself
    if (WITH_LIGHT_CHOICE || WITH_LIGHT_TREE) light = load_light_record(p.lights, k);
    if (WITH_LIGHT_TREE) light.probability = p.tree_probability * leaf_probability(p.light_tree, from, light.trail);
    return light_pdf(light, from, wi, hit.t);
}

#endif
