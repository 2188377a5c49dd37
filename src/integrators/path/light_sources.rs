//! Sources of light: the environment in device memory, and the lights of a scene on the host.

use std::sync::Arc;

use super::environment::DeviceEnvironment;
use super::features;
use super::lights::{LightBuilder, Lights};
use super::settings::{PathOptions, Strategy};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::gpu::Device;
use crate::integrators::backdrop::Backdrop;
use crate::interface::{LightKind, LightKinds, PathFeature, PathFeatures};
use crate::scene::Environment;

/// The environment and the lights that options leave of a scene.
pub(super) struct LightSources {
    pub environment: DeviceEnvironment,
    pub lights: Lights,
    /// Makes the lights again where they move; `None` where they do not depend on the scene.
    pub builder: Option<LightBuilder>,
}

impl LightSources {
    /// Uploads the environment, and lists the lights.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Arc<Device>, flat: &FlatScene, options: &PathOptions) -> Result<Self> {
        let white = Environment::Uniform(glam::Vec3::ONE);
        let environment = match options.view {
            // a view shows surfaces, independent of lights
            Some(_) => &Environment::Black,
            None if options.white_sky.is_some() => &white,
            None => &flat.scene.environment,
        };
        let blurs = options.backdrop == Backdrop::Blurred;
        let environment = DeviceEnvironment::new(device, environment, options.strategy == Strategy::Mis, blurs)?;
        let mut builder = None;
        let lights = match options.white_sky {
            _ if options.view.is_some() => Lights::default(),
            Some(_) => Lights::environment_only(),
            None => {
                let radiance = if options.background_only { glam::Vec3::ZERO } else { environment.mean };
                builder.insert(LightBuilder::new(flat, radiance)).lights(flat.scene)
            }
        };
        Ok(Self { environment, lights, builder })
    }

    /// Features of shaders that lights, options and scene require, and the kinds of lights.
    pub fn features(&self, flat: &FlatScene, options: &PathOptions, cones: bool) -> (PathFeatures, LightKinds) {
        let has_map = self.environment.map.texels != 0;
        let (features, mut light_kinds) = features::features(options, flat, &self.lights, has_map, cones);
        if let Some(builder) = self.builder.as_ref().filter(|_| features.contains(PathFeature::LightSamples)) {
            builder.moving_kinds(flat.scene).for_each(|kind| light_kinds.insert(kind));
        }
        (features, light_kinds)
    }

    /// Returns true if paths must keep the environment's density, which no table has then.
    pub fn needs_sky_pdfs(&self, features: PathFeatures, light_kinds: LightKinds) -> bool {
        features.contains(PathFeature::LightSamples)
            && self.lights.environment.is_some()
            && (self.environment.map.texels == 0 || light_kinds.contains(LightKind::Portal))
    }
}
