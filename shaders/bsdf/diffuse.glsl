// Lambert. Part of bsdf/bsdf.glsl.
#ifndef BSDF_DIFFUSE_
#define BSDF_DIFFUSE_

void diffuse_setup(inout Bsdf b, inout MaterialPoint point) { b.diffuse = point.base; }

bool diffuse_has_smooth_part(Bsdf b) { return false; }

bool diffuse_has_rough_part(Bsdf b) { return true; }

BsdfValue diffuse_eval(Bsdf b, vec3 wo, vec3 wi) {
    float pdf = max(wi.z, 0.0) / PI;
    return BsdfValue(b.diffuse * pdf * shadowing(b.ng, FRAME_NORMAL, wi), pdf);
}

vec3 diffuse_diffuse(Bsdf b, vec3 wo, vec3 wi) { return vec3(max(wi.z, 0.0) / PI * shadowing(b.ng, FRAME_NORMAL, wi)); }

BsdfSample diffuse_sample(Bsdf b, vec3 wo, vec2 u, float v) { return proposed(cosine_hemisphere(u), 1.0); }

#endif
