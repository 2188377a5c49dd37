//! Ambient occlusion on the CPU in double precision: the ground truth for images.
//!
//! Ambient visibility is one minus the cosine-weighted occlusion,
//! `A(p) = 1 - 1/pi * integral over the hemisphere of f(d) cos dw`, with `d` the distance to the
//! nearest hit and `f(d) = c^-d` (1 for any hit within the radius when `c` is 1), around the
//! geometric normal on the viewer's side, as in pbrt-v4's `AOIntegrator`. Points come from the same
//! [`Sampler`] as the shaders'.

use super::camera::camera_ray;
use super::{Oracle, OracleRay};
use crate::sampling::{AO_DIRECTION, CAMERA_FILM, Sampler, warp};
use crate::scene::Camera;
use glam::DVec3;
use rayon::prelude::*;

/// Parameters of ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AoSettings {
    /// Distance beyond which nothing occludes, scene units.
    pub radius: f64,
    /// `c` in `c^-d`, at least 1; `d` in scene units. 1 is binary occlusion.
    pub falloff: f64,
    /// Consecutive samples of a pixel that share a camera ray, at least 1.
    pub rays: u32,
}

impl Default for AoSettings {
    fn default() -> Self {
        Self { radius: f64::INFINITY, falloff: 1.0, rays: 1 }
    }
}

impl AoSettings {
    /// Occlusion by a hit at this distance (infinite for a miss).
    pub fn occlusion(&self, distance: f64) -> f64 {
        if distance >= self.radius || distance == f64::INFINITY { 0.0 } else { self.falloff.powf(-distance) }
    }
}

/// Occlusion along one ray from `point` into the unit direction `direction`. It starts 1e-11 of the
/// greatest coordinate above the surface: well above rounding in double precision, far below
/// anything that shows.
pub fn ray_occlusion(oracle: &Oracle, point: DVec3, normal: DVec3, direction: DVec3, settings: &AoSettings) -> f64 {
    let reach = oracle.bounds().map_or(0.0, |(lo, hi)| (hi - lo).max_element().max(point.abs().max_element()));
    let ray = OracleRay { origin: point + normal * (1e-11 * reach), direction, tmin: 0.0, tmax: settings.radius };
    if settings.falloff == 1.0 { oracle.any(ray) as u8 as f64 } else { settings.occlusion(oracle.closest(ray).t) }
}

/// A mean with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Mean of the samples.
    pub mean: f64,
    /// Standard error of the mean, as if samples were independent: an upper bound for stratified
    /// ones.
    pub standard_error: f64,
}

/// Ambient visibility of `point` (relative to the oracle's origin) around the unit vector `normal`,
/// from `samples` rays. `pixel` chooses the point set.
pub fn ambient_visibility(
    oracle: &Oracle,
    point: DVec3,
    normal: DVec3,
    settings: &AoSettings,
    samples: u32,
    sampler: Sampler,
    pixel: [u32; 2],
) -> Estimate {
    let (sum, squares) = (0..samples)
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let direction = ao_direction(sampler, pixel, i, normal);
            let a = 1.0 - ray_occlusion(oracle, point, normal, direction, settings);
            (a, a * a)
        })
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let n = samples.max(1) as f64;
    let mean = sum / n;
    Estimate { mean, standard_error: ((squares / n - mean * mean).max(0.0) / n).sqrt() }
}

/// Direction of ambient occlusion sample `index` of a pixel.
pub fn ao_direction(sampler: Sampler, pixel: [u32; 2], index: u32, normal: DVec3) -> DVec3 {
    let u = sampler.get_2d_unit(pixel, index, AO_DIRECTION);
    let d = warp::to_world(normal.as_vec3().to_array(), warp::cosine_hemisphere(u));
    DVec3::from_array(d.map(f64::from)).normalize()
}

/// An ambient occlusion image.
#[derive(Clone, Debug, PartialEq)]
pub struct AoImage {
    /// Width and height.
    pub size: [u32; 2],
    /// Mean ambient visibility of the samples that hit a surface; 0 where none did. Rows from the
    /// top.
    pub ambient_visibility: Vec<f32>,
    /// Share of the samples that hit a surface, in [0, 1].
    pub coverage: Vec<f32>,
    /// Variance of a single covered sample (not of the mean).
    pub variance: Vec<f32>,
}

/// Renders `spp` samples a pixel: each an occlusion ray from the hit of a jittered camera ray.
pub fn render(oracle: &Oracle, camera: &Camera, size: [u32; 2], spp: u32, seed: u32, settings: &AoSettings) -> AoImage {
    let sampler = Sampler { seed };
    let pixels: Vec<[f32; 3]> = (0..size[0] as usize * size[1] as usize)
        .into_par_iter()
        .map(|i| {
            let pixel = [i as u32 % size[0], i as u32 / size[0]];
            let (mut n, mut sum, mut squares) = (0.0f64, 0.0, 0.0);
            for s in 0..spp {
                let u = sampler.get_2d_unit(pixel, s / settings.rays, CAMERA_FILM);
                let film = [pixel[0] as f64 + u[0] as f64, pixel[1] as f64 + u[1] as f64];
                let ray = camera_ray(camera, oracle.origin(), size, film);
                let hit = oracle.closest(ray);
                if !hit.is_hit() {
                    continue;
                }
                let normal = oracle.facing_normal(&ray, &hit);
                let direction = ao_direction(sampler, pixel, s, normal);
                let a = 1.0 - ray_occlusion(oracle, ray.at(hit.t), normal, direction, settings);
                (n, sum, squares) = (n + 1.0, sum + a, squares + a * a);
            }
            let mean = sum / n.max(1.0);
            let variance = if n > 1.0 { (squares - n * mean * mean).max(0.0) / (n - 1.0) } else { 0.0 };
            [mean as f32, (n / spp.max(1) as f64) as f32, variance as f32]
        })
        .collect();
    AoImage {
        size,
        ambient_visibility: pixels.iter().map(|p| p[0]).collect(),
        coverage: pixels.iter().map(|p| p[1]).collect(),
        variance: pixels.iter().map(|p| p[2]).collect(),
    }
}
