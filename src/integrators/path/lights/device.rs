//! The lights of a scene in device memory.

use std::sync::Arc;

use super::super::params::{INVALID, PathParams};
use super::Lights;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device};
use crate::interface::{LightKinds, PathFeature, PathFeatures};

/// The lights of a scene in device memory. What is empty has no buffer.
pub(in super::super) struct DeviceLights {
    lights: Lights,
    records: Option<Buffer>,
    starts: Option<Buffer>,
    tree: Option<Buffer>,
    light_of: Option<Buffer>,
}

impl DeviceLights {
    /// Uploads them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Arc<Device>, lights: Lights) -> Result<Self> {
        Ok(Self {
            records: upload(device, "lights", &lights.records)?,
            starts: upload(device, "distributions of lights", &lights.starts)?,
            tree: upload(device, "light tree", &lights.tree)?,
            light_of: upload(device, "light indices", &lights.light_of)?,
            lights,
        })
    }

    /// `params` with these lights.
    pub fn params(&self, params: PathParams) -> PathParams {
        let address = |buffer: &Option<Buffer>| buffer.as_ref().map_or(0, Buffer::address);
        let Lights { directional, environment, placed, .. } = &self.lights;
        PathParams {
            placed_lights: *placed,
            distant_lights: self.lights.distant(),
            distant_irradiance: self.lights.distant_irradiance as f32,
            light_tree: address(&self.tree),
            lights: address(&self.records),
            light_of: address(&self.light_of),
            light_starts: address(&self.starts),
            first_disk: directional.start,
            disk_count: directional.end - directional.start,
            environment_light: environment.unwrap_or(INVALID),
            only_light: self.lights.records.first().copied().unwrap_or_default(),
            environment_probability: environment.map_or(0.0, |k| self.lights.records[k as usize].probability),
            ..params
        }
    }

    /// Number of lights, the environment and each portal included.
    pub fn count(&self) -> u32 {
        self.lights.count()
    }

    /// Returns true if these are the same lights at the same places.
    pub fn are(&self, lights: &Lights) -> bool {
        bytemuck::cast_slice::<_, u8>(&self.lights.records) == bytemuck::cast_slice::<_, u8>(&lights.records)
            && self.lights.light_of == lights.light_of
    }

    /// Checks that shaders compiled for these lights, with `features` and for `kinds`, find what
    /// they read of others.
    ///
    /// # Errors
    /// [`Error::Scene`] if they do not.
    pub fn check_fits(&self, lights: &Lights, features: PathFeatures, kinds: LightKinds) -> Result<()> {
        let has = |feature| features.contains(feature);
        // where lights are not sampled nothing is read but those that rays can hit
        let fits = !has(PathFeature::LightSamples)
            || !lights.records.is_empty()
                && (lights.placed <= 1 || has(PathFeature::LightTree))
                && (lights.distant() <= 1 || has(PathFeature::LightChoice))
                && (!lights.has_both_groups() || has(PathFeature::LightGroups))
                && lights.light_of.is_empty() != has(PathFeature::SurfaceLights)
                && lights.environment.is_some() == self.lights.environment.is_some()
                && lights.kinds().is_subset(kinds);
        if fits && (!lights.has_disks || has(PathFeature::DistantDisks)) {
            return Ok(());
        }
        Err(Error::Scene(
            "the animation switches lights on or off, which frames in real time cannot follow: render stills, one per frame, with --spp N in place of --preset".into(),
        ))
    }
}

fn upload<T: bytemuck::NoUninit>(device: &Arc<Device>, name: &'static str, values: &[T]) -> Result<Option<Buffer>> {
    if values.is_empty() { Ok(None) } else { Buffer::from_slice(device, name, values).map(Some) }
}
