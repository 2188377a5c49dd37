//! Directional albedos of microfacet and sheen BSDFs by cosine and roughness: the tables of shaders/bsdf/albedo.glsl, integrated when a
//! scene is uploaded whose materials require them.
//!
//! The integrals are over the visible normals of GGX (Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 2018), by stratified
//! points: what is left to sum is a Smith term and Fresnel's, both smooth. Beckmann's and Charlie's are by the midpoint rule.
//!
//! Microfacets of any roughness hide and shadow alike once the surface is stretched until its roughness is 1: their albedo has its least, 0.89,
//! where the cosine is alpha, and the stretched cosine as an axis holds it in place. What follows the cosine itself, as Fresnel's term does, is
//! divided by that and has a table of its own. Both axes are square roots, for the sake of grazing angles.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::interface::records::albedo::ALBEDO_SIZE;

/// Number of table entries along cosine and along roughness, both from 0 to 1.
const SIZE: usize = ALBEDO_SIZE as usize;
/// Number of points along each axis of an integral.
const POINTS: usize = 32;
/// Number of points of an integral with a critical angle.
const LATTICE: usize = 4096;
/// Smallest roughness: at 0 the integrals are limits.
const MIN_ROUGHNESS: f64 = 1e-3;
/// Smallest cosine, of a direction and stretched.
const MIN_COSINE: f64 = 1e-7;

/// The required tables; the others stay 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AlbedoTables {
    /// Albedo of GGX microfacets.
    pub ggx: bool,
    /// Albedo of the Charlie sheen.
    pub sheen: bool,
    /// Albedo of Beckmann microfacets.
    pub beckmann: bool,
}

/// Layers of `SIZE` squared in the order of shaders/bsdf/albedo.glsl, rows by roughness; `glass`: indices of refraction.
pub(super) fn tables(wanted: AlbedoTables, glass: &[f32]) -> Vec<f32> {
    let ggx_wanted = wanted.ggx || !glass.is_empty();
    let mut all = table(ggx_wanted, |x, r| [ggx(unstretched(x, r), r)[0]]);
    all.extend(table(ggx_wanted, |x, r| {
        let [whole, weighted] = ggx(cosine(x), r);
        [weighted / whole]
    }));
    all.extend(table(wanted.sheen, |x, r| [charlie(cosine(x), r)]));
    all.extend(table(wanted.beckmann, |x, r| [beckmann(unstretched(x, r), r)]));
    for &ior in glass {
        for eta in [f64::from(ior), 1.0 / f64::from(ior)] {
            all.extend(table(true, |x, r| {
                let [total, reflected, open, closed] = dielectric(cosine(x), r, eta);
                let whole = ggx(cosine(x), r)[0];
                [total / whole, reflected / whole, open, closed]
            }));
        }
    }
    all
}

/// Layers of a function of cosine and roughness; zeros for a table that is not required.
fn table<const N: usize>(wanted: bool, f: impl Fn(f64, f64) -> [f64; N] + Sync) -> Vec<f32> {
    let entry = |k: usize| {
        let [x, y] = [k % SIZE, k / SIZE].map(|i| i as f64 / (SIZE - 1) as f64);
        f(x, y.max(MIN_ROUGHNESS))
    };
    let entries: Vec<[f64; N]> = if wanted { (0..SIZE * SIZE).into_par_iter().map(entry).collect() } else { Vec::new() };
    let layer = |k: usize| entries.iter().map(move |values| values[k] as f32);
    if wanted { (0..N).flat_map(layer).collect() } else { vec![0.0; N * SIZE * SIZE] }
}

/// The cosine at a coordinate in [0, 1] of the axis.
fn cosine(x: f64) -> f64 {
    (x * x).max(MIN_COSINE)
}

/// The cosine whose stretched cosine is at a coordinate of the axis: the inverse of `stretched()` in shaders/bsdf/albedo.glsl.
fn unstretched(x: f64, roughness: f64) -> f64 {
    let v2 = cosine(x).powi(2);
    let scaled = v2 * roughness.powi(4);
    (scaled / (1.0 - v2 + scaled)).sqrt().min(1.0)
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

/// Midpoints of a grid over the unit square, and the weight of each.
fn grid() -> impl Iterator<Item = ((f64, f64), f64)> {
    (0..POINTS * POINTS)
        .map(|k| ((k % POINTS) as f64 + 0.5, (k / POINTS) as f64 + 0.5))
        .map(|(x, y)| spaced(x / POINTS as f64, y / POINTS as f64, POINTS * POINTS))
}

/// Points of a golden-ratio lattice and their weights, for integrands with an edge: no row of points lies along the edge.
fn lattice() -> impl Iterator<Item = ((f64, f64), f64)> {
    (0..LATTICE).map(|k| k as f64 + 0.5).map(|k| spaced(k / LATTICE as f64, (k * 0.618_033_988_749_894_9).fract(), LATTICE))
}

/// Warps the second coordinate so that points are denser near 1, where normals are nearly those of the surface and most reflected
/// directions are above it.
fn spaced(x: f64, y: f64, points: usize) -> ((f64, f64), f64) {
    ((x, 1.0 - y * y), 2.0 * y / points as f64)
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

/// A normal of GGX that is visible from wo, on one side of the plane of wo: the other side is its mirror image.
fn visible_normal(alpha: f64, wo: [f64; 3], u: (f64, f64)) -> [f64; 3] {
    let v = normalize([alpha * wo[0], alpha * wo[1], wo[2]]);
    let phi = PI * u.0;
    let z = (1.0 - u.1) * (1.0 + v[2]) - v[2];
    let s = (1.0 - z * z).max(0.0).sqrt();
    let h = [s * phi.cos() + v[0], s * phi.sin() + v[1], z + v[2]];
    normalize([alpha * h[0], alpha * h[1], h[2].max(1e-12)])
}

/// Albedo of GGX microfacets with a Fresnel term of 1, and with Schlick's weight (1 - cos)^5 as the Fresnel term.
fn ggx(cos_o: f64, roughness: f64) -> [f64; 2] {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let hidden = 1.0 + lambda(alpha, cos_o);
    let mut sum = [0.0; 2];
    for (u, share) in grid() {
        let m = visible_normal(alpha, wo, u);
        let om = dot(wo, m);
        let cos_i = 2.0 * om * m[2] - wo[2];
        if cos_i > 0.0 {
            // G2 over G1
            let g = share * hidden / (hidden + lambda(alpha, cos_i));
            sum[0] += g;
            sum[1] += g * weight(om);
        }
    }
    sum
}

/// Albedos of GGX microfacets with a dielectric's Fresnel term F, `DIELECTRIC_*` of shaders/bsdf/albedo.glsl: total internal reflection;
/// reflection below the critical angle; transmission with F = 0; the part of it that F removes. `eta`: index of refraction on the far
/// side over that on the side of wo.
fn dielectric(cos_o: f64, roughness: f64, eta: f64) -> [f64; 4] {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let hidden = 1.0 + lambda(alpha, cos_o);
    let mut sum = [0.0; 4];
    for (u, share) in lattice() {
        let m = visible_normal(alpha, wo, u);
        let om = dot(wo, m);
        let (f, cos_t) = fresnel(om, eta);
        let g = |cos_i: f64| if cos_i > 0.0 { share * hidden / (hidden + lambda(alpha, cos_i)) } else { 0.0 };
        let reflected = g(2.0 * om * m[2] - wo[2]);
        if cos_t > 0.0 {
            let refracted = g(wo[2] / eta - (om / eta - cos_t) * m[2]);
            sum[1] += f * reflected;
            sum[2] += refracted;
            sum[3] += f * refracted;
        } else {
            sum[0] += reflected;
        }
    }
    sum
}

/// Exact Fresnel term of a dielectric, and the cosine of the refracted direction: 0 for total internal reflection.
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

/// Albedo of Beckmann microfacets with the fit of Smith's term that shaders/bsdf/microfacet.glsl uses.
fn beckmann(cos_o: f64, roughness: f64) -> f64 {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let lambda = |c: f64| {
        let tan = (1.0 - c * c).max(0.0).sqrt() / c;
        let a = 1.0 / (alpha * tan).max(1e-15);
        if a < 1.6 { (1.0 + a * (-1.259 + 0.396 * a)) / (a * (3.535 + 2.181 * a)) } else { 0.0 }
    };
    grid()
        .map(|(u, share)| {
            let (tan2, phi) = (-alpha * alpha * (1.0 - u.1).ln(), PI * u.0);
            let cos_m = 1.0 / (1.0 + tan2).sqrt();
            let s = (1.0 - cos_m * cos_m).max(0.0).sqrt();
            let m = [s * phi.cos(), s * phi.sin(), cos_m];
            let om = dot(wo, m);
            let cos_i = 2.0 * om * cos_m - wo[2];
            if om <= 0.0 || cos_i <= 0.0 {
                return 0.0;
            }
            share * om / (cos_o * cos_m * (1.0 + lambda(cos_o) + lambda(cos_i)))
        })
        .sum()
}

/// Albedo of the Charlie sheen (shaders/bsdf/sheen.glsl): above 1 for low roughness at grazing angles, where the shader clamps it.
fn charlie(cos_o: f64, roughness: f64) -> f64 {
    let (alpha, wo) = ((roughness * roughness).max(1e-3), direction(cos_o));
    let mix = |a: f64, b: f64| a + (b - a) * (1.0 - alpha).powi(2);
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let curve = |x: f64| a / (1.0 + b * x.max(1e-9).powf(c)) + d * x + e;
    let lambda = |x: f64| if x < 0.5 { curve(x).exp() } else { (2.0 * curve(0.5) - curve(1.0 - x)).exp() };
    // fibres reflect most at grazing angles, so the points are denser at small cosines
    let n = POINTS;
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
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Microfacets that are a mirror lose nothing; rough ones what the same integral over 400 x 400 points says.
    #[test]
    fn mirrors_lose_nothing_and_rough_ones_what_is_known() {
        let glass = |c, r, eta| {
            let [total, reflected, open, closed] = dielectric(c, r, eta);
            total + reflected + open - closed
        };
        for (c, rough) in [(0.01, 0.9539), (0.1, 0.7602), (0.5, 0.4507), (1.0, 0.3069)] {
            assert!((ggx(c, 0.001,)[0] - 1.0).abs() < 1e-3, "{c}");
            assert!((glass(c, 0.001, 1.5) - 1.0).abs() < 1e-3, "{c}");
            assert!((beckmann(c, 0.03) - 1.0).abs() < 2e-2, "{c}");
            assert!((ggx(c, 1.0)[0] - rough).abs() < 1e-3, "{c}");
        }
        // the least of any roughness, where the cosine is alpha
        for r in [0.01, 0.03, 0.1] {
            assert!((ggx(r * r, r)[0] - 0.892).abs() < 1e-3, "{r}");
        }
    }

    /// What is weighted is less than the whole, and nothing reflects more than there is.
    #[test]
    fn parts_are_no_more_than_the_whole() {
        for (c, r) in [(0.2, 0.3), (0.6, 0.8), (1.0, 0.5)] {
            let [whole, weighted] = ggx(c, r);
            assert!(weighted >= 0.0 && weighted <= whole && whole <= 1.0, "{c} {r}");
            for eta in [1.5, 1.0 / 1.5] {
                let [total, reflected, open, closed] = dielectric(c, r, eta);
                assert!(total + reflected + open - closed <= 1.0 && closed <= open, "{c} {r} {eta}");
                assert!(total == 0.0 || eta < 1.0, "{c} {r} {eta}");
            }
        }
    }

    /// Axes and back.
    #[test]
    fn places_are_those_of_the_shader() {
        let stretched = |c: f64, r: f64| (c / (c * c + r.powi(4) * (1.0 - c * c)).sqrt()).sqrt();
        for r in [0.01, 0.1, 0.5, 1.0] {
            for x in [0.1, 0.4, 0.9, 1.0] {
                assert!((stretched(unstretched(x, r), r) - x).abs() < 1e-9, "{x} {r}");
            }
        }
    }

    /// Tables as the shader reads them, between their entries, against integrals of many points: what compensation is off by.
    #[test]
    fn tables_hold_between_their_entries() {
        let tables = tables(AlbedoTables { ggx: true, sheen: true, beckmann: true }, &[]);
        let at = |layer: usize, x: f64, y: f64| {
            let (x, y) = (x * (SIZE - 1) as f64, y * (SIZE - 1) as f64);
            let (i, j) = ((x as usize).min(SIZE - 2), (y as usize).min(SIZE - 2));
            let (f, g) = (x - i as f64, y - j as f64);
            let entry = |i: usize, j: usize| f64::from(tables[(layer * SIZE + j) * SIZE + i]);
            let row = |j: usize| entry(i, j) * (1.0 - f) + entry(i + 1, j) * f;
            row(j) * (1.0 - g) + row(j + 1) * g
        };
        let mut worst = [0.0f64; 4];
        for r in [0.05, 0.1, 0.23, 0.41, 0.5, 0.77, 0.99f64] {
            for c in [0.003, 0.01, 0.03, 0.08, 0.2, 0.5, 0.8, 1.0f64] {
                let stretched = (c / (c * c + r.powi(4) * (1.0 - c * c)).sqrt()).sqrt();
                let [whole, weighted] = ggx(c, r);
                let errors = [
                    at(0, stretched, r) / whole - 1.0,
                    at(1, c.sqrt(), r) - weighted / whole,
                    if r >= 0.1 { at(2, c.sqrt(), r).min(1.0) - charlie(c, r).min(1.0) } else { 0.0 },
                    at(3, stretched, r) / beckmann(c, r) - 1.0,
                ];
                for (w, e) in worst.iter_mut().zip(errors) {
                    *w = w.max(e.abs());
                }
            }
        }
        println!("GGX {:.4}, Schlick {:.4}, sheen {:.4}, Beckmann {:.4}", worst[0], worst[1], worst[2], worst[3]);
        assert!(worst.iter().zip([3e-3, 3e-3, 5e-3, 1e-2]).all(|(w, limit)| *w < limit), "{worst:?}");
    }
}
