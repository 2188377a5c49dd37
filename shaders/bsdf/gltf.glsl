// glTF 2.0's material (appendix B) with its extensions: a clearcoat over fibres over an interface, which reflects and lets light through to what
// scatters below it, or to the other side. docs/reference/materials.md has the formulas. Part of bsdf/bsdf.glsl.
#ifndef BSDF_GLTF_
#define BSDF_GLTF_
#include "bsdf/clearcoat.glsl"
#include "bsdf/iridescence.glsl"
#include "bsdf/retroreflection.glsl"
#include "bsdf/sheen.glsl"

bool has_transmission() { return HAS_THIN_WALLS || HAS_VOLUMES; }

// Is any light of a Bsdf transmitted diffusely?
bool is_translucent(Bsdf b) { return HAS_DIFFUSE_TRANSMISSION && b.through != vec3(0.0); }

// What microfacets do with light.
struct InterfaceFresnel {
    vec3 reflected;     // share that they reflect: mix(dielectric, metal, metallic)
    float transmitted;  // share that the dielectric part lets through to the other side
    float diffuse;      // and to what is diffuse below it
};

// By the cosine between microfacet and view.
InterfaceFresnel interface_fresnel(Bsdf b, float c) {
    float weight = schlick_weight(c);
    vec3 reflected = mix(b.f0, b.f90, weight);
    float dielectric = mix(b.dielectric_f0, b.dielectric_f90, weight);
    if (HAS_VOLUMES && b.volume) {
        float cos_t;
        float f = fresnel_dielectric(c, b.eta, cos_t);
        // beyond the critical angle there is nowhere else to go
        vec3 tint = cos_t > 0.0 ? b.tint : vec3(1.0);
        dielectric = f * highest(tint);
        reflected += b.dielectric_weight * f * tint;
    }
    if (HAS_IRIDESCENCE && b.film.weight > 0.0) {
        // from inside of a volume by the cosine outside, where nothing gets beyond the critical angle
        float outside = c;
        if (HAS_VOLUMES && b.volume && b.eta < 1.0) fresnel_dielectric(c, b.eta, outside);
        vec3 of_dielectric = outside > 0.0 ? film_fresnel(b.film, outside, b.film.f0) : vec3(1.0);
        vec3 all_reflected = b.film.dielectric_share * of_dielectric;
        if (b.film.metal_share != vec3(0.0)) all_reflected += b.film.metal_share * film_fresnel(b.film, outside, b.film.metal_f0);
        reflected = mix(reflected, all_reflected, b.film.weight);
        dielectric = mix(dielectric, highest(of_dielectric), b.film.weight);
    }
    InterfaceFresnel all_ = InterfaceFresnel(reflected, 1.0 - dielectric, 1.0 - dielectric);
    if (HAS_COMPENSATION) {
        all_.diffuse = b.base_transmittance;
        // how much is refracted depends on the microfacet; what goes straight on has one factor for all
        if (!HAS_VOLUMES || !b.volume) all_.transmitted = b.base_transmittance;
    }
    return all_;
}

// Sets the Fresnel terms of a glTF material, f0 and f90 those of its dielectric part: the specification's mix(dielectric, metal, metallic), each
// part with its own energy compensation. albedo_layer: the first of the volume's tables, on the viewer's side.
void set_interface(inout Bsdf b, vec3 f0, float f90, vec3 base, float metallic, float cos_o, float roughness, uint albedo_layer) {
    vec3 dielectric_gain = vec3(1.0), metal_gain = vec3(1.0);
    bool volume = HAS_VOLUMES && b.volume;
    if (HAS_COMPENSATION) {
        bool smooth_surface = is_smooth(b.facets);
        float e = smooth_surface ? 1.0 : ggx_albedo(cos_o, roughness);
        metal_gain += base * ((1.0 - e) / e);
        if (volume) {
            DielectricAlbedo a;
            if (smooth_surface) {
                float cos_t;
                float f = fresnel_dielectric(cos_o, b.eta, cos_t) * (cos_t > 0.0 ? highest(b.tint) : 1.0);
                a = DielectricAlbedo(f, 1.0 - f);
            } else {
                a = dielectric_albedo(albedo_layer, cos_o, roughness, e, highest(b.tint));
            }
            float gain = 1.0 / (a.reflected + a.transmitted);
            dielectric_gain = vec3(gain);
            b.transmitted *= gain;
            b.base_transmittance = clamp(1.0 - gain * a.reflected, 0.0, 1.0);
        } else {
            float weight = smooth_surface ? schlick_weight(cos_o) : ggx_schlick_weight(cos_o, roughness);
            dielectric_gain += f0 * ((1.0 - e) / e);
            b.base_transmittance = clamp(1.0 - e * highest(dielectric_gain * mix(f0, vec3(f90), weight)), 0.0, 1.0);
            // thin walls transmit by the lobe by which they reflect, and lose as much
            b.transmitted /= e;
        }
    }
    if (HAS_IRIDESCENCE && b.film.weight > 0.0) {
        b.film.f0 = f0;
        b.film.metal_f0 = base;
        b.film.dielectric_share = (1.0 - metallic) * dielectric_gain;
        b.film.metal_share = metallic * metal_gain;
        if (HAS_COMPENSATION) {
            // what is below gets what the film leaves as it is seen from here
            float e = is_smooth(b.facets) ? 1.0 : ggx_albedo(cos_o, roughness);
            float left = 1.0 - e * highest(dielectric_gain * film_fresnel(b.film, cos_o, f0));
            b.base_transmittance = mix(b.base_transmittance, clamp(left, 0.0, 1.0), b.film.weight);
        }
    }
    b.dielectric_f0 = highest(f0);
    b.dielectric_f90 = f90;
    b.dielectric_weight = (1.0 - metallic) * dielectric_gain.x;
    // volumes have the exact term in place of Schlick's
    vec3 dielectric = volume ? vec3(0.0) : (1.0 - metallic) * dielectric_gain, metal = metallic * metal_gain;
    b.f0 = dielectric * f0 + metal * base;
    b.f90 = dielectric * f90 + metal;
}

// How often what meets a microfacet is sampled as reflected, and not as transmitted.
float reflected_probability(Bsdf b, InterfaceFresnel f) {
    if (!has_transmission()) return 1.0;
    float r = highest(f.reflected), t = highest(b.transmitted) * f.transmitted;
    return r + t > 0.0 ? r / (r + t) : 1.0;
}

// Each lobe is sampled by how much it reflects in all, or nearly.
void set_probabilities(inout Bsdf b, float cos_o) {
    InterfaceFresnel f = interface_fresnel(b, cos_o);
    vec4 w = vec4(highest(f.reflected) + highest(b.transmitted) * f.transmitted, highest(b.diffuse) * f.diffuse, 0.0, 0.0);
    float through = HAS_DIFFUSE_TRANSMISSION ? highest(b.through) * f.diffuse : 0.0;
    if (HAS_SHEEN) {
        w.xy *= b.sheen.kept;
        through *= b.sheen.kept;
        w.w = 1.0 - b.sheen.kept;
    }
    if (HAS_CLEARCOAT && b.clearcoat.weight > 0.0) {
        w.z = b.clearcoat.weight * clearcoat_fresnel(cos_o);
        w.xyw *= 1.0 - w.z;
        through *= 1.0 - w.z;
    }
    float sum = w.x + w.y + w.z + w.w + through;
    if (sum > 0.0) {
        w /= sum;
        through /= sum;
    }
    b.probabilities = LobeProbabilities(w.x, w.y, through, w.z, w.w);
}

bool gltf_has_rough_part(Bsdf b) {
    if (b.probabilities.diffuse > 0.0 || HAS_DIFFUSE_TRANSMISSION && b.probabilities.through > 0.0) return true;
    if (HAS_SHEEN && b.probabilities.sheen > 0.0) return true;
    if (HAS_CLEARCOAT && b.probabilities.clearcoat > 0.0 && !is_smooth(b.clearcoat.facets)) return true;
    return !is_smooth(b.facets) && b.probabilities.interface_ > 0.0;
}

// Share of light that reaches what is diffuse, for an interface that is retroreflective in part; f: as it reflects to wo.
float diffuse_share_at(Bsdf b, InterfaceFresnel f, vec3 wo, vec3 wi) {
    if (!HAS_RETROREFLECTION || b.retroreflected == 0.0) return f.diffuse;
    vec3 back = mirror_image(wo);
    return mix(f.diffuse, interface_fresnel(b, dot(back, normalize(back + wi))).diffuse, b.retroreflected);
}

// What the interface reflects back to where it came from: what it would reflect to the mirror image of wo about the normal.
BsdfValue retroreflected_at(Bsdf b, vec3 wo, vec3 wi) {
    vec3 back = mirror_image(wo), m = normalize(back + wi);
    InterfaceFresnel f = interface_fresnel(b, dot(back, m));
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, back, wi);
    float reflects = b.probabilities.interface_ * reflected_probability(b, f);
    return BsdfValue(f.reflected * (d / (4.0 * wo.z)), reflects * reflected_pdf(b.facets, back, m));
}

// The interface's own reflection and transmission, and what is diffuse below it.
BsdfValue base_at(Bsdf b, vec3 wo, vec3 wi) {
    BsdfValue value = NO_VALUE;
    bool up = wi.z > 0.0, straight = !up && !(HAS_VOLUMES && b.volume);
    if (!up && wi.z < 0.0 && is_translucent(b)) {
        // what is below lies behind the interface as light crosses it to be reflected
        float cosine = -wi.z / PI, diffuse = interface_fresnel(b, dot(wo, normalize(wo + vec3(wi.xy, -wi.z)))).diffuse;
        value = BsdfValue(b.through * (diffuse * cosine), b.probabilities.through * cosine);
    }
    if (!up && (!has_transmission() || b.transmitted == vec3(0.0) || wi.z == 0.0)) return value;
    // thin walls: what goes straight on is what would be reflected, on the other side
    vec3 w = straight ? vec3(wi.xy, -wi.z) : wi;
    vec3 m = up || straight ? normalize(wo + w) : generalized_half(b.eta, wo, wi);
    if (m == vec3(0.0)) return value;
    float om = dot(wo, m);
    InterfaceFresnel f = interface_fresnel(b, om);
    if (up) {
        float cosine = wi.z / PI;
        value = BsdfValue(b.diffuse * (diffuse_share_at(b, f, wo, wi) * cosine), b.probabilities.diffuse * cosine);
    }
    if (is_smooth(b.facets)) return value;
    float d = distribution(b.facets, m) * masking_shadowing(b.facets, wo, vec3(wi.xy, abs(wi.z)));
    float reflects = b.probabilities.interface_ * reflected_probability(b, f), transmits = b.probabilities.interface_ - reflects;
    if (up) {
        float share = 1.0;
        if (HAS_RETROREFLECTION && b.retroreflected > 0.0) {
            share -= b.retroreflected;
            BsdfValue back = retroreflected_at(b, wo, wi);
            value.f += back.f * b.retroreflected;
            value.pdf += back.pdf * b.retroreflected;
        }
        value.f += f.reflected * (share * d / (4.0 * wo.z));
        value.pdf += share * reflects * reflected_pdf(b.facets, wo, m);
    } else if (straight) {
        value.f += b.transmitted * (f.transmitted * d / (4.0 * wo.z));
        value.pdf += transmits * reflected_pdf(b.facets, wo, m);
    } else {
        float im = dot(wi, m);
        value.f += b.transmitted * (f.transmitted * d * refracted_value(b.eta, wo.z, om, im));
        value.pdf += transmits * refracted_pdf(b.facets, b.eta, wo, m, im);
    }
    return value;
}

// Of all layers; without the delta lobes.
BsdfValue gltf_eval(Bsdf b, vec3 wo, vec3 wi) {
    BsdfValue value = base_at(b, wo, wi);
    bool up = wi.z > 0.0;
    if (HAS_SHEEN && b.sheen.kept < 1.0) {
        value.f *= min(b.sheen.kept, sheen_kept(b.sheen, abs(wi.z)));
        if (up) {
            value.f += sheen_value(b.sheen, wo, wi);
            value.pdf += b.probabilities.sheen / (2.0 * PI);
        }
    }
    value.f *= shadowing(b.ng, FRAME_NORMAL, wi);
    if (HAS_CLEARCOAT && b.clearcoat.weight > 0.0) {
        value.f *= clearcoat_transmits(b.clearcoat, wo, wi);
        if (up && !is_smooth(b.clearcoat.facets)) {
            BsdfValue clearcoat = clearcoat_at(b.clearcoat, wo, wi);
            value.f += clearcoat.f * shadowing(b.ng, clearcoat_normal(b.clearcoat, wo), wi);
            value.pdf += b.probabilities.clearcoat * clearcoat.pdf;
        }
    }
    return value;
}

vec3 gltf_diffuse(Bsdf b, vec3 wo, vec3 wi) {
    if (!(wi.z > 0.0)) return vec3(0.0);
    float value = diffuse_share_at(b, interface_fresnel(b, dot(wo, normalize(wo + wi))), wo, wi) * wi.z / PI;
    if (HAS_SHEEN && b.sheen.kept < 1.0) value *= min(b.sheen.kept, sheen_kept(b.sheen, wi.z));
    value *= shadowing(b.ng, FRAME_NORMAL, wi);
    if (HAS_CLEARCOAT && b.clearcoat.weight > 0.0) value *= clearcoat_transmits(b.clearcoat, wo, wi);
    return vec3(value);
}

// What layers over a delta lobe of the base leave of it.
float layers_transmit(Bsdf b, vec3 wo, vec3 wi) {
    float left = 1.0;
    if (HAS_SHEEN && b.sheen.kept < 1.0) left *= min(b.sheen.kept, sheen_kept(b.sheen, abs(wi.z)));
    if (HAS_CLEARCOAT && b.clearcoat.weight > 0.0) left *= clearcoat_transmits(b.clearcoat, wo, wi);
    return left;
}

// A microfacet, and reflection or transmission there; v: evenly in [0, 1).
BsdfSample interface_sample(Bsdf b, vec3 wo, vec2 u, float v, out bool found) {
    bool smooth_surface = is_smooth(b.facets);
    vec3 m = smooth_surface ? vec3(0.0, 0.0, 1.0) : sample_microfacet(b.facets, wo, u);
    float om = dot(wo, m);
    InterfaceFresnel f = interface_fresnel(b, om);
    float probability = reflected_probability(b, f);
    BsdfSample s = BsdfSample(2.0 * om * m - wo, vec3(0.0), 1.0, smooth_surface, 1.0);
    found = om > 0.0;
    if (v < probability) {
        found = found && s.wi.z > 0.0;
        float share = 1.0;
        if (HAS_RETROREFLECTION && b.retroreflected > 0.0) {
            bool returns = v < probability * b.retroreflected;
            share = returns ? b.retroreflected : 1.0 - b.retroreflected;
            if (returns) s.wi = mirror_image(s.wi);
        }
        if (smooth_surface) {
            s.pdf = b.probabilities.interface_ * probability * share;
            s.weight = f.reflected * (share * layers_transmit(b, wo, s.wi)) / s.pdf;
        }
        return s;
    }
    if (HAS_VOLUMES && b.volume) {
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
        s.pdf = b.probabilities.interface_ * (1.0 - probability);
        s.weight = b.transmitted * (f.transmitted * layers_transmit(b, wo, s.wi) / (s.pdf * s.eta * s.eta));
    }
    return s;
}

BsdfSample gltf_sample(Bsdf b, vec3 wo, vec2 u, float v) {
    if (v < b.probabilities.interface_) {
        bool found;
        BsdfSample s = interface_sample(b, wo, u, v / b.probabilities.interface_, found);
        if (found) return s;
        return NO_SAMPLE;
    }
    float below = b.probabilities.interface_ + b.probabilities.diffuse;
    if (v < below) return proposed(cosine_hemisphere(u), 1.0);
    if (HAS_DIFFUSE_TRANSMISSION) {
        below += b.probabilities.through;
        if (v < below) {
            vec3 wi = cosine_hemisphere(u);
            return proposed(vec3(wi.xy, -wi.z), 1.0);
        }
    }
    if (HAS_CLEARCOAT && v < below + b.probabilities.clearcoat) {
        vec3 m = clearcoat_microfacet(b.clearcoat, wo, u);
        vec3 wi = 2.0 * dot(wo, m) * m - wo;
        if (!(wi.z > 0.0)) return NO_SAMPLE;
        if (!is_smooth(b.clearcoat.facets)) return proposed(wi, 1.0);
        float weight = b.clearcoat.weight * clearcoat_fresnel(dot(wo, m)) / b.probabilities.clearcoat;
        return BsdfSample(wi, vec3(weight), b.probabilities.clearcoat, true, 1.0);
    }
    if (HAS_SHEEN && b.probabilities.sheen > 0.0) return proposed(uniform_hemisphere(u), 1.0);
    return NO_SAMPLE;
}

// What goes straight through a thin wall without roughness.
vec3 gltf_straight(Bsdf b, vec3 wo) {
    if (b.volume || !is_smooth(b.facets)) return vec3(0.0);
    return b.transmitted * (interface_fresnel(b, wo.z).transmitted * layers_transmit(b, wo, -wo));
}

// Turns and stretches microfacets along KHR_materials_anisotropy's direction. Returns it, in the plane of tangent and bitangent.
vec2 anisotropic(MaterialTextures textures, uint m, inout vec2 alpha) {
    vec3 t = textures.at[USE_ANISOTROPY].xyz;
    vec2 d = SHADING_OF(m).uses[USE_ANISOTROPY].texture != INVALID ? t.xy * 2.0 - 1.0 : vec2(1.0, 0.0);
    float strength = length(SHADING_OF(m).anisotropy) * t.z;
    alpha.x = mix(alpha.x, 1.0, strength * strength);
    if (alpha.x >= MIN_ALPHA) alpha = max(alpha, vec2(MIN_ALPHA));
    vec2 turn = strength > 0.0 ? normalize(SHADING_OF(m).anisotropy) : vec2(1.0, 0.0);
    return vec2(turn.x * d.x - turn.y * d.y, turn.y * d.x + turn.x * d.y);
}

// But for the frame; `point.along` is the direction of anisotropy.
void gltf_setup(inout Bsdf b, inout MaterialPoint point) {
    uint m = point.material;
    vec3 base = point.base;
    bool front = point.front;
    float cos_o = point.cos_o;
    vec4 mr = point.textures.at[USE_METALLIC_ROUGHNESS];
    float metallic = SHADING_OF(m).metallic * mr.b, roughness = SHADING_OF(m).roughness * mr.g;
    float specular = SHADING_OF(m).specular * point.textures.at[USE_SPECULAR].a;
    vec3 specular_color = SHADING_OF(m).specular_color * point.textures.at[USE_SPECULAR_COLOR].rgb;
    float r0 = (SHADING_OF(m).ior - 1.0) / (SHADING_OF(m).ior + 1.0);
    b.diffuse = base * (1.0 - metallic);
    vec3 f0 = min(r0 * r0 * specular_color, vec3(1.0)) * specular;
    b.facets = Microfacets(vec2(roughness * roughness), false);
    if (HAS_ANISOTROPY && SHADING_OF(m).anisotropy != vec2(0.0)) point.along = anisotropic(point.textures, m, b.facets.alpha);
    float transmission = 0.0;
    if (has_transmission() && SHADING_OF(m).walls != WALLS_NONE) {
        transmission = SHADING_OF(m).transmission * point.textures.at[USE_TRANSMISSION].r;
        b.transmitted = b.diffuse * transmission;
        b.diffuse *= 1.0 - transmission;
        b.volume = HAS_VOLUMES && SHADING_OF(m).walls == WALLS_VOLUME;
        if (b.volume) {
            b.eta = front ? SHADING_OF(m).ior : 1.0 / SHADING_OF(m).ior;
            b.tint = min(specular_color, vec3(1.0)) * specular;
        }
    }
    if (HAS_DIFFUSE_TRANSMISSION && SHADING_OF(m).diffuse_transmission > 0.0) {
        float share = SHADING_OF(m).diffuse_transmission * point.textures.at[USE_DIFFUSE_TRANSMISSION].a;
        vec3 color = SHADING_OF(m).diffuse_transmission_color * point.textures.at[USE_DIFFUSE_TRANSMISSION_COLOR].rgb;
        b.diffuse *= 1.0 - share;
        b.through_share = share;
        b.through = color * (share * (1.0 - metallic) * (1.0 - transmission));
    }
    if (HAS_IRIDESCENCE && SHADING_OF(m).iridescence > 0.0) {
        vec2 thickness = SHADING_OF(m).iridescence_thickness;
        b.film.weight = SHADING_OF(m).iridescence * point.textures.at[USE_IRIDESCENCE].r;
        b.film.thickness = mix(thickness.x, thickness.y, point.textures.at[USE_IRIDESCENCE_THICKNESS].g);
        b.film.ior = SHADING_OF(m).iridescence_ior;
    }
    if (HAS_RETROREFLECTION && SHADING_OF(m).retroreflection > 0.0) {
        b.retroreflected = SHADING_OF(m).retroreflection * point.textures.at[USE_RETROREFLECTION].r;
    }
    if (HAS_SHEEN && highest(SHADING_OF(m).sheen_color) > 0.0) {
        float r = SHADING_OF(m).sheen_roughness * point.textures.at[USE_SHEEN_ROUGHNESS].a;
        b.sheen = Sheen(SHADING_OF(m).sheen_color * point.textures.at[USE_SHEEN].rgb, max(r * r, MIN_SHEEN_ALPHA), 1.0);
        b.sheen.kept = sheen_kept(b.sheen, cos_o);
    }
    if (HAS_CLEARCOAT && SHADING_OF(m).clearcoat > 0.0) {
        float r = SHADING_OF(m).clearcoat_roughness * point.textures.at[USE_CLEARCOAT_ROUGHNESS].g;
        b.clearcoat.weight = SHADING_OF(m).clearcoat * point.textures.at[USE_CLEARCOAT].r;
        b.clearcoat.facets = Microfacets(vec2(r * r), false);
    }
    set_interface(b, f0, specular, base, metallic, cos_o, roughness, dielectric_layer(m, front));
    set_probabilities(b, cos_o);
}

bool gltf_has_smooth_part(Bsdf b) {
    return is_smooth(b.facets) || HAS_CLEARCOAT && b.clearcoat.weight > 0.0 && is_smooth(b.clearcoat.facets);
}

#endif
