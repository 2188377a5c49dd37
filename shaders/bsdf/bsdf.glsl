// Reflection models behind one interface: how much of the light from wi leaves towards wo, and where to look for it.
//
//     BsdfValue bsdf_eval(Bsdf, wo, wi)         value times |cos wi|, and the density with which bsdf_sample proposes wi, per solid angle; both
//                                             without the delta lobes
//     vec3 bsdf_diffuse(Bsdf, wo, wi)         the diffuse reflection's part of that value, divided by Bsdf::diffuse
//     BsdfSample bsdf_sample(Bsdf, wo, u, v)  a direction, and of a delta lobe weight and probability; of the others bsdf_eval knows them
//
//     has_rough_part(Bsdf), has_smooth_part(Bsdf)   is there anything that light samples could find, or that only samples of the BSDF can
//     bsdf_setup(Bsdf, MaterialPoint)         fills in a Bsdf of its kind from a material's record and textures (path/shading.glsl)
//
// Directions are unit vectors in the frame of the shading normal, z on the side from which the surface is seen: wo.z > 0. The integrator knows
// no more than this: a model is a file in this folder that defines these functions with its name before them, and a line in src/interface/features.rs (`BsdfModels`), of
// which the functions above are made. docs/reference/materials.md has the formulas.
#ifndef BSDF_BSDF
#define BSDF_BSDF
#include "common/warp.glsl"
#include "interface/bsdf_models.glsl"
#include "bsdf/features.glsl"
#include "bsdf/microfacet.glsl"
#include "bsdf/albedo.glsl"

// A layer over another: clearcoat.
struct Clearcoat {
    float weight;
    vec3 normal;  // in the frame
    Microfacets facets;
};

// Fibres over another layer.
struct Sheen {
    vec3 color;
    float alpha;
    float kept;  // of what is below, on wo's side
};

// A thin film over the interface of a glTF material: iridescence.
struct Film {
    float weight;
    float thickness;  // nanometres
    float ior;
    vec3 f0;          // of the dielectric part of what is below
    vec3 metal_f0;    // and of the metal
    vec3 dielectric_share;  // of all that is reflected, energy compensation included
    vec3 metal_share;
};

// How often each lobe of a glTF material is sampled; the sum is 1.
struct LobeProbabilities {
    float interface_;  // specular reflection and transmission
    float diffuse;
    float through;     // diffuse transmission
    float clearcoat;
    float sheen;
};

struct Bsdf {
    uint kind;
    vec3 diffuse;
    vec3 through;      // of what is transmitted diffusely
    float through_share;   // of what is diffuse
    vec3 f0;           // glTF: Schlick's term of dielectric and metal, mixed; of volumes the metal's part alone. Conductor: index of refraction
    vec3 f90;
    float dielectric_f0;   // Schlick's term of a glTF material's dielectric part, in its brightest channel
    float dielectric_f90;
    vec3 k;
    vec3 tint;         // of what is reflected
    vec3 transmitted;  // of what is refracted
    float eta;         // index of refraction beyond the surface over that on wo's side
    float dielectric_weight;   // of the exact Fresnel term of a volume: 1 - metallic, times its energy compensation
    bool volume;       // what is transmitted is refracted; else it goes straight on, through thin walls
    Microfacets facets;
    float base_transmittance;  // with energy compensation: share of light that reaches what is under the interface
    Clearcoat clearcoat;
    Sheen sheen;
    Film film;
    float retroreflected;  // share of what the interface reflects that returns to where it came from
    LobeProbabilities probabilities;
    vec3 ng;           // geometric normal in the frame, on the viewer's side
};

struct BsdfValue {
    vec3 f;     // value times |cos wi|
    float pdf;
};

struct BsdfSample {
    vec3 wi;
    vec3 weight;  // value times |cos| over density
    float pdf;    // 0: nothing was sampled
    bool delta;
    float eta;    // refracted: `eta` of the surface; else 1
};

// A direction whose weight and density bsdf_eval tells.
BsdfSample proposed(vec3 wi, float eta) { return BsdfSample(wi, vec3(0.0), 1.0, false, eta); }

const BsdfValue NO_VALUE = BsdfValue(vec3(0.0), 0.0);
const BsdfSample NO_SAMPLE = BsdfSample(vec3(0.0, 0.0, 1.0), vec3(0.0), 0.0, false, 1.0);

// A black surface, which absorbs everything.
Bsdf black_bsdf() {
    Bsdf b;
    b.kind = BSDF_NONE;
    b.diffuse = b.through = b.f0 = b.k = b.transmitted = vec3(0.0);
    b.tint = b.f90 = vec3(1.0);
    b.dielectric_f0 = b.through_share = b.retroreflected = 0.0;
    b.dielectric_f90 = b.dielectric_weight = b.eta = b.base_transmittance = 1.0;
    b.volume = false;
    b.facets = Microfacets(vec2(1.0), false);
    b.clearcoat = Clearcoat(0.0, vec3(0.0, 0.0, 1.0), b.facets);
    b.sheen = Sheen(vec3(0.0), 1.0, 1.0);
    b.film = Film(0.0, 0.0, 1.0, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    b.probabilities = LobeProbabilities(0.0, 0.0, 0.0, 0.0, 0.0);
    b.ng = vec3(0.0, 0.0, 1.0);
    return b;
}

float highest(vec3 c) { return max(c.r, max(c.g, c.b)); }

// What is left of light from (or to) a direction where the normal n of a rough lobe leans away from the geometric normal: the lobe alone would gain light
// from directions near the surface, and end it abruptly at the horizon (Chiang, Li, Burley, "Taming the Shadow Terminator", SIGGRAPH 2019 talks). At most
// 1: no lobe is brighter than n alone makes it. All in the frame; wi may be on either side of both normals.
float shadowing(vec3 ng, vec3 n, vec3 wi) {
    if (!HAS_SHADING_NORMALS) return 1.0;
    float g = dot(ng, wi) / (dot(n, wi) * dot(ng, n));
    if (g >= 1.0) return 1.0;
    return g > 0.0 ? g * (1.0 + g * (1.0 - g)) : 0.0;
}

const vec3 FRAME_NORMAL = vec3(0.0, 0.0, 1.0);

// True if the BSDF is of this kind. Models that no material has are specialized out.
bool is_bsdf(Bsdf b, uint kind, bool feature) { return feature && b.kind == kind; }

#endif
