// Surface properties that camera rays return in place of radiance.
#ifndef PATH_VIEW
#define PATH_VIEW
#include "interface/view.glsl"
#include "path/shading.glsl"

// Base colour, linear; of mirrors, glass and conductors the reflectance at normal incidence.
vec3 surface_albedo(Surface s, float log_side) {
    SubmeshRecord submesh = load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh);
    ShadingRecord m = SHADING_OF(submesh.material);
    bool coloured = m.model == BSDF_MIRROR || m.model == BSDF_DIELECTRIC || m.model == BSDF_CONDUCTOR;
    vec3 base = shown_color(s, submesh, MaterialRecords(SceneRoot(push.scene).materials).v[submesh.material], log_side);
    if (!coloured) return base;
    return m.model == BSDF_CONDUCTOR ? m.specular_color * fresnel_conductor(1.0, m.eta, m.k) : m.specular_color;
}

// Ambient visibility by the material's occlusion texture, weighted by its strength; 1 without one.
float baked_visibility(Surface s, float log_side) {
    SubmeshRecord submesh = SubmeshRecords(SceneRoot(push.scene).submeshes).v[s.submesh];
    float visibility = look_up_one(USE_OCCLUSION, s, submesh, log_side).r;
    return 1.0 + SHADING_OF(submesh.material).occlusion_strength * (visibility - 1.0);
}

// albedo: surface_albedo().
vec3 view_value(uint view, Surface s, Shading shown, float distance_, float log_side, vec3 albedo) {
    if (view == VIEW_DEPTH) return vec3(distance_);
    if (view == VIEW_NORMALS) return shown.frame.n;
    if (view == VIEW_BAKED_OCCLUSION) return vec3(baked_visibility(s, log_side));
    return albedo;
}

#endif
