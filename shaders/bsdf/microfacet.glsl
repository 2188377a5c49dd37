// Microfacet distributions and Fresnel terms. Directions are in the frame of the macrosurface, whose normal is z.
//
// GGX (Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007), anisotropic, with the
// height-correlated Smith term (Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 2014), and
// Beckmann's with the rational fit of its Smith term from the first paper.
#ifndef BSDF_MICROFACET
#define BSDF_MICROFACET
#include "common/warp.glsl"

// Below this the lobe is narrower than single precision can hold: it counts as a perfect mirror. A roughness of 1 / 255, the least of an 8-bit
// texture, has an alpha of 1.5e-5.
const float MIN_ALPHA = 1e-5;

// Directions nearer to the surface count as this near.
const float MIN_COSINE = 1e-4;

struct Microfacets {
    vec2 alpha;     // along x and y of the frame
    bool beckmann;  // or GGX
};

bool is_smooth(Microfacets d) {
    return max(d.alpha.x, d.alpha.y) < MIN_ALPHA;
}

float sqr(float x) { return x * x; }

// Area of microfacets with normal m, per area of the macrosurface and solid angle.
float distribution(Microfacets d, vec3 m) {
    if (!(m.z > 0.0)) return 0.0;
    vec2 slope = m.xy / d.alpha;
    float norm = PI * d.alpha.x * d.alpha.y;
    if (d.beckmann) {
        float z2 = m.z * m.z;
        return exp(-dot(slope, slope) / z2) / (norm * z2 * z2);
    }
    return 1.0 / (norm * sqr(dot(slope, slope) + m.z * m.z));
}

// Smith's Lambda: hidden by visible area of microfacets seen from w.
float lambda(Microfacets d, vec3 w) {
    vec2 stretched = d.alpha * w.xy;
    float tan2 = dot(stretched, stretched) / max(w.z * w.z, 1e-30);
    if (d.beckmann) {
        float a = inversesqrt(max(tan2, 1e-30));
        return a < 1.6 ? (1.0 + a * (-1.259 + 0.396 * a)) / (a * (3.535 + 2.181 * a)) : 0.0;
    }
    return 0.5 * (sqrt(1.0 + tan2) - 1.0);
}

float masking(Microfacets d, vec3 w) { return 1.0 / (1.0 + lambda(d, w)); }

// Of light and view on the same side.
float masking_shadowing(Microfacets d, vec3 wo, vec3 wi) { return 1.0 / (1.0 + lambda(d, wo) + lambda(d, wi)); }

// Microfacet normals as seen from wo (wo.z > 0). GGX: the spherical cap of Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical
// Caps", HPG 2023. Beckmann: all microfacets, whether they are seen or not.
vec3 sample_microfacet(Microfacets d, vec3 wo, vec2 u) {
    vec2 circle = on_circle(u.x);
    if (d.beckmann) {
        vec2 slope = d.alpha * circle * sqrt(-log(1.0 - u.y));
        return normalize(vec3(slope, 1.0));
    }
    vec3 v = normalize(vec3(d.alpha * wo.xy, wo.z));
    float z = (1.0 - u.y) * (1.0 + v.z) - v.z;
    vec3 h = vec3(circle * sqrt(clamp(1.0 - z * z, 0.0, 1.0)), z) + v;
    return normalize(vec3(d.alpha * h.xy, max(h.z, 1e-9)));
}

// Density of that with respect to the microfacet normal's solid angle.
float microfacet_pdf(Microfacets d, vec3 wo, vec3 m) {
    if (d.beckmann) return distribution(d, m) * m.z;
    return masking(d, wo) * max(dot(wo, m), 0.0) * distribution(d, m) / max(wo.z, 1e-30);
}

// Density of what microfacets with normal m reflect, with respect to the solid angle of the reflected direction.
float reflected_pdf(Microfacets d, vec3 wo, vec3 m) {
    return microfacet_pdf(d, wo, m) / (4.0 * max(dot(wo, m), 1e-30));
}

// The microfacet normal that takes wi to wo, on the side of wo; zero where there is none. eta: index beyond the surface over that on wo's side.
vec3 generalized_half(float eta, vec3 wo, vec3 wi) {
    vec3 m = wi.z > 0.0 ? wo + wi : wo + eta * wi;
    float m2 = dot(m, m);
    if (m2 == 0.0) return vec3(0.0);
    m *= inversesqrt(m2) * (m.z < 0.0 ? -1.0 : 1.0);
    // back-facing microfacets
    return dot(wo, m) > 0.0 && dot(wi, m) * wi.z > 0.0 ? m : vec3(0.0);
}

// Direction refracted by a microfacet: om its cosine with wo, cos_t the cosine on the other side.
vec3 refracted(float eta, vec3 wo, vec3 m, float om, float cos_t) {
    return (om / eta - cos_t) * m - wo / eta;
}

// Walter et al. 2007, equation 21 without D, G and Fresnel term, times |cos wi|, of radiance; im: cosine of microfacet and wi.
float refracted_value(float eta, float cos_o, float om, float im) {
    return abs(im * om) / (cos_o * sqr(om + eta * im));
}

// Density of what microfacets with normal m refract, with respect to the solid angle of the refracted direction.
float refracted_pdf(Microfacets d, float eta, vec3 wo, vec3 m, float im) {
    return microfacet_pdf(d, wo, m) * eta * eta * abs(im) / sqr(dot(wo, m) + eta * im);
}

// Share of light that a dielectric reflects; eta: index of refraction on the side of -n over that on the side of n, cos_i > 0 on the side
// of n. cos_t: cosine on the other side, 0 at total reflection.
float fresnel_dielectric(float cos_i, float eta, out float cos_t) {
    float sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    cos_t = 0.0;
    if (sin2_t >= 1.0) return 1.0;
    cos_t = sqrt(1.0 - sin2_t);
    float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// The same of a conductor with index eta + i k, by channel (pbrt-v4, 9.3.6, written out in real numbers).
vec3 fresnel_conductor(float cos_i, vec3 eta, vec3 k) {
    float cos2 = cos_i * cos_i, sin2 = 1.0 - cos2;
    vec3 t0 = eta * eta - k * k - sin2;
    vec3 a2_b2 = sqrt(t0 * t0 + 4.0 * eta * eta * k * k);
    vec3 a = sqrt(max(0.5 * (a2_b2 + t0), vec3(0.0)));
    vec3 t1 = a2_b2 + cos2, t2 = 2.0 * cos_i * a;
    vec3 perpendicular = (t1 - t2) / (t1 + t2);
    vec3 t3 = cos2 * a2_b2 + sin2 * sin2, t4 = t2 * sin2;
    vec3 parallel = perpendicular * (t3 - t4) / (t3 + t4);
    return 0.5 * (parallel + perpendicular);
}

// How far Schlick's Fresnel term (1994) is on its way from f0 to f90.
float schlick_weight(float cos_i) {
    float x = 1.0 - clamp(cos_i, 0.0, 1.0);
    return x * x * x * x * x;
}

#endif
