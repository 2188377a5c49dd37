//! Directional albedos of microfacet and sheen BSDFs by cosine and roughness: the tables of
//! shaders/bsdf/albedo.glsl, integrated when a scene is uploaded whose materials require them.
//!
//! The integrals are over the visible normals of GGX (Heitz, "Sampling the GGX Distribution of
//! Visible Normals", JCGT 2018), by stratified points: what is left to sum is a Smith term and
//! Fresnel's, both smooth. Beckmann's and Charlie's are by the midpoint rule.
//!
//! Microfacets of any roughness hide and shadow alike once the surface is stretched until its
//! roughness is 1: their albedo has its least, 0.89, where the cosine is alpha, and the stretched
//! cosine as an axis holds it in place. What follows the cosine itself, as Fresnel's term does, is
//! divided by that and has a table of its own. Both axes are square roots, for the sake of grazing
//! angles.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::{LazyLock, Mutex, PoisonError};

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

/// A table, or several of one integral.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Table {
    Ggx,
    Schlick,
    Sheen,
    Beckmann,
    /// Tables of both sides of a dielectric, by the bits of its index of refraction.
    Glass(u32),
}

impl Table {
    /// Computes the layers of the table.
    fn compute(self) -> Vec<f32> {
        match self {
            Self::Ggx => layers(|x, r| [ggx(unstretched(x, r), r)[0]]),
            Self::Schlick => layers(|x, r| {
                let [whole, weighted] = ggx(cosine(x), r);
                [weighted / whole]
            }),
            Self::Sheen => layers(|x, r| [charlie(cosine(x), r)]),
            Self::Beckmann => layers(|x, r| [beckmann(unstretched(x, r), r)]),
            Self::Glass(bits) => {
                let ior = f64::from(f32::from_bits(bits));
                let side = |eta| {
                    layers(|x, r| {
                        let [total, reflected, open, closed] = dielectric(cosine(x), r, eta);
                        let whole = ggx(cosine(x), r)[0];
                        [total / whole, reflected / whole, open, closed]
                    })
                };
                [side(ior), side(1.0 / ior)].concat()
            }
        }
    }

    /// Returns the layers of the table, from memory if this process has computed them before.
    fn layers(self) -> Vec<f32> {
        static KNOWN: LazyLock<Mutex<HashMap<Table, Vec<f32>>>> = LazyLock::new(Mutex::default);
        let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(layers) = known().get(&self) {
            return layers.clone();
        }
        // not under the lock: it is computed on several threads, which may come here too
        let layers = self.compute();
        known().insert(self, layers.clone());
        layers
    }
}

/// Layers of `SIZE` squared in the order of shaders/bsdf/albedo.glsl, rows by roughness; `glass`:
/// indices of refraction.
pub(super) fn tables(wanted: AlbedoTables, glass: &[f32]) -> Vec<f32> {
    let ggx_wanted = wanted.ggx || !glass.is_empty();
    let tables = [
        (ggx_wanted, Table::Ggx),
        (ggx_wanted, Table::Schlick),
        (wanted.sheen, Table::Sheen),
        (wanted.beckmann, Table::Beckmann),
    ];
    // zeros for a table that is not required
    let layers = |(wanted, table): (bool, Table)| if wanted { table.layers() } else { vec![0.0; SIZE * SIZE] };
    let mut all: Vec<f32> = tables.into_iter().flat_map(layers).collect();
    all.extend(glass.iter().flat_map(|ior| Table::Glass(ior.to_bits()).layers()));
    all
}

/// Layers of a function of cosine and roughness.
fn layers<const N: usize>(f: impl Fn(f64, f64) -> [f64; N] + Sync) -> Vec<f32> {
    let entry = |k: usize| {
        let [x, y] = [k % SIZE, k / SIZE].map(|i| i as f64 / (SIZE - 1) as f64);
        f(x, y.max(MIN_ROUGHNESS))
    };
    let entries: Vec<[f64; N]> = (0..SIZE * SIZE).into_par_iter().map(entry).collect();
    (0..N).flat_map(|k| entries.iter().map(move |values| values[k] as f32)).collect()
}

/// The cosine at a coordinate in [0, 1] of the axis.
fn cosine(x: f64) -> f64 {
    (x * x).max(MIN_COSINE)
}

/// The cosine whose stretched cosine is at a coordinate of the axis: the inverse of `stretched()`
/// in shaders/bsdf/albedo.glsl.
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

/// A point of an integral over normals on one side of the plane of wo: the other side is its mirror
/// image.
struct Point {
    /// Cosine and sine of the azimuth.
    azimuth: [f64; 2],
    /// The second coordinate.
    v: f64,
    /// Weight.
    share: f64,
}

impl Point {
    /// Warps the second coordinate so that points are denser near 1, where normals are nearly those
    /// of the surface and most reflected directions are above it.
    fn spaced(x: f64, y: f64, points: usize) -> Self {
        let phi = PI * x;
        Self { azimuth: [phi.cos(), phi.sin()], v: 1.0 - y * y, share: 2.0 * y / points as f64 }
    }
}

/// Midpoints of a grid over the unit square.
static GRID: LazyLock<Vec<Point>> = LazyLock::new(|| {
    let at = |k: usize| (k as f64 + 0.5) / POINTS as f64;
    (0..POINTS * POINTS).map(|k| Point::spaced(at(k % POINTS), at(k / POINTS), POINTS * POINTS)).collect()
});

/// Points of a golden-ratio lattice, for integrands with an edge: no row of points lies along the
/// edge.
static LATTICE_POINTS: LazyLock<Vec<Point>> = LazyLock::new(|| {
    let at = |k: f64| Point::spaced(k / LATTICE as f64, (k * 0.618_033_988_749_894_9).fract(), LATTICE);
    (0..LATTICE).map(|k| at(k as f64 + 0.5)).collect()
});

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

/// GGX microfacets as seen from a direction wo.
struct Visible {
    alpha: f64,
    wo: [f64; 3],
    /// wo, stretched until the roughness is 1.
    stretched: [f64; 3],
    /// The inverse of Smith's masking term G1 of wo.
    inverse_g1: f64,
}

impl Visible {
    fn new(cos_o: f64, roughness: f64) -> Self {
        let (alpha, wo) = (roughness * roughness, direction(cos_o));
        let stretched = normalize([alpha * wo[0], alpha * wo[1], wo[2]]);
        Self { alpha, wo, stretched, inverse_g1: 1.0 + lambda(alpha, cos_o) }
    }

    /// Cosine of a visible normal to the surface, and to wo.
    fn normal(&self, point: &Point) -> (f64, f64) {
        let (alpha, v) = (self.alpha, self.stretched);
        let z = (1.0 - point.v) * (1.0 + v[2]) - v[2];
        let s = (1.0 - z * z).max(0.0).sqrt();
        let h = [s * point.azimuth[0] + v[0], s * point.azimuth[1] + v[1], z + v[2]];
        let m = normalize([alpha * h[0], alpha * h[1], h[2].max(1e-12)]);
        (m[2], dot(self.wo, m))
    }

    /// G2 over G1 for a direction on either side, weighted; 0 for one on the wrong side.
    fn shadowing(&self, cos_i: f64, point: &Point) -> f64 {
        if cos_i > 0.0 { point.share * self.inverse_g1 / (self.inverse_g1 + lambda(self.alpha, cos_i)) } else { 0.0 }
    }
}

/// Albedo of GGX microfacets with a Fresnel term of 1, and with Schlick's weight (1 - cos)^5 as the
/// Fresnel term.
fn ggx(cos_o: f64, roughness: f64) -> [f64; 2] {
    let visible = Visible::new(cos_o, roughness);
    let mut sum = [0.0; 2];
    for point in GRID.iter() {
        let (cos_m, om) = visible.normal(point);
        let g = visible.shadowing(2.0 * om * cos_m - cos_o, point);
        sum[0] += g;
        sum[1] += g * weight(om);
    }
    sum
}

/// Albedos of GGX microfacets with a dielectric's Fresnel term F, `DIELECTRIC_*` of
/// shaders/bsdf/albedo.glsl: total internal reflection; reflection below the critical angle;
/// transmission with F = 0; the part of it that F removes. `eta`: index of refraction on the far
/// side over that on the side of wo.
fn dielectric(cos_o: f64, roughness: f64, eta: f64) -> [f64; 4] {
    let visible = Visible::new(cos_o, roughness);
    let mut sum = [0.0; 4];
    for point in LATTICE_POINTS.iter() {
        let (cos_m, om) = visible.normal(point);
        let (f, cos_t) = fresnel(om, eta);
        let reflected = visible.shadowing(2.0 * om * cos_m - cos_o, point);
        if cos_t > 0.0 {
            let refracted = visible.shadowing(cos_o / eta - (om / eta - cos_t) * cos_m, point);
            sum[1] += f * reflected;
            sum[2] += refracted;
            sum[3] += f * refracted;
        } else {
            sum[0] += reflected;
        }
    }
    sum
}

/// Exact Fresnel term of a dielectric, and the cosine of the refracted direction: 0 for total
/// internal reflection.
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

/// Albedo of Beckmann microfacets with the fit of Smith's term that shaders/bsdf/microfacet.glsl
/// uses.
fn beckmann(cos_o: f64, roughness: f64) -> f64 {
    let (alpha, wo) = (roughness * roughness, direction(cos_o));
    let lambda = |c: f64| {
        let tan = (1.0 - c * c).max(0.0).sqrt() / c;
        let a = 1.0 / (alpha * tan).max(1e-15);
        if a < 1.6 { (1.0 + a * (-1.259 + 0.396 * a)) / (a * (3.535 + 2.181 * a)) } else { 0.0 }
    };
    GRID.iter()
        .map(|point| {
            let tan2 = -alpha * alpha * (1.0 - point.v).ln();
            let cos_m = 1.0 / (1.0 + tan2).sqrt();
            let s = (1.0 - cos_m * cos_m).max(0.0).sqrt();
            let m = [s * point.azimuth[0], s * point.azimuth[1], cos_m];
            let om = dot(wo, m);
            let cos_i = 2.0 * om * cos_m - wo[2];
            if om <= 0.0 || cos_i <= 0.0 {
                return 0.0;
            }
            point.share * om / (cos_o * cos_m * (1.0 + lambda(cos_o) + lambda(cos_i)))
        })
        .sum()
}

/// Albedo of the Charlie sheen (shaders/bsdf/sheen.glsl): above 1 for low roughness at grazing
/// angles, where the shader clamps it.
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

    /// Microfacets that are a mirror lose nothing; rough ones what the same integral over 400 x 400
    /// points says.
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

    /// The weighted part is less than the whole, and nothing reflects more than there is.
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

    /// Tables as the shader reads them, between their entries, against integrals of many points:
    /// what compensation is off by.
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
