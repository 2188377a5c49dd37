//! Environments in device memory: texels, how likely each is drawn, and the alias table that draws them (shaders/path/map.glsl).

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::lights::luminance;
use super::params::MapRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Device};
use crate::sampling::AliasTable;
use crate::scene::{Environment, EnvironmentMap};

/// What shaders get of an environment.
pub(super) struct DeviceEnvironment {
    pub map: MapRecord,
    /// Radiance, or factor of the map's.
    pub factor: Vec3,
    /// Radiance averaged over the sphere.
    pub mean: Vec3,
    _buffers: Vec<Buffer>,
}

impl DeviceEnvironment {
    /// Uploads what there is to upload.
    pub fn new(device: &Arc<Device>, environment: &Environment) -> Result<Self> {
        let plain = |c: Vec3| Self { map: MapRecord::default(), factor: c, mean: c, _buffers: Vec::new() };
        let map = match environment {
            Environment::Black => return Ok(plain(Vec3::ZERO)),
            Environment::Uniform(c) => return Ok(plain(*c)),
            Environment::Map(map) => map,
        };
        let (weights, mean) = weights(map);
        let table = AliasTable::new(&weights);
        let texels: Vec<[f32; 4]> =
            map.radiance.iter().zip(&table.probabilities).map(|(c, &p)| c.extend(p).to_array()).collect();
        let texels = Buffer::from_slice(device, "environment", &texels)?;
        let bins = Buffer::from_slice(device, "environment's alias table", &table.bins)?;
        let m = map.to_map;
        let row = |k: usize| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, 0.0];
        let record = MapRecord {
            texels: texels.address(),
            table: bins.address(),
            width: map.width,
            height: map.height,
            reserved: [0; 2],
            to_map: [row(0), row(1), row(2)],
        };
        Ok(Self { map: record, factor: map.factor, mean: mean * map.factor, _buffers: vec![texels, bins] })
    }
}

/// Weight of each texel: luminance of its bilinear patch, averaged, by its solid angle. And the mean over the sphere.
fn weights(map: &EnvironmentMap) -> (Vec<f64>, Vec3) {
    let (w, h) = (map.width as usize, map.height as usize);
    // the mean over a texel of what is interpolated between the middles of texels weighs it 3/4 and its neighbours 1/8, along each axis
    let at = |x: usize, y: usize| luminance(map.radiance[y * w + x]);
    let across: Vec<f64> = (0..w * h)
        .map(|k| (k % w, k / w))
        .map(|(x, y)| (at((x + w - 1) % w, y) + 6.0 * at(x, y) + at((x + 1) % w, y)) / 8.0)
        .collect();
    let (mut weights, mut sum, mut total) = (Vec::with_capacity(w * h), DVec3::ZERO, 0.0);
    for y in 0..h {
        let sin = ((y as f64 + 0.5) / h as f64 * std::f64::consts::PI).sin();
        for x in 0..w {
            let (above, below) = (across[y.saturating_sub(1) * w + x], across[(y + 1).min(h - 1) * w + x]);
            weights.push((above + 6.0 * across[y * w + x] + below) / 8.0 * sin);
            sum += map.radiance[y * w + x].as_dvec3() * sin;
            total += sin;
        }
    }
    (weights, (sum / total.max(1e-300)).as_vec3())
}
