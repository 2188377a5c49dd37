//! Albedos of microfacets and fibres by cosine and roughness: the tables of shaders/bsdf/albedo.glsl, integrated when a scene is loaded whose
//! materials ask for them.
//!
//! The integrals are over the visible normals of GGX (Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 2018), by stratified
//! points: what is left to sum is a Smith term and Fresnel's, both smooth. Beckmann's and Charlie's are by the midpoint rule.

use std::f64::consts::PI;

/// Entries along cosine and along roughness, both from 0 to 1: `ALBEDO_SIZE` of shaders/bsdf/albedo.glsl.
const SIZE: usize = 32;
/// Points along each axis of an integral.
const POINTS: usize = 24;
/// Smallest cosine and roughness: at 0 the integrals are limits.
const LEAST: f64 = 1e-3;

/// Which tables are asked for; the others stay 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wanted {
    /// Of GGX.
    pub ggx: bool,
    /// Of Charlie's fibres.
    pub sheen: bool,
    /// Of Beckmann's microfacets.
    pub beckmann: bool,
}

/// Layers of `SIZE` squared in the order of shaders/bsdf/albedo.glsl, rows by roughness; `glass`: indices of refraction.
pub(super) fn tables(wanted: Wanted, glass: &[f32]) -> Vec<f32> {
    let layer = |wanted: bool, f: &(dyn Fn(f64, f64) -> f64 + Sync)| -> Vec<f32> {
        if !wanted {
            return vec![0.0; SIZE * SIZE];
        }
        let at = |k: usize| (k as f64 / (SIZE - 1) as f64).max(LEAST);
        (0..SIZE * SIZE).map(|k| f(at(k % SIZE), at(k / SIZE)) as f32).collect()
    };
    let mut all = layer(wanted.ggx, &|c, r| ggx(c, r, |om| 1.0 - weight(om)));
    all.extend(layer(wanted.ggx, &|c, r| ggx(c, r, weight)));
    all.extend(layer(wanted.sheen, &charlie));
    all.extend(layer(wanted.beckmann, &beckmann));
    for &ior in glass {
        let ior = f64::from(ior);
        all.extend(layer(true, &|c, r| rough_glass(c, r, ior)));
        all.extend(layer(true, &|c, r| rough_glass(c, r, 1.0 / ior)));
    }
    all
}

/// Schlick's weight of f90.
fn weight(cosine: f64) -> f64 {
    (1.0 - cosine).powi(5)
}

/// Smith's Lambda of isotropic GGX.
fn lambda(alpha: f64, cosine: f64) -> f64 {
    let tan2 = (1.0 - cosine * cosine) / (cosine * cosine);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// Midpoints of a grid over the unit square.
fn grid() -> impl Iterator<Item = (f64, f64)> {
    (0..POINTS * POINTS)
        .map(|k| ((k % POINTS) as f64 + 0.5, (k / POINTS) as f64 + 0.5))
        .map(|(x, y)| (x / POINTS as f64, y / POINTS as f64))
}

fn direction(cosine: f64) -> [f64; 3] {
    [(1.0 - cosine * cosine).sqrt(), 0.0, cosine]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normalize(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

/// A normal of GGX that is visible from wo.
fn visible_normal(alpha: f64, wo: [f64; 3], u: (f64, f64)) -> [f64; 3] {
    let v = normalize([alpha * wo[0], alpha * wo[1], wo[2]]);
    let phi = 2.0 * PI * u.0;
    let z = (1.0 - u.1) * (1.0 + v[2]) - v[2];
    let s = (1.0 - z * z).max(0.0).sqrt();
    let h = [s * phi.cos() + v[0], s * phi.sin() + v[1], z + v[2]];
    normalize([alpha * h[0], alpha * h[1], h[2].max(1e-12)])
}

/// Of GGX that reflects `fresnel` of the cosine between microfacet and view.
fn ggx(cos_o: f64, roughness: f64, fresnel: impl Fn(f64) -> f64) -> f64 {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let sum: f64 = grid()
        .map(|u| {
            let m = visible_normal(alpha, wo, u);
            let om = dot(wo, m);
            let cos_i = 2.0 * om * m[2] - wo[2];
            // G2 over G1
            if cos_i > 0.0 {
                fresnel(om) * (1.0 + lambda(alpha, cos_o)) / (1.0 + lambda(alpha, cos_o) + lambda(alpha, cos_i))
            } else {
                0.0
            }
        })
        .sum();
    sum / (POINTS * POINTS) as f64
}

/// All that GGX microfacets of glass reflect and refract; eta: index beyond over index on wo's side.
fn rough_glass(cos_o: f64, roughness: f64, eta: f64) -> f64 {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let g = |cos_i: f64| (1.0 + lambda(alpha, cos_o)) / (1.0 + lambda(alpha, cos_o) + lambda(alpha, cos_i));
    let sum: f64 = grid()
        .map(|u| {
            let m = visible_normal(alpha, wo, u);
            let om = dot(wo, m);
            let (f, cos_t) = fresnel(om, eta);
            let reflected = 2.0 * om * m[2] - wo[2];
            let refracted = (om / eta - cos_t) * m[2] - wo[2] / eta;
            let up = if reflected > 0.0 { f * g(reflected) } else { 0.0 };
            let down = if cos_t > 0.0 && refracted < 0.0 { (1.0 - f) * g(-refracted) } else { 0.0 };
            up + down
        })
        .sum();
    sum / (POINTS * POINTS) as f64
}

/// Exact Fresnel term of a dielectric, and the cosine beyond; 0 where all is reflected.
fn fresnel(cos_i: f64, eta: f64) -> (f64, f64) {
    let sin2 = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2 >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Of Beckmann's microfacets with the fit of Smith's term that shaders/bsdf/microfacet.glsl uses.
fn beckmann(cos_o: f64, roughness: f64) -> f64 {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let lambda = |c: f64| {
        let tan = (1.0 - c * c).max(0.0).sqrt() / c;
        let a = 1.0 / (alpha * tan).max(1e-15);
        if a < 1.6 { (1.0 + a * (-1.259 + 0.396 * a)) / (a * (3.535 + 2.181 * a)) } else { 0.0 }
    };
    let sum: f64 = grid()
        .map(|u| {
            let (tan2, phi) = (-alpha * alpha * (1.0 - u.1).ln(), 2.0 * PI * u.0);
            let cos_m = 1.0 / (1.0 + tan2).sqrt();
            let s = (1.0 - cos_m * cos_m).max(0.0).sqrt();
            let m = [s * phi.cos(), s * phi.sin(), cos_m];
            let om = dot(wo, m);
            let cos_i = 2.0 * om * cos_m - wo[2];
            if om <= 0.0 || cos_i <= 0.0 {
                return 0.0;
            }
            om / (cos_o * cos_m * (1.0 + lambda(cos_o) + lambda(cos_i)))
        })
        .sum();
    sum / (POINTS * POINTS) as f64
}

/// Of Charlie's fibres (shaders/bsdf/sheen.glsl).
fn charlie(cos_o: f64, roughness: f64) -> f64 {
    let (alpha, wo) = ((roughness * roughness).max(1e-3), direction(cos_o));
    let mix = |a: f64, b: f64| a + (b - a) * (1.0 - alpha).powi(2);
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let curve = |x: f64| a / (1.0 + b * x.max(1e-9).powf(c)) + d * x + e;
    let lambda = |x: f64| if x < 0.5 { curve(x).exp() } else { (2.0 * curve(0.5) - curve(1.0 - x)).exp() };
    // fibres shine along the surface: most of the light is where half vectors are near to it, so cosines are spaced by their squares
    let n = 4 * POINTS;
    let mut sum = 0.0;
    for i in 0..n {
        let x = (i as f64 + 0.5) / n as f64;
        let (cos_i, width) = (x * x, 2.0 * x / n as f64);
        let s = (1.0 - cos_i * cos_i).sqrt();
        for j in 0..n {
            let phi = PI * (j as f64 + 0.5) / n as f64;
            let wi = [s * phi.cos(), s * phi.sin(), cos_i];
            let h = normalize([wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]]);
            let sin_h = (1.0 - h[2] * h[2]).max(0.0).sqrt();
            let distribution = (2.0 + 1.0 / alpha) * sin_h.powf(1.0 / alpha) / (2.0 * PI);
            let g = 1.0 / (1.0 + lambda(cos_o) + lambda(cos_i));
            sum += distribution * g / (4.0 * cos_o) * width * 2.0 * PI / n as f64;
        }
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Microfacets that are a mirror lose nothing, rough ones a known share: E(1, 1) of GGX by Turquin (2019), and the furnace's own numbers.
    #[test]
    fn mirrors_lose_nothing_and_rough_ones_what_is_known() {
        for c in [0.1, 0.5, 1.0] {
            assert!((ggx(c, 0.01, |_| 1.0) - 1.0).abs() < 1e-3, "{c}");
            assert!((rough_glass(c, 0.01, 1.5) - 1.0).abs() < 1e-3, "{c}");
            assert!((beckmann(c, 0.03) - 1.0).abs() < 2e-2, "{c}");
            assert!(ggx(c, 1.0, |_| 1.0) < 0.75, "{c}");
        }
    }

    /// Four times as many points change an entry by less than what the tables' own interpolation is off by.
    #[test]
    fn parts_add_up() {
        for (c, r) in [(0.2, 0.3), (0.6, 0.8), (1.0, 0.5)] {
            let whole = ggx(c, r, |_| 1.0);
            let parts = ggx(c, r, |om| 1.0 - weight(om)) + ggx(c, r, weight);
            assert!((whole - parts).abs() < 1e-12, "{c} {r}");
            assert!(whole <= 1.0 && charlie(c, r) <= 1.0 && rough_glass(c, r, 1.0 / 1.5) <= 1.0);
        }
    }
}
