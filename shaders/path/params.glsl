// Parameters of the path tracer's passes, and what it keeps of each path. Mirrors src/render/path/params.rs.
#ifndef PATH_PARAMS
#define PATH_PARAMS
#include "common/camera.glsl"
#include "interface/path_features.glsl"

// An environment in equirectangular projection.
struct EnvironmentMap {
    uvec2 texels;    // a quad each: linear radiance, and the weight with which directions there are drawn; null: the environment is one colour
    uvec2 table;     // floats: what directions are drawn with (path/map.glsl)
    uint width;
    uint height;
    uint map_reserved0;
    uint map_reserved1;
    vec4 to_map[3];  // rows: world directions to the map's own, in which +y is up and -z in the middle
};

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer PathParams {
    EnvironmentMap map;
    vec3 environment;     // radiance; factor of the map's
    uint light_count;
    uvec2 lights;         // LightRecord
    uvec2 light_of;       // uints: for each instance of the scene where in this table its primitives' lights begin, or INVALID; then those lights
    uvec2 states;         // PathState of each ray of the queue that is traced
    uvec2 next_states;    // of the next bounce's
    uvec2 radiance;       // a quad a path: radiance, and 1 where its camera ray met something
    uvec2 contributions;  // a quad for each ray of the shadow queue: what it brings if nothing is in the way
    uvec2 tags;           // of the queue that is traced: which path a ray belongs to
    RayQueue next;        // rays of the next bounce
    RayQueue shadow;      // rays to lights
    uint max_depth;       // bounces
    uint rr_depth;        // bounces before Russian roulette
    float clamp_to;       // no path vertex adds more than this in any channel; infinite: none is held
    float albedo;         // of grey surfaces
    uint environment_light;  // its place among the lights, or INVALID
    uint pixel_filter;    // FILTER_*
    float lens_radius;    // world units; 0: a pinhole
    float focus;          // distance along the view at which the image is sharp
    uint view;            // VIEW_*: no light, but what camera rays see
    uint light_first;     // of the lights that are chosen by power
    uvec2 light_tree;     // LightNode of those before
    uvec2 cones;          // a pair a path: width and spread of its cone (path/cone.glsl)
    uvec2 light_starts;   // a uint for each light that is chosen by power, and one more: from which number on it is chosen
    uint first_disk;      // of the directional lights
    uint disk_count;      // how many there are
    uvec2 media;          // a quad a path: the volumes that it is in (path/media.glsl)
    uvec2 straight;       // a float a path: how far it has come straight through thin walls
    uvec4 camera_media;   // volumes that the camera is in
    RayQueue later;       // rays to lights that have come through thin walls
    uvec2 later_contributions;
    uvec2 environment_pdfs;  // a float a path: density with which light samples at its last bounce draw its direction from an environment of one colour
};

const uint NO_MEDIUM = 0xffffffffu;

// A path between two bounces: 32 bytes.
struct PathState {
    vec3 throughput;
    float pdf;       // with which the BSDF proposed its ray; negative: nothing else could have
    uint index;      // of its camera ray
    uint depth;      // bounces so far
    uint passes;     // surfaces that it went straight through: they are no bounces
    float eta_scale; // refraction changed radiance by 1 / this
    uint medium;     // material of the volume that it is in, or NO_MEDIUM
};

// What a bounce reads and writes lies in the order of its queue, one vector of paths after the other: fetched ahead, where by path each would be a wait.
PathState load_state(uvec2 states, uint k) {
    uvec4 a = Quads(states).v[2u * k], b = Quads(states).v[2u * k + 1u];
    return PathState(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), b.x, b.y & 0xffffu, b.y >> 16, uintBitsToFloat(b.z), b.w);
}

void store_state(uvec2 states, uint k, PathState s) {
    STORE_PAIR(states, 4u * k, floatBitsToUint(s.throughput.xy));
    STORE_PAIR(states, 4u * k + 1u, floatBitsToUint(vec2(s.throughput.z, s.pdf)));
    STORE_PAIR(states, 4u * k + 2u, uvec2(s.index, s.depth | s.passes << 16));
    STORE_PAIR(states, 4u * k + 3u, uvec2(floatBitsToUint(s.eta_scale), s.medium));
}

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer StoredFloats { float v[]; };

vec4 load_quad(uvec2 base, uint k) {
    return uintBitsToFloat(Quads(base).v[k]);
}

void store_quad(uvec2 base, uint k, vec4 q) {
    STORE_PAIR(base, 2u * k, floatBitsToUint(q.xy));
    STORE_PAIR(base, 2u * k + 1u, floatBitsToUint(q.zw));
}

#endif
