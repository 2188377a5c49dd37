// Kinds of lights behind one interface: where light comes from at a point, and how likely that is sampled.
//
//     LightSample light_sample(PathParams, LightRecord, from, Shading, u)   a direction to a light from a point with a surface, by two uniform numbers
//     float light_pdf(LightRecord, from, wi, distance)    density with which light_sample finds what a ray met there, per solid angle; 0 for what no ray
//                                                         meets, and for what is outside the scene (path/path.glsl weighs that)
//
//     float sky_pdf(PathParams, Shading, from, wi)    density with which light_sample finds what is outside the scene in a direction, but for distant disks
//
// The integrator knows no more than this: a kind is a file in this folder that defines both with its name before them (`spot_sample`, `spot_pdf`), and a line of
// `LightKinds` in src/interface/features.rs, of which the functions above are made. Densities of distant lights are multiplied by the probability of choosing
// one among them, LightRecord.probability, because several may shine from the same direction. Those of placed lights are of the point alone.
#ifndef LIGHTS_LIGHT
#define LIGHTS_LIGHT
#include "common/warp.glsl"
#include "interface/light_kinds.glsl"
#include "interface/lights.glsl"
#include "path/shading.glsl"

struct LightSample {
    vec3 wi;          // unit, towards the light
    float distance;   // to it, infinite for the environment
    vec3 to;          // a point on the light, for finite distances
    vec3 radiance;    // of a light without extent: times its solid angle
    float pdf;        // per solid angle, of point and choice; 0: there is no sample
    bool delta;       // no BSDF sample could find it
};

const LightSample NO_LIGHT_SAMPLE = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), vec3(0.0), 0.0, false);

float sky_pdf(PathParams p, Shading m, vec3 from, vec3 wi);

// True if the light is of this kind. Kinds that the scene lacks are specialized out; if all lights are of one kind, there is no comparison.
bool is_kind(LightRecord light, uint kind) {
    return (LIGHT_KINDS_0 >> kind & 1u) != 0u && (LIGHT_KINDS_0 == 1u << kind || light.kind == kind);
}

#endif
