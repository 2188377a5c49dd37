// Light tree: samples one of many lights for a point by descending towards lights of high importance there (Conty Estevez and Kulla, "Importance
// Sampling of Many Lights with Adaptive Tree Splitting", HPG 2018; the bounds are those of pbrt-v4, 12.6.3).
#ifndef PATH_LIGHT_TREE
#define PATH_LIGHT_TREE
#include "common/types.glsl"
#include "common/sampler.glsl"
#include "interface/lights.glsl"

// A sample's number is stretched at each choice; below this share of it, too few of its bits are left, and another takes its place.
const float MIN_STRETCH = 1.0 / 4096.0;

// Cosine and sine of an angle less another, not below 0.
vec2 angle_less(vec2 a, vec2 b) {
    return a.x > b.x ? vec2(1.0, 0.0) : vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

// Importance of a subtree at a point; 0 only if it contributes nothing there.
float light_importance(LightNode node, vec3 from) {
    vec3 d = from - node.center;
    float d2 = dot(d, d), r2 = node.radius * node.radius;
    // inside the bounding sphere there is no bound
    if (d2 <= r2) return node.intensity / max(r2, 1e-30);
    float cos_w = dot(node.axis, d) * inversesqrt(d2);
    if ((node.link & LIGHT_BOTH_WAYS) != 0u) cos_w = abs(cos_w);
    vec2 w = vec2(cos_w, sqrt(max(1.0 - cos_w * cos_w, 0.0)));
    float sin2_b = r2 / d2;
    vec2 left = angle_less(angle_less(w, vec2(node.cos_o, node.sin_o)), vec2(sqrt(1.0 - sin2_b), sqrt(sin2_b)));
    return left.x > node.cos_e ? node.intensity * max(left.x, 1e-4) / d2 : 0.0;
}

// Bit trail of a placed light.
uvec2 light_trail(uvec2 lights, uint k) { return uvec2(LightRecords(lights).v[k].trail_low, LightRecords(lights).v[k].trail_high); }

// Descends to a light, and returns the probability with which the tree chooses it; 0: it does not reach the point. u: in [0, 1), chooses, and is what is left of it;
// or, if `follows`, bit k of the trail says whether the light is in the second child at level k.
float descend_light_tree(uvec2 tree, vec3 from, bool follows, uvec2 trail, inout float u, out uint light) {
    LightNode node = load_light_node(tree, 0u);
    float probability = light_importance(node, from) > 0.0 ? 1.0 : 0.0, share = 1.0;
    uint seed = floatBitsToUint(u);
    light = 0u;
    for (uint level = 0u; (node.link & LIGHT_LEAF) == 0u && probability > 0.0; level++) {
        uint child = node.link & LIGHT_LINK;
        LightNode first = load_light_node(tree, child), second = load_light_node(tree, child + 1u);
        float a = light_importance(first, from), b = light_importance(second, from);
        if (!(a + b > 0.0)) return 0.0;
        float p = a / (a + b);
        bool takes_first = follows ? (trail.x & 1u) == 0u : u < p;
        trail = uvec2(trail.x >> 1 | trail.y << 31, trail.y >> 1);
        if (!follows) u = min(takes_first ? u / p : (u - p) / (1.0 - p), 0.99999994);
        p = takes_first ? p : 1.0 - p;
        probability *= p;
        share *= p;
        if (!follows && share < MIN_STRETCH) {
            u = float(hash_combine(seed, level) >> 8) * (1.0 / 16777216.0);
            share = 1.0;
        }
        if (takes_first) node = first;
        else node = second;
    }
    light = node.link & LIGHT_LINK;
    return probability;
}

#endif
