// Retroreflection: a microfacet lobe about the direction that light comes from, of Portsmouth, Raab, Belcour, Liu, "The Minimal
// Retroreflective Microfacet Model", JCGT 15(1), 2026 (KHR_materials_retroreflection). Part of bsdf/gltf.glsl.
#ifndef BSDF_RETROREFLECTION_
#define BSDF_RETROREFLECTION_

// A direction mirrored at the normal. Distributions that are the same half a turn around the normal, as all here are, reflect as much to it.
vec3 mirror_image(vec3 w) { return vec3(-w.xy, w.z); }

#endif
