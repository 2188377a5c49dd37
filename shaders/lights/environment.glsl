// The environment: a map, or a constant radiance.
#ifndef LIGHTS_ENVIRONMENT
#define LIGHTS_ENVIRONMENT
#include "lights/light.glsl"
#include "lights/portal.glsl"
#include "path/map.glsl"

// Radiance of the environment from direction w.
vec3 environment_radiance(PathParams p, vec3 w) {
    if (!WITH_ENVIRONMENT_MAP) return p.environment;
    return p.environment * map_radiance(map_point(p.map, w));
}

// What a camera ray shows that leaves the scene, where that is not the light from there.
const bool WITH_BACKGROUND = WITH_HIDDEN_BACKGROUND || WITH_BLURRED_BACKGROUND;

vec3 background_radiance(PathParams p, vec3 w) {
    if (WITH_HIDDEN_BACKGROUND) return vec3(0.0);
    if (!WITH_ENVIRONMENT_MAP) return p.environment;
    EnvironmentRecord map = p.map;
    map.texels = map.blurred;
    map.width = BLURRED_WIDTH;
    map.height = BLURRED_HEIGHT;
    return p.environment * map_radiance(map_point(map, w));
}

// Radiance of a map from direction w, and the density with which its directions are sampled.
vec4 environment_and_pdf(PathParams p, vec3 w) {
    MapPoint at = map_point(p.map, w);
    return vec4(p.environment * map_radiance(at), p.environment_probability * map_pdf(p.map, at));
}

// Can light from behind the surface be scattered to the viewer?
bool transmits_light(Shading m) {
    return (has_transmission() || HAS_DIELECTRIC) && m.bsdf.transmitted != vec3(0.0) || is_translucent(m.bsdf);
}

// A constant environment is sampled by the cosine to the shading normal, as a diffuse surface scatters it, on each side that light may come from. Per solid
// angle.
float constant_environment_pdf(Shading m, vec3 w) {
    float c = dot(m.frame.n, w) / PI;
    return transmits_light(m) ? 0.5 * abs(c) : max(c, 0.0);
}

// Direction (world), and its pdf.
vec4 sample_constant_environment(Shading m, vec2 u) {
    bool behind = transmits_light(m) && u.x >= 0.5;
    if (transmits_light(m)) u.x = behind ? 2.0 * u.x - 1.0 : 2.0 * u.x;
    vec3 w = cosine_hemisphere(u);
    w = from_frame(m.frame, behind ? vec3(w.xy, -w.z) : w);
    return vec4(w, constant_environment_pdf(m, w));
}

// Without portals that of a map does not depend on the surface.
const bool SKY_PDF_OF_SURFACE = HAS_ENVIRONMENT_LIGHTS && !WITH_ENVIRONMENT_MAP || HAS_PORTAL_LIGHTS;

float sky_pdf(PathParams p, Shading m, vec3 from, vec3 wi) {
    float all_ = p.environment_probability * (WITH_ENVIRONMENT_MAP ? map_pdf(p.map, map_point(p.map, wi)) : constant_environment_pdf(m, wi));
    if (HAS_PORTAL_LIGHTS) all_ += portals_pdf(p, from, wi);
    return all_;
}

LightSample environment_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u) {
    LightSample l = NO_LIGHT_SAMPLE;
    l.distance = INFINITY;
    if (WITH_ENVIRONMENT_MAP) {
        MapSample s = sample_map(p.map, u);
        l.wi = s.wi;
        l.radiance = p.environment * s.radiance;
        l.pdf = light.probability * s.pdf;
    } else {
        vec4 s = sample_constant_environment(m, u);
        l.wi = s.xyz;
        l.radiance = p.environment;
        l.pdf = light.probability * s.w;
    }
    // what a portal could have sampled as well counts once
    if (HAS_PORTAL_LIGHTS && l.pdf > 0.0) l.pdf += portals_pdf(p, from, l.wi);
    return l;
}

// No surface: path/path.glsl weighs what a ray meets that leaves the scene.
float environment_pdf(LightRecord light, vec3 from, vec3 wi, float distance) { return 0.0; }

#endif
