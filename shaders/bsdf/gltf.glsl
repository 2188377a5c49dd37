// glTF 2.0's material (appendix B) with its extensions: a coat over fibres over an interface, which reflects and lets light through to what
// scatters below it, or to the other side. docs/materials.md has the formulas. Part of bsdf/bsdf.glsl.
#ifndef BSDF_GLTF_
#define BSDF_GLTF_
#include "bsdf/coat.glsl"
#include "bsdf/sheen.glsl"

bool has_transmission() { return has(HAS_THIN_WALLS) || has(HAS_VOLUMES); }

// Share of light that the interface reflects, by the cosine between microfacet and view.
vec3 interface_fresnel(Bsdf b, float c) {
    if (!has(HAS_VOLUMES) || !b.volume) return fresnel_schlick(c, b.f0, b.f90);
    float cos_t;
    vec3 f = vec3(fresnel_dielectric(c, b.eta, cos_t));
    // beyond the critical angle there is nowhere else to go
    if (cos_t > 0.0) f *= b.tint;
    return mix(f, fresnel_schlick(c, b.f0, 1.0), b.metallic);
}

// What the interface lets through.
float let_through(Bsdf b, vec3 fresnel) {
    return b.under >= 0.0 ? b.under : 1.0 - highest(fresnel);
}

// How often what meets a microfacet is sampled as reflected, and not as transmitted.
float reflected_share(Bsdf b, vec3 fresnel) {
    if (!has_transmission()) return 1.0;
    float r = highest(fresnel), t = highest(b.transmitted) * (1.0 - r);
    return r + t > 0.0 ? r / (r + t) : 1.0;
}

// Each lobe is sampled by how much it reflects in all, or nearly.
void set_shares(inout Bsdf b, float cos_o) {
    vec3 f = interface_fresnel(b, cos_o);
    float r = highest(f), through = let_through(b, f);
    vec4 w = vec4(highest(b.gain * f) + highest(b.transmitted) * through, highest(b.diffuse) * through, 0.0, 0.0);
    if (has(HAS_SHEEN)) {
        w.xy *= b.sheen.kept;
        w.w = 1.0 - b.sheen.kept;
    }
    if (has(HAS_COAT) && b.coat.weight > 0.0) {
        w.z = b.coat.weight * coat_fresnel(cos_o);
        w.xyw *= 1.0 - w.z;
    }
    float sum = w.x + w.y + w.z + w.w;
    if (sum > 0.0) w /= sum;
    b.shares = Shares(w.x, w.y, w.z, w.w);
}

bool gltf_has_rough_part(Bsdf b) {
    if (b.shares.diffuse > 0.0 || has(HAS_SHEEN) && b.shares.sheen > 0.0) return true;
    if (has(HAS_COAT) && b.shares.coat > 0.0 && !is_smooth(b.coat.facets)) return true;
    return !is_smooth(b.facets) && b.shares.interface_ > 0.0;
}

// The interface's own reflection and transmission, and what is diffuse below it.
BsdfValue base_at(Bsdf b, vec3 wo, vec3 wi) {
    BsdfValue value = NO_VALUE;
    bool up = wi.z > 0.0, straight = !up && !(has(HAS_VOLUMES) && b.volume);
    if (!up && (!has_transmission() || b.transmitted == vec3(0.0) || wi.z == 0.0)) return value;
    // thin walls: what goes straight on is what would be reflected, on the other side
    vec3 w = straight ? vec3(wi.xy, -wi.z) : wi;
    vec3 m = up || straight ? normalize(wo + w) : generalized_half(b.eta, wo, wi);
    if (m == vec3(0.0)) return value;
    float om = dot(wo, m);
    vec3 f = interface_fresnel(b, om);
    float through = let_through(b, f);
    if (up) {
        float cosine = wi.z / PI;
        value = BsdfValue(b.diffuse * (through * cosine), b.shares.diffuse * cosine);
    }
    if (is_smooth(b.facets)) return value;
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, vec3(wi.xy, abs(wi.z)));
    float reflects = b.shares.interface_ * reflected_share(b, f), transmits = b.shares.interface_ - reflects;
    if (up) {
        value.f += f * b.gain * (d / (4.0 * wo.z));
        value.pdf += reflects * reflected_pdf(b.facets, wo, m);
    } else if (straight) {
        value = BsdfValue(b.transmitted * (through * d / (4.0 * wo.z)), transmits * reflected_pdf(b.facets, wo, m));
    } else {
        float im = dot(wi, m);
        value = BsdfValue(b.transmitted * (through * d * refracted_value(b.eta, wo.z, om, im)),
                          transmits * refracted_pdf(b.facets, b.eta, wo, m, im));
    }
    return value;
}

// Of all layers; without the delta lobes.
BsdfValue gltf_at(Bsdf b, vec3 wo, vec3 wi) {
    BsdfValue value = base_at(b, wo, wi);
    bool up = wi.z > 0.0;
    if (has(HAS_SHEEN) && b.sheen.kept < 1.0) {
        value.f *= min(b.sheen.kept, sheen_kept(b.sheen, abs(wi.z)));
        if (up) {
            value.f += sheen_value(b.sheen, wo, wi);
            value.pdf += b.shares.sheen / (2.0 * PI);
        }
    }
    if (has(HAS_COAT) && b.coat.weight > 0.0) {
        value.f *= coat_transmits(b.coat, wo) * coat_transmits(b.coat, wi);
        if (up && !is_smooth(b.coat.facets)) {
            BsdfValue coat = coat_at(b.coat, wo, wi);
            value.f += coat.f;
            value.pdf += b.shares.coat * coat.pdf;
        }
    }
    return value;
}

// What layers over a delta lobe of the base leave of it.
float layers_transmit(Bsdf b, vec3 wo, vec3 wi) {
    float left = 1.0;
    if (has(HAS_SHEEN) && b.sheen.kept < 1.0) left *= min(b.sheen.kept, sheen_kept(b.sheen, abs(wi.z)));
    if (has(HAS_COAT) && b.coat.weight > 0.0) left *= coat_transmits(b.coat, wo) * coat_transmits(b.coat, wi);
    return left;
}

// A microfacet, and reflection or transmission there; v: evenly in [0, 1).
BsdfSample interface_sample(Bsdf b, vec3 wo, vec2 u, float v, out bool found) {
    bool smooth_surface = is_smooth(b.facets);
    vec3 m = smooth_surface ? vec3(0.0, 0.0, 1.0) : sample_microfacet(b.facets, wo, u);
    float om = dot(wo, m);
    vec3 f = interface_fresnel(b, om);
    float share = reflected_share(b, f);
    BsdfSample s = BsdfSample(2.0 * om * m - wo, vec3(0.0), 1.0, smooth_surface, 1.0);
    found = om > 0.0;
    if (v < share) {
        found = found && s.wi.z > 0.0;
        if (smooth_surface) {
            s.pdf = b.shares.interface_ * share;
            s.weight = f * layers_transmit(b, wo, s.wi) / s.pdf;
        }
        return s;
    }
    if (has(HAS_VOLUMES) && b.volume) {
        float cos_t;
        float all_ = fresnel_dielectric(om, b.eta, cos_t);
        found = found && cos_t > 0.0;
        s.wi = refracted(b.eta, wo, m, om, cos_t);
        s.eta = b.eta;
    } else {
        s.wi.z = -s.wi.z;
    }
    found = found && s.wi.z < 0.0;
    if (smooth_surface) {
        s.pdf = b.shares.interface_ * (1.0 - share);
        s.weight = b.transmitted * (let_through(b, f) * layers_transmit(b, wo, s.wi) / (s.pdf * s.eta * s.eta));
    }
    return s;
}

BsdfSample gltf_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    if (v < b.shares.interface_) {
        bool found;
        BsdfSample s = interface_sample(b, wo, u, v / b.shares.interface_, found);
        if (found) return s;
        return NO_SAMPLE;
    }
    if (v < b.shares.interface_ + b.shares.diffuse) return proposed(cosine_hemisphere(u), 1.0);
    if (has(HAS_COAT) && v < b.shares.interface_ + b.shares.diffuse + b.shares.coat) {
        vec3 m = coat_microfacet(b.coat, wo, u);
        vec3 wi = 2.0 * dot(wo, m) * m - wo;
        if (!(wi.z > 0.0)) return NO_SAMPLE;
        if (!is_smooth(b.coat.facets)) return proposed(wi, 1.0);
        float weight = b.coat.weight * coat_fresnel(dot(wo, m)) / b.shares.coat;
        return BsdfSample(wi, vec3(weight), b.shares.coat, true, 1.0);
    }
    if (has(HAS_SHEEN) && b.shares.sheen > 0.0) return proposed(uniform_hemisphere(u), 1.0);
    return NO_SAMPLE;
}

// What goes straight through a thin wall without roughness.
vec3 gltf_straight(Bsdf b, vec3 wo) {
    if (b.volume || !is_smooth(b.facets)) return vec3(0.0);
    return b.transmitted * (let_through(b, interface_fresnel(b, wo.z)) * layers_transmit(b, wo, -wo));
}

#endif
