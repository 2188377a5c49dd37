// A perfect mirror. Part of bsdf/bsdf.glsl.
#ifndef BSDF_MIRROR_
#define BSDF_MIRROR_

void mirror_setup(inout Bsdf b, inout MaterialPoint point) { b.tint = SHADING_OF(point.material).specular_color; }

bool mirror_has_smooth_part(Bsdf b) { return true; }

bool mirror_has_rough_part(Bsdf b) { return false; }

BsdfValue mirror_eval(Bsdf b, vec3 wo, vec3 wi) { return NO_VALUE; }

vec3 mirror_diffuse(Bsdf b, vec3 wo, vec3 wi) { return vec3(0.0); }

BsdfSample mirror_sample(Bsdf b, vec3 wo, vec2 u, float v) { return BsdfSample(vec3(-wo.xy, wo.z), b.tint, 1.0, true, 1.0); }

#endif
