// One vertex of a path: what it adds to the path's radiance, the shadow ray to a light, and the ray to the next vertex.
//
// The estimator is that of Veach's thesis (1997) with next-event estimation: what a BSDF sample meets and what a light sample finds are
// weighed by the power heuristic, so that each emitter counts once at every vertex.
#ifndef PATH_PATH
#define PATH_PATH
#include "path/lights.glsl"
#include "path/view.glsl"

// Dimensions of the sampler (src/sampling/sobol.rs), in pairs: vertex n begins at PATH_FIRST + n * PATH_STRIDE.
const uint PATH_FIRST = 8u;
const uint PATH_STRIDE = 8u;
const uint BSDF_DIRECTION = 0u;
const uint BSDF_LOBE = 1u;     // and Russian roulette
const uint LIGHT_CHOICE = 2u;
const uint LIGHT_PLACE = 3u;

// A path survives a bounce at most this often, however bright: closed white rooms end, too.
const float MOST_SURVIVAL = 0.95;
// How much of its length a shadow ray stays short of a light, beside what the light's own rounding asks.
const float SHADOW_EPSILON = 2e-6;

float power_heuristic(float a, float b) {
    // by their ratio: squares overflow
    float r = b / a;
    return 1.0 / (1.0 + r * r);
}

vec3 held(PathParams p, vec3 c, uint depth) {
    return asks(ASKS_CLAMP) && depth > 0u ? min(c, vec3(p.clamp_to)) : c;
}

// Weight of an emitter that a ray met, which light samples draw with density `light`.
float emission_weight(PathParams p, PathState state, float light) {
    if (state.pdf < 0.0 || !(light > 0.0)) return 1.0;
    if (asks(ASKS_MIS)) return power_heuristic(state.pdf, light);
    return asks(ASKS_LIGHT_SAMPLES) ? 0.0 : 1.0;
}

// A direction, or its mirror image at the true surface, in the frame of the shading normal. A BSDF about that normal reaches directions which the
// surface hides: those are mirrored at it, so that nothing that it reflects (or transmits) is lost, and two of the BSDF's directions may be one of the
// world's. found: the BSDF's direction and the world's are on the same side.
vec3 unbent(Shading m, vec3 w, bool mirrored, out bool found) {
    float side = dot(m.ng, w);
    vec3 wi = to_frame(m.frame, mirrored ? w - 2.0 * side * m.ng : w);
    found = wi.z * side > 0.0;
    return wi;
}

// Value and density at a vertex, of a direction in the world.
BsdfValue vertex_at(Shading m, vec3 wo, vec3 w) {
    BsdfValue value = NO_VALUE;
    // one copy of the code for both
    [[dont_unroll]] for (int k = 0; k < (has(HAS_BENT_NORMALS) ? 2 : 1); k++) {
        bool found;
        vec3 wi = unbent(m, w, k > 0, found);
        if (!found) continue;
        BsdfValue one = bsdf_at(m.bsdf, wo, wi);
        value = BsdfValue(value.f + one.f, value.pdf + one.pdf);
    }
    return value;
}

// Density of cosine-distributed directions, or of even ones, about the shading normal, of a direction in the world.
float plain_pdf(Shading m, vec3 w) {
    float pdf = 0.0;
    for (int k = 0; k < 2; k++) {
        bool found;
        float c = unbent(m, w, k > 0, found).z;
        if (found && c > 0.0) pdf += asks(ASKS_COSINE) ? c / PI : 1.0 / (2.0 * PI);
    }
    return pdf;
}

// A direction by the strategy that is asked for; in the world.
BsdfSample draw_direction(Shading m, vec3 wo, vec2 u, float v) {
    Bsdf b = m.bsdf;
    // a delta lobe can be sampled in one way only, and these know reflection only
    bool plain = (asks(ASKS_COSINE) || asks(ASKS_UNIFORM)) && has_rough_part(b) && !has_smooth_part(b) && b.transmitted == vec3(0.0);
    BsdfSample s;
    if (plain) s = proposed(asks(ASKS_COSINE) ? cosine_hemisphere(u) : uniform_hemisphere(u), 1.0);
    else s = bsdf_sample(b, wo, u, v);
    if (!(s.pdf > 0.0)) return NO_SAMPLE;
    vec3 w = from_frame(m.frame, s.wi);
    float side = dot(m.ng, w);
    if (has(HAS_BENT_NORMALS) && side * s.wi.z < 0.0) w -= 2.0 * side * m.ng;
    s.wi = w;
    if (s.delta) return s;
    BsdfValue value = vertex_at(m, wo, w);
    s.pdf = plain ? plain_pdf(m, w) : value.pdf;
    s.weight = value.f / s.pdf;
    if (!(s.pdf > 0.0)) return NO_SAMPLE;
    return s;
}

// What a medium leaves of light over a length.
vec3 transmittance(uint medium, float length_) {
    if (!has(HAS_ABSORPTION) || medium == NO_MEDIUM) return vec3(1.0);
    vec3 depth = SHADING_OF(medium).absorption;
    // nothing absorbs nothing, over any length
    return mix(exp(-depth * length_), vec3(1.0), equal(depth, vec3(0.0)));
}

// The medium on the other side of a surface.
uint medium_beyond(Shading m, bool front, uint medium) {
    if (!has(HAS_ABSORPTION) || !m.bsdf.volume) return medium;
    return front ? m.material : NO_MEDIUM;
}

// Next-event estimation: a ray to a light, and what that brings.
void draw_light(BlockParams block, PathParams p, uint k, PathState state, Surface s, Shading m, vec3 wo, uint beyond, uvec2 pixel, uint n, uint dimension) {
    vec2 choice = sample_2d(block.seed, pixel, n, dimension + LIGHT_CHOICE);
    vec2 place = sample_2d(block.seed, pixel, n, dimension + LIGHT_PLACE);
    LightSample l = sample_light(p, s.position, choice.x, place);
    if (!(l.pdf > 0.0)) return;
    BsdfValue value = vertex_at(m, wo, l.wi);
    vec3 c = state.throughput * value.f * l.radiance / l.pdf;
    if (asks(ASKS_MIS) && !l.delta) c *= power_heuristic(l.pdf, value.pdf);
    if (!(highest(c) > 0.0)) return;
    float side = dot(m.ng, l.wi);
    vec3 origin = s.position + m.ng * (sign(side) * s.offset);
    Ray shadow = Ray(origin, 0.0, l.wi, INFINITY);
    if (l.distance < INFINITY) {
        vec3 to = l.to - origin;
        float d = length(to);
        shadow.direction = to / d;
        shadow.tmax = d * (1.0 - SHADOW_EPSILON);
    }
    c *= transmittance(side > 0.0 ? state.medium : beyond, l.distance);
    uint slot = append_ray(p.shadow, shadow, k);
    store_quad(p.contributions, slot, vec4(held(p, c, state.depth + 1u), 0.0));
}

// k: the path. Returns what the vertex itself adds to its radiance; what light samples add comes with their rays.
vec3 path_vertex(BlockParams block, uint k, PathState state, Ray ray, Hit hit) {
    PathParams p = PathParams(block.path);
    state.throughput *= transmittance(state.medium, hit.t);
    if (!is_hit(hit)) {
        // as with ambient occlusion, what shows nothing counts nothing
        if ((asks(ASKS_GREY) || asks(ASKS_VIEW)) && state.depth == 0u) return vec3(0.0);
        float light = 0.0;
        if (asks(ASKS_LIGHT_SAMPLES) && asks(ASKS_SKY)) {
            light = LightRecords(p.lights).v[p.environment_light].probability * environment_pdf(p, ray.direction);
        }
        vec3 c = state.throughput * environment_radiance(p, ray.direction) * emission_weight(p, state, light);
        return held(p, c, state.depth);
    }
    Surface s = surface_at(ray, hit);
    vec3 towards_viewer = -ray.direction;
    bool front = dot(s.ng, towards_viewer) > 0.0;
    Cone cone = Cone(0.0, 0.0);
    float log_side = SHARP;
    if (asks(ASKS_CONES)) {
        if (state.depth == 0u) cone = camera_cone(block, ray.direction);
        else cone = load_cone(p, k);
        cone = cone_after(cone, hit.t);
        log_side = footprint(cone, s, ray.direction);
    }
    Shading m;
    if (asks(ASKS_GREY)) m = grey_shading(s, towards_viewer, p.albedo);
    else m = shade(s, towards_viewer, log_side);
    if (asks(ASKS_VIEW)) return view_value(p.view, s, m, hit.t, log_side);
    vec3 added = vec3(0.0);
    if (m.emission != vec3(0.0)) {
        float light = 0.0;
        if (asks(ASKS_LIGHT_SAMPLES) && !m.unlit) light = light_pdf(p, hit, ray.origin, ray.direction);
        added = held(p, state.throughput * m.emission * emission_weight(p, state, light), state.depth);
    }
    if (m.bsdf.kind == BSDF_NONE || state.depth >= p.max_depth) return added;

    vec3 wo = to_frame(m.frame, towards_viewer);
    wo.z = max(wo.z, LEAST_COSINE);
    uvec2 pixel = block_pixel(block, pixel_index(state.index)) + block.block_origin;
    uint n = sample_index(state.index), dimension = PATH_FIRST + state.depth * PATH_STRIDE;
    uint beyond = medium_beyond(m, front, state.medium);
    if (asks(ASKS_LIGHT_SAMPLES) && has_rough_part(m.bsdf)) {
        draw_light(block, p, k, state, s, m, wo, beyond, pixel, n, dimension);
    }

    // after the last bounce only what is met shines
    vec2 lobe = sample_2d(block.seed, pixel, n, dimension + BSDF_LOBE);
    BsdfSample b = draw_direction(m, wo, sample_2d(block.seed, pixel, n, dimension + BSDF_DIRECTION), lobe.x);
    float side = dot(m.ng, b.wi);
    if (!(b.pdf > 0.0) || side == 0.0) return added;
    state.throughput *= b.weight;
    state.pdf = b.delta ? -1.0 : b.pdf;
    state.eta_scale *= b.eta * b.eta;
    if (side < 0.0) state.medium = beyond;
    state.depth++;
    float brightest = highest(state.throughput);
    if (!(brightest > 0.0)) return added;
    if (state.depth >= p.rr_depth) {
        float survival = min(brightest * state.eta_scale, MOST_SURVIVAL);
        if (lobe.y >= survival) return added;
        state.throughput /= survival;
    }
    if (asks(ASKS_CONES)) store_cone(p, k, scattered_cone(cone, s, front, b, side < 0.0));
    uint slot = append_ray(p.next, Ray(s.position + m.ng * (sign(side) * s.offset), 0.0, normalize(b.wi), INFINITY), k);
    store_state(p.next_states, slot, state);
    return added;
}

#endif
