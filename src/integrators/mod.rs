//! Integrators of stills, one folder each. [`ALL`] is the only list of them; the command line, the
//! renderer and reports access an integrator through the trait [`Integrator`].
//!
//! [`aov`] renders auxiliary outputs, [`rays`] traces a set of rays, and [`ray_sets`] makes those
//! of an image.

mod all;
pub mod ao;
pub mod aov;
pub mod backdrop;
pub mod lighting;
pub mod path;
pub mod ray_sets;
pub mod rays;

use std::sync::Arc;

use serde_json::{Map, Value};

#[cfg(feature = "cli")]
pub use all::parser;
pub use all::{ALL, IntegratorName, check};

use backdrop::Backdrop;

use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::tile_mask::TileMask;
use crate::film::{Control, SampleSettings};
use crate::output::Image;
use crate::output::tone_map::ToneMap;
use crate::ray::Ray;
use crate::scene::{Camera, Scene};
use crate::settings::Capability;
use crate::shaders::StreamShaders;
use crate::tracer::{Needs, Tracer};

/// The settings of all integrators.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct IntegratorSettings {
    /// Ambient occlusion.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub ao: ao::settings::AoSettings,
    /// Paths.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub path: path::settings::PathSettings,
}

impl IntegratorSettings {
    /// The settings that were given.
    pub fn given(&self) -> Vec<crate::settings::GivenSetting> {
        [self.ao.given(), self.path.given()].concat()
    }
}

/// A still to be rendered: the inputs of an integrator.
pub struct RenderJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// Settings of its samples.
    pub samples: SampleSettings,
    /// Settings of integrators.
    pub settings: &'a IntegratorSettings,
    /// The background of camera rays that leave the scene.
    pub backdrop: Backdrop,
}

/// Options of the conversion to 8 bits per channel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PictureOptions {
    /// Tone mapping operator.
    pub tone_map: ToneMap,
    /// Exposure in stops.
    pub exposure: f32,
}

/// An integrator's report of an image, for people and for programs.
#[derive(Clone, Debug, Default)]
pub struct IntegratorReport {
    /// Lines for people.
    pub lines: Vec<String>,
    /// Sentences about work that was skipped because neither the scene nor the settings require it.
    pub explanations: Vec<String>,
    /// Keys of the JSON record in addition to those of all images.
    pub record: Map<String, Value>,
    /// Warnings for the user, a sentence each.
    pub warnings: Vec<String>,
}

/// The result of an integrator.
#[derive(Default)]
pub struct Rendered {
    /// The film and statistics of its accumulation.
    pub image: Accumulated,
    /// The integrator's report.
    pub report: IntegratorReport,
    /// Camera rays and occlusion rays of the first sample, if [`SampleSettings::keep_rays`] is set.
    pub kept_rays: [Vec<Ray>; 2],
}

/// An integrator of stills.
pub trait Integrator: Sync {
    /// Name on the command line and in files.
    fn name(&self) -> &'static str;

    /// Description in one line.
    fn help(&self) -> &'static str;

    /// Capabilities, by which settings know whether they apply.
    fn capabilities(&self) -> &'static [Capability];

    /// Returns true if it can do this.
    fn can(&self, capability: Capability) -> bool {
        self.capabilities().contains(&capability)
    }

    /// Names of the film's channels: one or three.
    fn channels(&self) -> &'static [&'static str];

    /// Name of the quantity whose mean is reported: `radiance`.
    fn quantity(&self) -> &'static str;

    /// How it interprets alpha blending, for which the scene is flattened.
    fn blend(&self) -> Blend;

    /// Scene data that it needs in device memory.
    fn needs(&self, settings: &IntegratorSettings) -> Needs;

    /// Streams that it will trace, as far as known without the scene, to be compiled early.
    fn streams(&self, settings: &IntegratorSettings) -> Vec<&'static StreamShaders>;

    /// Approximate number of rays per sample, by which the quality of the BVH build is chosen.
    fn rays_per_sample(&self) -> u64;

    /// Returns true if tiles of the image into which no primitive projects may be skipped.
    fn skips_empty_tiles(&self, job: &RenderJob) -> bool;

    /// Returns true if the image depends on the scene's environment.
    fn sees_environment(&self) -> bool;

    /// Returns true if the image shows the environment, or a light infinitely far away.
    fn shows_environment(&self, scene: &Scene) -> bool {
        let _ = scene;
        false
    }

    /// Everything that the samples of an image depend on besides scene, camera, size and seed: keys
    /// and values of metadata; `None`: the key is absent.
    fn identity(&self, job: &RenderJob) -> Vec<(&'static str, Option<String>)>;

    /// Renders a still.
    ///
    /// # Errors
    /// Those of the device; [`crate::Error::Usage`] for settings that do not fit the camera;
    /// [`crate::Error::Interrupted`] when `control` says so.
    fn render(&self, tracer: &Tracer, flat: &FlatScene, job: &RenderJob, control: &mut dyn Control)
    -> Result<Rendered>;

    /// Converts the image to what an 8-bit file shows.
    fn picture(&self, image: &Image, options: &PictureOptions) -> Image;

    /// Options of path tracing, if it traces paths.
    ///
    /// # Errors
    /// Those of [`Integrator::render`] that settings have.
    fn path_options(&self, job: &RenderJob) -> Result<Option<path::PathOptions>> {
        let _ = job;
        Ok(None)
    }

    /// Options of path tracing as denoisers need them, if its images can be denoised.
    ///
    /// # Errors
    /// Those of [`Integrator::render`] that settings have.
    fn denoise_options(&self, job: &RenderJob) -> Result<Option<path::PathOptions>> {
        let path = self.path_options(job)?;
        // ambient occlusion is the light of a white sky: its noise does not depend on materials
        let grey = || path::PathOptions { samples: job.samples.clone(), white_sky: Some(1.0), ..Default::default() };
        Ok(path.or_else(|| self.can(Capability::Denoising).then(grey)))
    }
}

impl RenderJob<'_> {
    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.samples.size[0]) / f64::from(self.samples.size[1])
    }

    /// The camera as shaders read it.
    pub fn camera_record(&self, flat: &FlatScene) -> CameraRecord {
        CameraRecord::new(self.camera, flat.origin, self.aspect())
    }

    /// Finds the tiles of the image that can show geometry; `None` if all tiles are needed.
    pub fn tile_mask(
        &self,
        integrator: &dyn Integrator,
        flat: &FlatScene,
        camera: &CameraRecord,
    ) -> Option<Arc<TileMask>> {
        if !integrator.skips_empty_tiles(self) {
            return None;
        }
        TileMask::new(flat, camera, self.samples.size, self.samples.spp).map(Arc::new)
    }
}
