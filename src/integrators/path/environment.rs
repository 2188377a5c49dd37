//! Environments in device memory: texels, and the table that is sampled (shaders/path/map.glsl).

use std::sync::Arc;

use glam::{DMat3, Vec3};
use rayon::prelude::*;

use super::blur;
use super::lights::brightness;
use super::params::EnvironmentRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
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
    /// Uploads the environment. `compensated`: use MIS compensation, which needs BSDF sampling.
    /// `blurs`: camera rays show it blurred.
    pub fn new(device: &Arc<Device>, environment: &Environment, compensated: bool, blurs: bool) -> Result<Self> {
        let plain = |c: Vec3| Self { map: EnvironmentRecord::default(), factor: c, mean: c, _buffers: Vec::new() };
        let map = match environment {
            Environment::Black => return Ok(plain(Vec3::ZERO)),
            Environment::Uniform(c) => return Ok(plain(*c)),
            Environment::Map(map) => map,
        };

        // how its directions are sampled
        let (width, height) = (map.width as usize, map.height as usize);
        let totals = Totals::from_map(map);
        let subtracted = if compensated { totals.compensation() } else { 0.0 };
        // computed again where needed: the weights of all texels would be a gigabyte of a large map
        let weight = |c: &Vec3| weight(brightness(*c), subtracted);
        let distribution = BilinearDistribution::new(width, height, |y, out| {
            out.iter_mut().zip(&map.radiance[y * width..][..width]).for_each(|(w, c)| *w = weight(c));
        });
        let table = Buffer::from_slice(device, "environment distribution", &distribution.table)?;
        let guide = Buffer::from_slice(device, "environment guide", &distribution.guide)?;
        drop(distribution);

        // what is seen in them
        let bytes = size_of::<[f32; 4]>() as u64;
        let mut texels = Buffer::new(device, "environment", bytes * map.radiance.len() as u64, Memory::Device)?;
        texels.fill(texels.size(), bytes, |first, out| {
            let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out);
            let radiance = &map.radiance[first as usize..][..out.len()];
            out.par_iter_mut().zip(radiance).for_each(|(texel, c)| *texel = c.extend(weight(c) as f32).to_array());
        })?;
        let blurred = blurs.then(|| upload_blurred(device, map)).transpose()?;

        // where both are
        let record = EnvironmentRecord {
            texels: texels.address(),
            table: table.address(),
            guide: guide.address(),
            reserved: [0; 2],
            blurred: blurred.as_ref().map_or(0, Buffer::address),
            width: map.width,
            height: map.height,
            to_map: rows(&map.to_map),
        };
        Ok(Self {
            map: record,
            factor: map.factor,
            mean: totals.mean_radiance * map.factor,
            _buffers: [texels, table, guide].into_iter().chain(blurred).collect(),
        })
    }
}

/// Uploads what camera rays show of a blurred map.
fn upload_blurred(device: &Arc<Device>, map: &EnvironmentMap) -> Result<Buffer> {
    Buffer::from_slice(device, "blurred environment", &blur::blurred(map))
}

/// A rotation as shaders read it.
pub(super) fn rows(m: &DMat3) -> [[f32; 4]; 3] {
    [0, 1, 2].map(|k| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, 0.0])
}

/// Weight of a texel for light samples: importance that they do not leave to BSDF samples.
fn weight(importance: f64, subtracted: f64) -> f64 {
    (importance - subtracted).max(0.0)
}

/// Sums over a whole map.
struct Totals {
    /// Radiance averaged over the sphere.
    mean_radiance: Vec3,
    /// Importance ([`brightness`]) averaged over the sphere, and the largest.
    mean: f64,
    most: f64,
}

impl Totals {
    fn from_map(map: &EnvironmentMap) -> Self {
        let rows: Vec<[f64; 5]> = (map.radiance.par_chunks_exact(map.width as usize))
            .map(|row| {
                row.iter().fold([0.0; 5], |[r, g, b, sum, most], c| {
                    let (importance, [x, y, z]) = (brightness(*c), c.as_dvec3().to_array());
                    [r + x, g + y, b + z, sum + importance, importance.max(most)]
                })
            })
            .collect();
        let (mut sums, mut total, mut most) = ([0.0; 4], 0.0, 0.0f64);
        for (y, row) in rows.iter().enumerate() {
            let sin = ((y as f64 + 0.5) / f64::from(map.height) * std::f64::consts::PI).sin();
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value * sin);
            total += f64::from(map.width) * sin;
            most = most.max(row[4]);
        }
        let [r, g, b, mean] = sums.map(|sum| sum / total.max(1e-300));
        Self { mean_radiance: Vec3::new(r as f32, g as f32, b as f32), mean, most }
    }

    /// Importance of each texel that light samples leave to BSDF samples, which know the surface:
    /// the mean, for "MIS compensation" (Karlik, Sik, Vevoda, Skrivan, Krivanek, SIGGRAPH Asia
    /// 2019, section 5). A constant map keeps its weights.
    fn compensation(&self) -> f64 {
        if self.most > self.mean * 1.0001 { self.mean } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, radiance: &[Vec3]) -> EnvironmentMap {
        EnvironmentMap::new("", [width, radiance.len() as u32 / width], radiance.into())
    }

    #[test]
    fn what_is_above_the_mean_is_left_to_light_samples() {
        let weights = |values: [f32; 4]| {
            let subtracted = Totals::from_map(&map(2, &values.map(Vec3::splat))).compensation();
            values.map(|v| weight(brightness(Vec3::splat(v)), subtracted) as f32)
        };
        assert_eq!(weights([1.0, 1.0, 1.0, 9.0]), [0.0, 0.0, 0.0, 6.0]);
        // a constant map is nowhere above its mean, whatever the rounding
        for even in [[2.0; 4], [2.0, 2.0, 2.0, 2.0 + 1e-6]] {
            assert_eq!(weights(even), even);
        }
        assert_eq!(weights([0.0; 4]), [0.0; 4]);
    }

    #[test]
    fn means_are_those_of_the_sphere() {
        // rows at the poles are small
        let radiance: Vec<Vec3> =
            (0..8).map(|k| if (2..6).contains(&k) { Vec3::ONE } else { Vec3::new(0.0, 2.0, 1.0) }).collect();
        let map = map(2, &radiance);
        let share = (0.375f64 * std::f64::consts::PI).sin()
            / ((0.125f64 * std::f64::consts::PI).sin() + (0.375f64 * std::f64::consts::PI).sin());
        let mean = Totals::from_map(&map).mean_radiance;
        assert!(
            (f64::from(mean.x) - share).abs() < 1e-6
                && (f64::from(mean.y) - (2.0 - share)).abs() < 1e-6
                && (mean.z - 1.0).abs() < 1e-6,
            "{mean}"
        );
    }
}
