// Features that the materials of the scene require; all others are specialized out.
#ifndef BSDF_FEATURES
#define BSDF_FEATURES
#include "interface/material_features.glsl"
#include "interface/texture_features.glsl"

// Has any material a texture for this use, one of USE_* of path/shading.glsl?
bool has_use(uint use) { return (TEXTURE_FEATURES_0 >> use & 1u) != 0u; }

#endif
