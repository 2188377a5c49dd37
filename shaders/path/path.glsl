// One vertex of a path: what it adds to the path's radiance, the shadow ray to a light, and the ray to the next vertex.
//
// The estimator is that of Veach's thesis (1997) with next-event estimation: what a BSDF sample meets and what a light sample finds are
// weighed by the power heuristic, so that each emitter counts once at every vertex.
#ifndef PATH_PATH
#define PATH_PATH
#include "path/lights.glsl"
#include "path/media.glsl"
#include "path/scattering.glsl"
#include "path/view.glsl"
#include "path/ambient.glsl"
#include "path/leave.glsl"
#include "path/signal.glsl"

// Dimensions of the sampler (src/sampling/sobol.rs), in pairs: vertex n begins at PATH_FIRST + n * PATH_STRIDE.
const uint BSDF_DIRECTION = 0u;
const uint BSDF_LOBE = 1u;     // and Russian roulette
const uint LIGHT_POINT_ON = 2u;  // which light, and where on it
const uint DISTANT_LIGHT_ON = 3u; // the same of the sample of a distant light, where there is one of each group
const uint FREE_FLIGHT = 4u;      // distance in a volume that scatters, and by which channel
const uint SCATTERED = 5u;        // direction there
const uint SCATTERED_ON = 6u;     // Russian roulette there

// A path survives a bounce at most this often, however bright: closed white rooms end, too.
const float MAX_SURVIVAL = 0.95;
// ... and a bounce off a mirror or through glass, which loses nothing: light that a body reflects within itself for a hundred bounces would weigh 1 / 0.95 for each of them.
const float MAX_SPECULAR_SURVIVAL = 0.99;
// Two media whose indices of refraction differ by a smaller share do not refract.
const float MIN_REFRACTION = 1e-3;
// How much of its length a shadow ray stays short of a light, beside what the light's own rounding asks.
const float SHADOW_EPSILON = 2e-6;

float power_heuristic(float a, float b) {
    // by their ratio: squares overflow
    float r = b / a;
    return 1.0 / (1.0 + r * r);
}

// Radiance that counts, of what reaches the camera after so many bounces: 1 is direct light, which no clamp touches.
vec3 counted_radiance(PathParams p, vec3 c, uint depth) {
    if (WITH_MIN_DEPTH && depth < p.options.min_depth) return vec3(0.0);
    if (WITH_INDIRECT_SCALE && depth > 1u) c *= p.options.indirect_scale;
    return WITH_CLAMP && depth > 1u ? min(c, vec3(p.options.firefly_clamp)) : c;
}

// MIS weight of an emitter that a ray hit, which light sampling samples with density `light`.
float emission_weight(PathParams p, PathState state, float light) {
    if (state.pdf < 0.0 || !(light > 0.0)) return 1.0;
    if (WITH_MIS) return power_heuristic(state.pdf, light);
    return WITH_LIGHT_SAMPLES ? 0.0 : 1.0;
}

// Radiance, weighted, of the directional lights whose disks a ray that leaves the scene meets. share: that of distant lights in the light samples that compete.
vec3 disks_met(PathParams p, PathState state, float share, vec3 w) {
    vec3 c = vec3(0.0);
    for (uint k = 0u; k < p.disk_count; k++) {
        LightRecord light = load_light_record(p.lights, p.first_disk + k);
        if (light.radius == 0.0 || !meets_disk(light, w)) continue;
        c += disk_radiance(light) * emission_weight(p, state, WITH_LIGHT_SAMPLES ? share * disk_pdf(light) : 0.0);
    }
    return c;
}

// Value and density at a vertex, of a direction in the world. What a BSDF about a shading normal sends through the true surface is lost.
BsdfValue vertex_at(Shading m, vec3 wo, vec3 w) {
    vec3 wi = to_frame(m.frame, w);
    if (HAS_SHADING_NORMALS && !(wi.z * dot(m.ng, w) > 0.0)) return NO_VALUE;
    return bsdf_eval(m.bsdf, wo, wi);
}

// Samples a direction by the selected strategy, in world space.
BsdfSample sample_direction(Shading m, vec3 wo, vec2 u, float v) {
    Bsdf b = m.bsdf;
    // a delta lobe can be sampled in one way only, and these know reflection only
    bool plain = (WITH_COSINE_SAMPLING || WITH_UNIFORM_SAMPLING) && has_rough_part(b) && !has_smooth_part(b) && b.transmitted == vec3(0.0) && b.through == vec3(0.0);
    BsdfSample s;
    if (plain) s = proposed(WITH_COSINE_SAMPLING ? cosine_hemisphere(u) : uniform_hemisphere(u), 1.0);
    else s = bsdf_sample(b, wo, u, v);
    if (!(s.pdf > 0.0)) return NO_SAMPLE;
    vec3 wi = s.wi;
    s.wi = from_frame(m.frame, wi);
    float side = dot(m.ng, s.wi);
    bool hidden = HAS_SHADING_NORMALS && !(side * wi.z > 0.0);
    if (s.delta) {
        // one direction for each view: mirrored at the true surface nothing of it is lost, and none counts twice
        if (hidden) s.wi -= 2.0 * side * m.ng;
        return s;
    }
    if (hidden) return NO_SAMPLE;
    // as light samples see the direction: near the surface a rounded cosine is not the same
    BsdfValue value = vertex_at(m, wo, s.wi);
    s.pdf = !plain ? value.pdf : WITH_COSINE_SAMPLING ? wi.z / PI : 1.0 / (2.0 * PI);
    s.weight = value.f / s.pdf;
    if (!(s.pdf > 0.0)) return NO_SAMPLE;
    return s;
}

// Transmittance of a medium over a length.
vec3 transmittance(uint medium, float length_) {
    if (!HAS_ABSORPTION || medium == NO_MEDIUM) return vec3(1.0);
    vec3 depth = SHADING_OF(medium).absorption;
    // nothing absorbs nothing, over any length
    return mix(exp(-depth * length_), vec3(1.0), equal(depth, vec3(0.0)));
}

// Ambient light at the first surface of a path: the ray whose length is the distance up to which this sample counts hits, and its contribution. albedo: surface_albedo().
void add_ambient_light(BlockParams block, PathParams p, uint k, PathState state, SignalVertex v, Surface s, Shading m, vec3 albedo, uvec2 pixel, uint n) {
    vec3 c = state.throughput * p.ambient_color * ambient_reflectance(m, albedo);
    bool is_needed = highest(c) > 0.0;
    if (!is_needed && !WITH_OCCLUDED_LIGHT) return;
    // where nothing is to be darkened, as on mirrors, a ray that meets nothing
    bool is_darkened = is_needed || has_rough_part(m.bsdf);
    Ray r = no_ray();
    if (is_darkened) r = ambient_ray(block, p.occlusion, s, m.ng, pixel, n);
    uint slot = append_ray(p.ambient, r, k);
    c = counted_radiance(p, c, state.depth + 1u);
    // the ray is counted where all light is darkened by what it meets (occluded_share)
    store_quad(p.ambient_contributions, slot, vec4(c, WITH_OCCLUDED_LIGHT ? 1.0 : 0.0));
    if (WITH_SIGNAL) {
        vec3 apart = v.is_apart ? m.bsdf.diffuse : vec3(0.0);
        store_quad(p.ambient_diffuse_contributions, slot, vec4(mix(c / apart, vec3(0.0), equal(apart, vec3(0.0))), 0.0));
    }
}

// Does the first vertex of a path sample a light of each group?
bool splits_lights(PathState state) { return WITH_LIGHT_SPLIT && state.depth == 0u; }

// Shares of the light samples at the path's last bounce.
LightShares last_shares(PathParams p, uint k, PathState state) {
    if (!WITH_LIGHT_GROUPS || state.depth == 0u || WITH_LIGHT_SPLIT && state.depth == 1u) return ONE_OF_EACH;
    float placed = load_placed_share(p, k);
    return LightShares(placed, 1.0 - placed);
}

// Next-event estimation: a shadow ray to a light of those that are wanted, and its contribution.
void sample_direct_light(BlockParams block, PathParams p, uint k, PathState state, SignalVertex v, Surface s, Shading m, vec3 wo, uint beyond, Dispersion dispersion, uvec2 pixel, uint n,
                         uint dimension, uint wanted, LightShares shares) {
    bool is_second = WITH_LIGHT_SPLIT && wanted == DISTANT_LIGHT;
    dimension += is_second ? DISTANT_LIGHT_ON : LIGHT_POINT_ON;
    bool chooses_among_many = WITH_LIGHT_TREE && p.placed_lights > MANY_LIGHTS && !is_second;
    uvec2 bits;
    if (chooses_among_many) bits = sample_choice_bits(block.seed, pixel, n, dimension);
    else bits = sample_2d_bits(block.seed, pixel, n, dimension);
    LightSample l = sample_light(p, s.position, m, to_unit(bits), wanted, shares);
    if (!(l.pdf > 0.0)) return;
    BsdfValue value = vertex_at(m, wo, l.wi);
    vec3 c = state.throughput * value.f * l.radiance / l.pdf;
    if (HAS_DISPERSION && !stays_white(dispersion, m.ng, from_frame(m.frame, wo), l.wi)) c *= dispersion.weight;
    if (WITH_MIS && !l.delta) c *= power_heuristic(l.pdf, value.pdf);
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
    c = counted_radiance(p, c, state.depth + 1u);
    vec3 diffuse = vec3(0.0);
    if (WITH_SIGNAL) diffuse = c * (v.is_apart ? diffuse_share(m, wo, l.wi, value.f) : v.share);
    leave_light_ray(p, k, is_second, shadow, c, diffuse);
}

// Continues the path behind a surface, unchanged.
void pass_straight(PathParams p, uint k, PathState state, Surface s, vec3 ng, Ray ray, Cone cone) {
    state.passes++;
    if (WITH_RAY_CONES) store_cone(p, k, cone);
    leave_next_ray(p, k, Ray(s.position - ng * s.offset, 0.0, ray.direction, INFINITY), state);
}

// Distance since the last bounce, straight through surfaces.
float straight_length(PathParams p, uint k, PathState state) {
    return WITH_CLEAR_WALLS && state.passes > 0u ? Floats(p.straight).v[k] : 0.0;
}

void add_straight(PathParams p, uint k, PathState state, float length_) {
    StoredFloats(p.straight).v[k] = straight_length(p, k, state) + length_;
}

// Fraction of light that passes straight through a surface.
vec3 straight_transmittance(Shading m, vec3 towards_viewer) {
    if (m.bsdf.kind != BSDF_GLTF) return vec3(0.0);
    vec3 wo = to_frame(m.frame, towards_viewer);
    wo.z = max(wo.z, MIN_COSINE);
    return gltf_straight(m.bsdf, wo);
}

// True if a sample passed straight through a thin wall.
bool is_straight(Bsdf b, BsdfSample s, float side) {
    return s.delta && side < 0.0 && b.kind == BSDF_GLTF && !b.volume;
}

// Continues the path where particles of a volume send it. Scatterings are no bounces, but are counted, and end by roulette, as such.
void scatter_path(BlockParams block, PathParams p, uint k, PathState state, Ray ray, float length_, uvec2 pixel, uint n, uint dimension) {
    float brightest = highest(state.throughput);
    if (!(brightest > 0.0)) return;
    if (state.depth + state.passes >= p.options.rr_depth) {
        float survival = min(brightest * state.eta_scale, MAX_SPECULAR_SURVIVAL);
        if (sample_2d(block.seed, pixel, n, dimension + SCATTERED_ON).x >= survival) return;
        state.throughput /= survival;
    }
    if (state.depth + state.passes == 0u) {
        store_media(p, k, p.camera_media);
        if (WITH_RAY_CONES) store_cone(p, k, cone_after(camera_cone(block, ray.direction), length_));
    }
    vec3 w = scattered_direction(ray.direction, SHADING_OF(state.medium).scatter_anisotropy, sample_2d(block.seed, pixel, n, dimension + SCATTERED));
    state.pdf = -1.0;
    state.passes++;
    leave_next_ray(p, k, Ray(ray.origin + length_ * ray.direction, 0.0, w, INFINITY), state);
}

// uses the functions above
#include "path/catcher.glsl"

// k: the path. Returns what the vertex itself adds to its radiance; what light samples add comes with their rays.
vec3 path_vertex(BlockParams block, uint k, PathState state, Ray ray, Hit hit) {
    PathParams p = path_params();
    uvec2 pixel = path_pixel(block, state.index);
    uint n = path_sample(state.index), dimension = PATH_FIRST + (state.depth + state.passes) * PATH_STRIDE;
    if (scatters(state.medium)) {
        FreeFlight flight = free_flight(state.medium, state.throughput, hit.t, sample_2d(block.seed, pixel, n, dimension + FREE_FLIGHT));
        state.throughput *= flight.weight;
        if (flight.is_scattered) {
            scatter_path(block, p, k, state, ray, flight.length_, pixel, n, dimension);
            return vec3(0.0);
        }
    } else {
        state.throughput *= transmittance(state.medium, hit.t);
    }
    if (!is_hit(hit)) {
        // as with ambient occlusion, what shows nothing counts nothing
        if ((WITH_CONSTANT_ALBEDO || WITH_VIEW) && state.depth == 0u) return vec3(0.0);
        // mirrors and glass show what lights them
        if (WITH_BACKGROUND && state.depth + state.passes == 0u) return counted_radiance(p, state.throughput * background_radiance(p, ray.direction), 0u);
        float light = 0.0, share = last_shares(p, k, state).distant;
        vec3 c;
        if (WITH_LIGHT_SAMPLES && HAS_ENVIRONMENT_LIGHTS && !SKY_PDF_OF_SURFACE) {
            vec4 met = environment_and_pdf(p, ray.direction);
            c = met.rgb;
            if (state.depth > 0u) light = met.a;
        } else {
            c = environment_radiance(p, ray.direction);
            if (WITH_LIGHT_SAMPLES && HAS_ENVIRONMENT_LIGHTS && state.depth > 0u) light = load_sky_pdf(p, k);
        }
        c *= emission_weight(p, state, share * light);
        if (WITH_BACKGROUND_ONLY && state.depth > 0u) c = vec3(0.0);
        if (WITH_DISTANT_DISKS) c += disks_met(p, state, share, ray.direction);
        return counted_radiance(p, state.throughput * c, state.depth);
    }
    Surface s = surface_at(ray, hit);
    if (WITH_CATCHER && state.depth + state.passes == 0u && load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh).material == p.catcher) {
        catch_shadow(block, p, k, state, s, ray.direction, pixel, n, dimension);
        return vec3(0.0);
    }
    vec3 towards_viewer = -ray.direction;
    bool front = dot(s.ng, towards_viewer) > 0.0;
    Cone cone = Cone(0.0, 0.0);
    float log_side = SHARP;
    if (WITH_RAY_CONES) {
        if (state.depth + state.passes == 0u) cone = camera_cone(block, ray.direction);
        else cone = load_cone(p, k);
        cone = cone_after(cone, hit.t);
        log_side = footprint(cone, s, ray.direction);
    }
    Shading m;
    // the light that arrives at a given point is that of a white surface there
    bool is_given = WITH_SURFACE_POINTS && state.depth + state.passes == 0u;
    if (WITH_CONSTANT_ALBEDO || is_given) m = grey_shading(s, towards_viewer, WITH_CONSTANT_ALBEDO ? p.albedo : 1.0);
    else m = shade(s, towards_viewer, log_side);
    // of views and of ambient light, in one place: drivers compile a copy of the look-up for each
    vec3 albedo = vec3(0.0);
    if (WITH_VIEW ? p.view == VIEW_ALBEDO : WITH_AMBIENT && state.depth == 0u) albedo = surface_albedo(s, log_side);
    if (WITH_VIEW) return view_value(p.view, s, m, hit.t + clipped_length(block, ray.direction), log_side, albedo);
    vec3 added = vec3(0.0);
    if (m.emission != vec3(0.0)) {
        float light = 0.0;
        if (WITH_LIGHT_SAMPLES && !m.unlit) {
            // as seen from the vertex where light was sampled, which may lie behind thin walls
            float before = straight_length(p, k, state);
            Hit seen = hit;
            seen.t += before;
            light = met_light_pdf(p, seen, ray.origin - before * ray.direction, ray.direction, last_shares(p, k, state));
        }
        added = counted_radiance(p, state.throughput * m.emission * emission_weight(p, state, light), state.depth);
    }
    Boundary boundary;
    boundary.medium = state.medium;
    Dispersion dispersion = NO_DISPERSION;
    bool is_boundary = WITH_MEDIA && !is_given && is_medium(m.material);
    if (WITH_MEDIA && state.depth + state.passes == 0u) store_media(p, k, p.camera_media);
    if (is_boundary) {
        MediaStack stack = p.camera_media;
        if (state.depth + state.passes > 0u) stack = load_media(p, k);
        boundary = boundary_at(m.material, front, state.medium, stack);
        if (!boundary.is_there) {
            // no light sample crosses it: what the path meets from here on counts in full
            state.pdf = -1.0;
            store_media(p, k, boundary.stack);
            pass_straight(p, k, state, s, m.ng, ray, cone);
            return vec3(0.0);
        }
        float wavelength = D_LINE;
        if (HAS_DISPERSION) {
            float place = sample_2d(block.seed, pixel, n, WAVELENGTH).x;
            wavelength = mix(WAVELENGTHS.x, WAVELENGTHS.y, place);
            dispersion = dispersion_at(boundary, place, state.is_single);
        }
        m.bsdf.eta = relative_ior(boundary.medium, boundary.before, wavelength);
        // what does not refract is not blurred, either
        if (abs(m.bsdf.eta - 1.0) < MIN_REFRACTION) m.bsdf.facets.alpha = vec2(0.0);
    }
    if (m.bsdf.kind == BSDF_NONE) return added;
    SignalVertex v = SignalVertex(SIGNAL_SEEN, false, vec3(0.0));
    if (WITH_SIGNAL) v = signal_vertex(p, k, state.depth + state.passes == 0u, m);
    if (WITH_AMBIENT && state.depth == 0u) add_ambient_light(block, p, k, state, v, s, m, albedo, pixel, n);
    if (state.depth >= p.max_depth) {
        // walls that light goes straight through are no bounces
        if (WITH_CLEAR_WALLS) {
            state.throughput *= straight_transmittance(m, towards_viewer);
            if (highest(state.throughput) > 0.0) {
                add_straight(p, k, state, hit.t);
                pass_straight(p, k, state, s, m.ng, ray, cone);
            }
        }
        return added;
    }

    vec3 wo = to_frame(m.frame, towards_viewer);
    wo.z = max(wo.z, MIN_COSINE);
    bool splits = splits_lights(state);
    LightShares shares = ONE_OF_EACH;
    if (WITH_LIGHT_SAMPLES && !splits) shares = light_shares(p, s.position);
    if (WITH_LIGHT_SAMPLES && has_rough_part(m.bsdf)) {
        // a loop, so that drivers compile its body once
        uint last = splits ? DISTANT_LIGHT : ANY_LIGHT;
        for (uint wanted = splits ? PLACED_LIGHT : ANY_LIGHT; wanted <= last; wanted++) {
            sample_direct_light(block, p, k, state, v, s, m, wo, boundary.medium, dispersion, pixel, n, dimension, wanted, shares);
        }
    }

    // after the last bounce only emission at the hit counts
    vec2 lobe = sample_2d(block.seed, pixel, n, dimension + BSDF_LOBE);
    BsdfSample b = sample_direction(m, wo, sample_2d(block.seed, pixel, n, dimension + BSDF_DIRECTION), lobe.x);
    float side = dot(m.ng, b.wi);
    if (!(b.pdf > 0.0) || side == 0.0) return added;
    // light sampling accounts for all other light
    if (WITH_SPECULAR_ONLY && !b.delta) return added;
    state.throughput *= b.weight;
    if (HAS_DISPERSION && !stays_white(dispersion, m.ng, towards_viewer, b.wi)) {
        state.throughput *= dispersion.weight;
        state.is_single = true;
    }
    float brightest = highest(state.throughput);
    if (!(brightest > 0.0)) return added;
    if (WITH_SIGNAL) signal_sampled(p, k, v, m, wo, b, side);
    if (WITH_CLEAR_WALLS && is_straight(m.bsdf, b, side)) {
        // light samples pass here, too: the density with which they compete is still that of the last bounce
        add_straight(p, k, state, hit.t);
        state.passes++;
    } else {
        state.pdf = b.delta ? -1.0 : b.pdf;
        state.eta_scale *= b.eta * b.eta;
        state.depth++;
        if (WITH_CLEAR_WALLS) StoredFloats(p.straight).v[k] = 0.0;
        if (WITH_LIGHT_SAMPLES && WITH_LIGHT_GROUPS && !splits) store_placed_share(p, k, shares.placed);
        if (WITH_LIGHT_SAMPLES && SKY_PDF_OF_SURFACE) store_sky_pdf(p, k, sky_pdf(p, m, s.position, b.wi));
        if (state.depth >= p.options.rr_depth) {
            float survival = min(brightest * state.eta_scale, b.delta ? MAX_SPECULAR_SURVIVAL : MAX_SURVIVAL);
            if (lobe.y >= survival) return added;
            state.throughput /= survival;
        }
        if (is_boundary && side < 0.0) {
            state.medium = boundary.medium;
            store_media(p, k, boundary.stack);
        }
    }
    if (WITH_RAY_CONES) store_cone(p, k, scattered_cone(cone, s, front, b, side < 0.0));
    leave_next_ray(p, k, Ray(s.position + m.ng * (sign(side) * s.offset), 0.0, normalize(b.wi), INFINITY), state);
    return added;
}

#endif
