// A ground that catches shadows: camera rays see what is behind it, darkened by the share of light that the scene keeps from it.
//
// The share is that of one light sample, chosen among candidates in proportion to the light that each brings to a diffuse surface (resampled importance sampling, Talbot et al. 2005): what is behind
// comes with its shadow ray. Where nothing is occluded the image is that without a ground, to the bit. Candidates are those of light samples, so light that surfaces reflect onto the ground plays no part.
#ifndef PATH_CATCHER
#define PATH_CATCHER

// Candidates for each group of lights.
const uint CATCHER_CANDIDATES = 16u;
// Steps of the second number of a candidate: the golden ratio, which spreads any number of them.
const float CATCHER_STEP = 0.61803399;

// In frames a catcher has at least this albedo, linear, in each channel: the share of light is kept before black, too, and nobody sees it.
const float MIN_BEHIND = 1e-5;

// The candidate that has been chosen so far.
struct Caught {
    Ray ray;      // no_ray() if there is none
    float total;  // of the light of all candidates
    float u;      // uniformly distributed, whatever has been chosen
};

// Chooses between what has been chosen and one more candidate, whose ray is that to its light.
void add_candidate(inout Caught c, vec3 light, Ray r) {
    float brightness = light.r + light.g + light.b;
    if (!(brightness > 0.0 && brightness < INFINITY)) return;
    c.total += brightness;
    float share = brightness / c.total;
    if (c.u < share) {
        c.ray = r;
        c.u = min(c.u / share, BELOW_1);
    } else {
        c.u = min((c.u - share) / (1.0 - share), BELOW_1);
    }
}

// What a camera ray of direction w shows where there is no ground.
vec3 behind_catcher(PathParams p, PathState state, vec3 w) {
    if (WITH_CONSTANT_ALBEDO) return vec3(0.0);
    if (WITH_BACKGROUND) return background_radiance(p, w);
    vec3 c = environment_radiance(p, w);
    if (WITH_DISTANT_DISKS) c += disks_met(p, state, 1.0, w);
    return c;
}

// k: the path, whose camera ray of direction w has met the ground.
void catch_shadow(BlockParams block, PathParams p, uint k, PathState state, Surface s, vec3 w, uvec2 pixel, uint n, uint dimension) {
    Shading m = grey_shading(s, -w, 1.0);
    Caught caught = Caught(no_ray(), 0.0, sample_2d(block.seed, pixel, n, dimension + BSDF_LOBE).x);
    if (WITH_AMBIENT) add_candidate(caught, p.ambient_color, ambient_ray(block, p.occlusion, s, m.ng, pixel, n));
    if (WITH_LIGHT_SAMPLES) {
        uint last = WITH_LIGHT_GROUPS ? DISTANT_LIGHT : ANY_LIGHT;
        for (uint wanted = WITH_LIGHT_GROUPS ? PLACED_LIGHT : ANY_LIGHT; wanted <= last; wanted++) {
            vec2 u = sample_2d(block.seed, pixel, n, dimension + (wanted == DISTANT_LIGHT ? DISTANT_LIGHT_ON : LIGHT_POINT_ON));
            [[dont_unroll]] for (uint i = 0u; i < CATCHER_CANDIDATES; i++) {
                vec2 at = min(fract(u + float(i) * vec2(1.0 / float(CATCHER_CANDIDATES), CATCHER_STEP)), BELOW_1);
                LightSample l = sample_light(p, s.position, m, at, wanted, ONE_OF_EACH);
                if (!(l.pdf > 0.0)) continue;
                float side = dot(m.ng, l.wi);
                Ray r = Ray(s.position + m.ng * (sign(side) * s.offset), 0.0, l.wi, INFINITY);
                if (l.distance < INFINITY) {
                    vec3 to = l.to - r.origin;
                    float d = length(to);
                    r.direction = to / d;
                    r.tmax = d * (1.0 - SHADOW_EPSILON);
                }
                // a diffuse surface, written out: the code of all BSDFs is large
                add_candidate(caught, max(dot(m.frame.n, l.wi), 0.0) / PI * l.radiance / l.pdf, r);
            }
        }
    }
    vec3 behind = counted_radiance(p, state.throughput * behind_catcher(p, state, w), 0u);
    // frames filter the share of light as the light of a diffuse surface, whose albedo is what is behind
    if (WITH_SIGNAL) store_signal(p, k, SIGNAL_ALBEDO, vec4(max(behind, vec3(MIN_BEHIND)), SIGNAL_CAUGHT));
    leave_caught_ray(p, k, caught.ray, behind);
}

#endif
