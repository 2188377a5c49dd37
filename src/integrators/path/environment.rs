//! Environments in device memory: texels, and the table for importance sampling (shaders/path/map.glsl).

use std::sync::Arc;

use glam::{DMat3, Vec3};

use super::lights::brightness;
use super::params::EnvironmentRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Device};
use crate::sampling::BilinearDistribution;
use crate::scene::{Environment, EnvironmentMap};

/// An environment in device memory.
pub(super) struct DeviceEnvironment {
    pub map: EnvironmentRecord,
    /// Radiance of a constant environment; scale factor of an environment map.
    pub factor: Vec3,
    /// Radiance averaged over the sphere.
    pub mean: Vec3,
    _buffers: Vec<Buffer>,
}

impl DeviceEnvironment {
    /// Uploads the environment. `compensated`: build the sampling table with MIS compensation, which needs MIS with BSDF sampling.
    pub fn new(device: &Arc<Device>, environment: &Environment, compensated: bool) -> Result<Self> {
        let plain = |c: Vec3| Self { map: EnvironmentRecord::default(), factor: c, mean: c, _buffers: Vec::new() };
        let map = match environment {
            Environment::Black => return Ok(plain(Vec3::ZERO)),
            Environment::Uniform(c) => return Ok(plain(*c)),
            Environment::Map(map) => map,
        };
        let (width, height) = (map.width as usize, map.height as usize);
        let mut weights: Vec<f64> = map.radiance.iter().map(|c| brightness(*c)).collect();
        if compensated {
            let mean = mean(map, &weights);
            compensate(&mut weights, mean);
        }
        let distribution = BilinearDistribution::new(width, height, &weights);
        let texels: Vec<[f32; 4]> = map.radiance.iter().zip(&weights).map(|(c, &l)| c.extend(l as f32).to_array()).collect();
        let texels = Buffer::from_slice(device, "environment", &texels)?;
        let table = Buffer::from_slice(device, "environment distribution", &distribution.table)?;
        let record = EnvironmentRecord {
            texels: texels.address(),
            table: table.address(),
            width: map.width,
            height: map.height,
            to_map: rows(&map.to_map),
            ..Default::default()
        };
        Ok(Self { map: record, factor: map.factor, mean: mean_radiance(map) * map.factor, _buffers: vec![texels, table] })
    }
}

/// A rotation as shaders read it.
pub(super) fn rows(m: &DMat3) -> [[f32; 4]; 3] {
    [0, 1, 2].map(|k| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, 0.0])
}

/// Subtracts the mean over the sphere from the weights and clamps at 0: "MIS compensation" (Karlik, Sik, Vevoda, Skrivan, Krivanek, SIGGRAPH Asia 2019, section
/// 5). Directions below the mean are left to BSDF sampling, which knows the surface. A constant map keeps its weights.
fn compensate(weights: &mut [f64], mean: f64) {
    if weights.iter().any(|&w| w > mean * 1.0001) {
        weights.iter_mut().for_each(|w| *w = (*w - mean).max(0.0));
    }
}

/// Radiance averaged over the sphere.
fn mean_radiance(map: &EnvironmentMap) -> Vec3 {
    let channel = |k: usize| mean(map, &map.radiance.iter().map(|c| f64::from(c[k])).collect::<Vec<_>>()) as f32;
    Vec3::new(channel(0), channel(1), channel(2))
}

/// Mean of the texels' values over the sphere.
fn mean(map: &EnvironmentMap, values: &[f64]) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (y, row) in values.chunks_exact(map.width as usize).enumerate() {
        let sin = ((y as f64 + 0.5) / f64::from(map.height) * std::f64::consts::PI).sin();
        sum += row.iter().sum::<f64>() * sin;
        total += row.len() as f64 * sin;
    }
    sum / total.max(1e-300)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_above_the_mean_is_left_to_light_samples() {
        let mut weights = vec![1.0, 1.0, 1.0, 9.0];
        compensate(&mut weights, 3.0);
        assert_eq!(weights, [0.0, 0.0, 0.0, 6.0]);
        // a constant map is nowhere above its mean, whatever the rounding
        for even in [vec![2.0; 4], vec![2.0, 2.0, 2.0, 2.0 + 1e-6]] {
            let mut weights = even.clone();
            compensate(&mut weights, 2.0);
            assert_eq!(weights, even);
        }
        let mut black = vec![0.0; 4];
        compensate(&mut black, 0.0);
        assert_eq!(black, [0.0; 4]);
    }

    #[test]
    fn means_are_those_of_the_sphere() {
        // rows at the poles are small
        let radiance: Vec<Vec3> =
            (0..8).map(|k| if (2..6).contains(&k) { Vec3::ONE } else { Vec3::new(0.0, 2.0, 1.0) }).collect();
        let map = EnvironmentMap {
            name: String::new(),
            width: 2,
            height: 4,
            radiance: radiance.into(),
            factor: Vec3::ONE,
            to_map: glam::DMat3::IDENTITY,
        };
        let share = (0.375f64 * std::f64::consts::PI).sin()
            / ((0.125f64 * std::f64::consts::PI).sin() + (0.375f64 * std::f64::consts::PI).sin());
        let mean = mean_radiance(&map);
        assert!(
            (f64::from(mean.x) - share).abs() < 1e-6
                && (f64::from(mean.y) - (2.0 - share)).abs() < 1e-6
                && (mean.z - 1.0).abs() < 1e-6,
            "{mean}"
        );
    }
}
