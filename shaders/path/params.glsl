// Parameters of the path tracer's passes, and the state of each path.
#ifndef PATH_PARAMS
#define PATH_PARAMS
#include "common/camera.glsl"
#include "interface/path.glsl"
#include "interface/path_features.glsl"
#include "interface/bsdf_models.glsl"
#include "bsdf/features.glsl"

const uint NO_MEDIUM = 0xffffffffu;

// The parameters of a pass of paths.
PathParams path_params() { return PathParams(behind_block(0u)); }

// Those that it has besides in frames in real time.
PathFrameParams path_frame_params() { return PathFrameParams(behind_block(PATH_PARAMS_BYTES)); }

// A path between two bounces, in memory a PathRecord.
struct PathState {
    vec3 throughput;
    float pdf;       // density of BSDF sampling for the ray's direction; negative: no MIS weight, only BSDF sampling finds it
    uint index;      // of its camera ray
    uint depth;      // bounces so far
    uint passes;     // surfaces that it went straight through: they are no bounces
    bool is_single;  // it has one wavelength (path/wavelength.glsl)
    float eta_scale; // product of squared relative indices of refraction, by which Russian roulette scales throughput
    uint medium;     // material of the volume that it is in, or NO_MEDIUM
};

// What a bounce reads and writes lies in the order of its queue, one vector of paths after the other: fetched ahead, where by path each would be a wait.
// What refraction alone changes is stored where something refracts.
const bool WITH_REFRACTION = HAS_DIELECTRIC || HAS_VOLUMES || WITH_MEDIA;

PathState load_state(PathParams p, uint k) {
    uvec4 a = LOAD_QUAD(p.states, 2u * k);
    uvec2 b = LOAD_PAIR(p.states, 4u * k + 2u), c = uvec2(floatBitsToUint(WITH_CONSTANT_ALBEDO ? p.albedo : 1.0), NO_MEDIUM);
    if (WITH_REFRACTION) c = LOAD_PAIR(p.states, 4u * k + 3u);
    return PathState(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), b.x, b.y & 0x7fffu, b.y >> 16, (b.y & 0x8000u) != 0u, uintBitsToFloat(c.x), c.y);
}

void store_state(uvec2 states, uint k, PathState s) {
    STORE_PAIR(states, 4u * k, floatBitsToUint(s.throughput.xy));
    STORE_PAIR(states, 4u * k + 1u, floatBitsToUint(vec2(s.throughput.z, s.pdf)));
    STORE_PAIR(states, 4u * k + 2u, uvec2(s.index, s.depth | (s.is_single ? 0x8000u : 0u) | s.passes << 16));
    if (WITH_REFRACTION) STORE_PAIR(states, 4u * k + 3u, uvec2(floatBitsToUint(s.eta_scale), s.medium));
}

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer StoredFloats { float v[]; };

// Ambient visibility of a path's first surface, if that darkens all of its light; `radiance` counts in its fourth number the camera ray's hit, and the occlusion ray that met
// nothing.
float occluded_share(uint occludes_all, vec4 radiance) {
    return occludes_all != 0u && radiance.a == 1.0 ? 0.0 : 1.0;
}

// The parts of a SignalRecord, a vector each.
const uint SIGNAL_QUADS = SIGNAL_RECORD_PAIRS / 2u;
const uint SIGNAL_DIRECT = 0u;    // and coverage
const uint SIGNAL_DIFFUSE = 1u;   // and the distance of what is reflected
const uint SIGNAL_ALBEDO = 2u;    // and the phase
const uint SIGNAL_SHARE = 3u;

vec4 load_signal(PathParams p, uint k, uint part) { return load_quad(p.signals, SIGNAL_QUADS * k + part); }

void store_signal(PathParams p, uint k, uint part, vec4 value) { store_quad(p.signals, SIGNAL_QUADS * k + part, value); }

void clear_signal(PathParams p, uint k) {
    store_signal(p, k, SIGNAL_DIRECT, vec4(0.0));
    store_signal(p, k, SIGNAL_DIFFUSE, vec4(vec3(0.0), SIGNAL_UNKNOWN));
    store_signal(p, k, SIGNAL_ALBEDO, vec4(vec3(0.0), SIGNAL_SEEN));
    store_signal(p, k, SIGNAL_SHARE, vec4(0.0));
}

void add_diffuse(PathParams p, uint k, vec3 c) {
    store_signal(p, k, SIGNAL_DIFFUSE, load_signal(p, k, SIGNAL_DIFFUSE) + vec4(c, 0.0));
}

#endif
