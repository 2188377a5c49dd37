// What a vertex leaves for the work after it: the path's next ray with its state, rays to lights with what they bring, and what the next vertex needs to know of this one.
//
// In the wavefront all of it is in memory: rays in queues, their states and contributions beside them, the rest by path. A kernel that goes on with the path itself
// (path_megakernel.glsl) defines PATH_IN_REGISTERS, and finds it in the variables below.
#ifndef PATH_LEAVE
#define PATH_LEAVE
#include "path/cone.glsl"
#include "path/media.glsl"

#ifdef PATH_IN_REGISTERS

// Rays to lights: a vertex leaves one, or one to a placed light and one to a distant one.
const uint LIGHT_RAYS = WITH_LIGHT_SPLIT ? 2u : 1u;

bool has_next_ray, has_light_ray[2];
Ray next_ray, light_rays[2];
PathState next_state;
vec3 light_contributions[2];
float light_coverage = 0.0;  // what the first contribution adds to the path's coverage
// of the path's last vertex: its ray cone, the volumes that the path is in, the share of placed lights in its samples, and the density of light sampling for the environment in the
// direction that it took
Cone last_cone;
MediaStack last_media;
float last_placed_share = 0.0, last_sky_pdf = 0.0;

// As append_ray (common/queue.glsl).
Ray seeded(Ray r) {
    if (next_ray_seed != 0u) {
        r.tmin = tmin_of_seed(next_ray_seed);
        next_ray_seed = hash(next_ray_seed);
    }
    return r;
}

void clear_left_rays() {
    has_next_ray = false;
    has_light_ray[0] = false;
    light_coverage = 0.0;
    has_light_ray[1] = false;
}

void leave_next_ray(PathParams p, uint k, Ray r, PathState state) {
    has_next_ray = true;
    next_ray = seeded(r);
    next_state = state;
}

void leave_light_ray(PathParams p, uint k, bool is_second, Ray r, vec3 contribution, vec3 diffuse) {
    r = seeded(r);
    if (is_second) {
        has_light_ray[1] = true;
        light_rays[1] = r;
        light_contributions[1] = contribution;
    } else {
        has_light_ray[0] = true;
        light_rays[0] = r;
        light_contributions[0] = contribution;
    }
}

void leave_caught_ray(PathParams p, uint k, Ray r, vec3 contribution) {
    leave_light_ray(p, k, false, r, contribution, vec3(0.0));
    light_coverage = -1.0;
}

Cone load_cone(PathParams p, uint k) { return last_cone; }
void store_cone(PathParams p, uint k, Cone c) { last_cone = c; }
MediaStack load_media(PathParams p, uint k) { return last_media; }
void store_media(PathParams p, uint k, MediaStack stack) { last_media = stack; }
float load_placed_share(PathParams p, uint k) { return last_placed_share; }
void store_placed_share(PathParams p, uint k, float share) { last_placed_share = share; }
float load_sky_pdf(PathParams p, uint k) { return last_sky_pdf; }
void store_sky_pdf(PathParams p, uint k, float pdf) { last_sky_pdf = pdf; }

#else

void leave_next_ray(PathParams p, uint k, Ray r, PathState state) {
    uint slot = append_ray(p.next, r, k);
    store_state(p.next_states, slot, state);
}

// `diffuse`: the contribution's diffuse part, with WITH_SIGNAL. Two rays that add to a path at the same time would depend on their order: each has its own queue.
void leave_light_ray(PathParams p, uint k, bool is_second, Ray r, vec3 contribution, vec3 diffuse) {
    uint slot;
    if (is_second) slot = append_ray(p.distant_shadow, r, k);
    else slot = append_ray(p.shadow, r, k);
    store_quad(is_second ? p.distant_contributions : p.contributions, slot, vec4(contribution, 0.0));
    if (WITH_SIGNAL) store_quad(is_second ? p.distant_diffuse_contributions : p.diffuse_contributions, slot, vec4(diffuse, 0.0));
}

// The ray that decides whether a catcher is in shadow: unoccluded, it shows what is behind, and covers nothing.
void leave_caught_ray(PathParams p, uint k, Ray r, vec3 contribution) {
    uint slot = append_ray(p.shadow, r, k);
    store_quad(p.contributions, slot, vec4(contribution, -1.0));
    if (WITH_SIGNAL) store_quad(p.diffuse_contributions, slot, vec4(vec3(1.0), 0.0));
}

Cone load_cone(PathParams p, uint k) {
    vec2 c = load_vec2(p.cones, k);
    return Cone(c.x, c.y);
}

void store_cone(PathParams p, uint k, Cone c) {
    STORE_PAIR(p.cones, k, floatBitsToUint(vec2(c.width, c.spread)));
}

MediaStack load_media(PathParams p, uint k) { return LOAD_QUAD(p.media, k); }
void store_media(PathParams p, uint k, MediaStack stack) { store_quad(p.media, k, uintBitsToFloat(stack)); }
float load_placed_share(PathParams p, uint k) { return Floats(p.placed_shares).v[k]; }
void store_placed_share(PathParams p, uint k, float share) { StoredFloats(p.placed_shares).v[k] = share; }
float load_sky_pdf(PathParams p, uint k) { return Floats(p.sky_pdfs).v[k]; }
void store_sky_pdf(PathParams p, uint k, float pdf) { StoredFloats(p.sky_pdfs).v[k] = pdf; }

#endif

#endif
