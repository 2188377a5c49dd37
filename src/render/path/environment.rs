//! Environments in device memory: texels, and the table that directions are drawn with (shaders/path/map.glsl).

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::lights::luminance;
use super::params::MapRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Device};
use crate::sampling::Patches;
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
        let (width, height) = (map.width as usize, map.height as usize);
        let luminances: Vec<f64> = map.radiance.iter().map(|c| luminance(*c)).collect();
        let patches = Patches::new(width, height, &luminances);
        let texels: Vec<[f32; 4]> = map.radiance.iter().zip(&luminances).map(|(c, &l)| c.extend(l as f32).to_array()).collect();
        let texels = Buffer::from_slice(device, "environment", &texels)?;
        let table = Buffer::from_slice(device, "environment's patches", &patches.table)?;
        let m = map.to_map;
        let row = |k: usize| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, 0.0];
        let record = MapRecord {
            texels: texels.address(),
            table: table.address(),
            width: map.width,
            height: map.height,
            reserved: [0; 2],
            to_map: [row(0), row(1), row(2)],
        };
        Ok(Self { map: record, factor: map.factor, mean: mean(map) * map.factor, _buffers: vec![texels, table] })
    }
}

/// Radiance averaged over the sphere.
fn mean(map: &EnvironmentMap) -> Vec3 {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for (k, radiance) in map.radiance.iter().enumerate() {
        let y = k / map.width as usize;
        let sin = ((y as f64 + 0.5) / f64::from(map.height) * std::f64::consts::PI).sin();
        sum += radiance.as_dvec3() * sin;
        total += sin;
    }
    (sum / total.max(1e-300)).as_vec3()
}
