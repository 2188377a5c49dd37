// One vertex of a path: what it adds to the path's radiance, the shadow ray to a light, and the ray to the next vertex.
//
// The estimator is that of Veach's thesis (1997) with next-event estimation: what a BSDF sample meets and what a light sample finds are
// weighed by the power heuristic, so that each emitter counts once at every vertex.
#ifndef PATH_PATH
#define PATH_PATH
#include "path/lights.glsl"

// Dimensions of the sampler (src/sampling/sobol.rs), in pairs: vertex n begins at PATH_FIRST + n * PATH_STRIDE.
const uint PATH_FIRST = 8u;
const uint PATH_STRIDE = 8u;
const uint BSDF_DIRECTION = 0u;
const uint BSDF_LOBE = 1u;     // and Russian roulette
const uint LIGHT_CHOICE = 2u;
const uint LIGHT_PLACE = 3u;

// A path survives a bounce at most this often, however bright: closed white rooms end, too.
const float MOST_SURVIVAL = 0.95;
// A shading normal that turns away from the viewer is bent back to this cosine.
const float LEAST_COSINE = 1e-4;
// How much of its length a shadow ray stays short of a light, beside what the light's own rounding asks.
const float SHADOW_EPSILON = 2e-6;

float power_heuristic(float a, float b) {
    // by their ratio: squares overflow
    float r = b / a;
    return 1.0 / (1.0 + r * r);
}

vec3 held(PathParams p, vec3 c, uint depth) {
    return depth > 0u ? min(c, vec3(p.clamp_to)) : c;
}

// Weight of an emitter that a ray met, which light samples draw with density `light`.
float emission_weight(PathParams p, PathState state, float light) {
    if (state.pdf < 0.0 || !(light > 0.0)) return 1.0;
    if (p.strategy == STRATEGY_MIS) return power_heuristic(state.pdf, light);
    return p.strategy == STRATEGY_LIGHT ? 0.0 : 1.0;
}

bool draws_lights(PathParams p) {
    return p.strategy == STRATEGY_MIS || p.strategy == STRATEGY_LIGHT;
}

// A frame about the shading normal.
struct Frame {
    vec3 s;
    vec3 t;
    vec3 n;
};

Frame frame_about(vec3 n) {
    return Frame(to_world(n, vec3(1.0, 0.0, 0.0)), to_world(n, vec3(0.0, 1.0, 0.0)), n);
}

vec3 to_frame(Frame f, vec3 w) { return vec3(dot(f.s, w), dot(f.t, w), dot(f.n, w)); }
vec3 from_frame(Frame f, vec3 w) { return f.s * w.x + f.t * w.y + f.n * w.z; }

// A direction by the strategy that is asked for.
BsdfSample draw_direction(PathParams p, Bsdf b, vec3 wo, vec2 u, float v) {
    bool plain = p.strategy == STRATEGY_COSINE || p.strategy == STRATEGY_UNIFORM;
    // a delta lobe can be sampled in one way only
    if (!plain || !has_rough_part(b) || has_smooth_part(b)) return bsdf_sample(b, wo, u, v);
    vec3 wi = p.strategy == STRATEGY_COSINE ? cosine_hemisphere(u) : vec3(0.0, 0.0, 1.0);
    if (p.strategy == STRATEGY_UNIFORM) {
        float r = sqrt(max(1.0 - u.x * u.x, 0.0));
        wi = vec3(r * on_circle(u.y), u.x);
    }
    float pdf = p.strategy == STRATEGY_COSINE ? wi.z / PI : 1.0 / (2.0 * PI);
    if (!(wi.z > 0.0)) return NO_SAMPLE;
    return BsdfSample(wi, bsdf_eval(b, wo, wi) / pdf, pdf, false, 1.0);
}

// k: the path; sum: its radiance so far and its coverage.
void path_vertex(BlockParams block, uint k, PathState state, vec4 sum, Ray ray, Hit hit) {
    PathParams p = PathParams(block.path);
    if (!is_hit(hit)) {
        // as with ambient occlusion, what shows nothing counts nothing
        if (p.white_sky != 0u && state.depth == 0u) {
            store_quad(p.radiance, k, sum);
            return;
        }
        float light = 0.0;
        if (p.environment_light != INVALID) {
            light = LightRecords(p.lights).v[p.environment_light].probability * environment_pdf(p, ray.direction);
        }
        vec3 c = state.throughput * environment_radiance(p, ray.direction) * emission_weight(p, state, light);
        store_quad(p.radiance, k, vec4(sum.rgb + held(p, c, state.depth), sum.a));
        return;
    }
    Surface s = surface_at(ray, hit);
    vec3 wo = -ray.direction;
    bool front = dot(s.ng, wo) > 0.0;
    vec3 ng = front ? s.ng : -s.ng, ns = front ? s.ns : -s.ns;
    float cos_o = dot(ns, wo);
    if (cos_o < LEAST_COSINE) {
        ns = normalize(ns + (LEAST_COSINE - cos_o) * wo);
        cos_o = max(dot(ns, wo), LEAST_COSINE);
    }
    Shading m = shade(p, s, front, cos_o);
    if (m.emission != vec3(0.0)) {
        float light = m.unlit ? 0.0 : light_pdf(p, hit, ray.origin, ray.direction);
        sum.rgb += held(p, state.throughput * m.emission * emission_weight(p, state, light), state.depth);
    }
    store_quad(p.radiance, k, sum);
    if (m.bsdf.kind == BSDF_NONE || state.depth >= p.max_depth) return;

    Frame f = frame_about(ns);
    vec3 local = to_frame(f, wo);
    local.z = max(local.z, LEAST_COSINE);
    uvec2 pixel = block_pixel(block, pixel_index(state.index)) + block.block_origin;
    uint n = sample_index(state.index), dimension = PATH_FIRST + state.depth * PATH_STRIDE;

    if (draws_lights(p) && p.light_count > 0u && has_rough_part(m.bsdf)) {
        vec2 choice = sample_2d(block.seed, pixel, n, dimension + LIGHT_CHOICE);
        vec2 place = sample_2d(block.seed, pixel, n, dimension + LIGHT_PLACE);
        LightSample l = sample_light(p, s.position, choice.x, place);
        vec3 wi = to_frame(f, l.wi);
        float side = dot(ng, l.wi);
        if (l.pdf > 0.0 && side * wi.z > 0.0) {
            vec3 c = state.throughput * bsdf_eval(m.bsdf, local, wi) * l.radiance / l.pdf;
            if (p.strategy == STRATEGY_MIS && !l.delta) c *= power_heuristic(l.pdf, bsdf_pdf(m.bsdf, local, wi));
            if (max(c.r, max(c.g, c.b)) > 0.0) {
                vec3 origin = s.position + ng * (sign(side) * s.offset);
                Ray shadow = Ray(origin, 0.0, l.wi, INFINITY);
                if (l.distance < INFINITY) {
                    vec3 to = l.to - origin;
                    float d = length(to);
                    shadow.direction = to / d;
                    shadow.tmax = d * (1.0 - SHADOW_EPSILON);
                }
                store_quad(p.contributions, k, vec4(held(p, c, state.depth + 1u), 0.0));
                append_ray(p.shadow, shadow, k);
            }
        }
    }

    // after the last bounce only what is met shines
    vec2 lobe = sample_2d(block.seed, pixel, n, dimension + BSDF_LOBE);
    BsdfSample b = draw_direction(p, m.bsdf, local, sample_2d(block.seed, pixel, n, dimension + BSDF_DIRECTION), lobe.x);
    if (!(b.pdf > 0.0)) return;
    vec3 w = from_frame(f, b.wi);
    float side = dot(ng, w);
    // a shading normal may send light through the surface: there is no such light
    if (!(side * b.wi.z > 0.0)) return;
    state.throughput *= b.weight;
    state.pdf = b.delta ? -1.0 : b.pdf;
    state.eta_scale *= b.eta * b.eta;
    state.depth++;
    float brightest = max(state.throughput.r, max(state.throughput.g, state.throughput.b));
    if (!(brightest > 0.0)) return;
    if (state.depth >= p.rr_depth) {
        float survival = min(brightest * state.eta_scale, MOST_SURVIVAL);
        if (lobe.y >= survival) return;
        state.throughput /= survival;
    }
    store_state(p.states, k, state);
    append_ray(p.next, Ray(s.position + ng * (sign(side) * s.offset), 0.0, normalize(w), INFINITY), k);
}

#endif
