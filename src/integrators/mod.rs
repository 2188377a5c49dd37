//! Integrators of stills, one folder each. [`ALL`] is the only list of them; the command line, the renderer and reports access an integrator
//! through the trait [`Integrator`].
//!
//! [`aov`] renders auxiliary outputs, [`rays`] traces a given set of rays, and [`ray_sets`] makes those of an image.

pub mod ao;
pub mod aov;
pub mod lighting;
pub mod path;
pub mod ray_sets;
pub mod rays;

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::interface::PixelFilter;
use crate::output::Image;
use crate::output::tone_map::ToneMap;
use crate::ray::Ray;
use crate::scene::{Camera, Scene};
use crate::settings::{self, Capability, GivenSetting};
use crate::shaders::StreamShaders;
use crate::tracer::{Needs, Tracer};

/// All integrators, in the order in which they are listed to users.
pub static ALL: &[&dyn Integrator] = &[
    &ao::AmbientOcclusion,
    &path::kinds::PATH,
    &path::kinds::DIRECT,
    &path::kinds::LIT,
    &path::kinds::WHITTED,
    &path::kinds::AO_SKY,
    &path::kinds::NORMALS,
    &path::kinds::ALBEDO,
    &path::kinds::DEPTH,
    &path::kinds::BAKED_OCCLUSION,
];

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
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub spp: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// Pixel reconstruction filter.
    pub pixel_filter: PixelFilter,
    /// Settings of integrators.
    pub settings: &'a IntegratorSettings,
    /// Stop after this time and keep the image so far.
    pub time_limit: Option<Duration>,
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// The film to resume, and when to save it.
    pub film: FilmOptions,
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
    /// Camera rays and occlusion rays of the first sample, if [`RenderJob::keep_rays`] is set.
    pub kept_rays: [Vec<Ray>; 2],
}

/// An integrator of stills.
pub trait Integrator: Sync {
    /// Name on the command line and in files.
    fn name(&self) -> &'static str;

    /// Description in one line.
    fn help(&self) -> &'static str;

    /// What it can do: by this settings know whether they apply to it.
    fn capabilities(&self) -> &'static [Capability];

    /// Names of the film's channels: one or three.
    fn channels(&self) -> &'static [&'static str];

    /// Name of the quantity whose mean is reported: `radiance`.
    fn quantity(&self) -> &'static str;

    /// How it interprets alpha blending, for which the scene is flattened.
    fn blend(&self) -> Blend;

    /// Scene data that it needs in device memory.
    fn needs(&self, settings: &IntegratorSettings) -> Needs;

    /// Streams that it will trace, as far as they are known before the scene is loaded: they are compiled while the BVH is built.
    fn streams(&self, settings: &IntegratorSettings) -> Vec<&'static StreamShaders>;

    /// Approximate number of rays per sample, by which the quality of the BVH build is chosen.
    fn rays_per_sample(&self) -> u64;

    /// Returns true if tiles of the image into which no primitive projects may be skipped.
    fn skips_empty_tiles(&self, job: &RenderJob) -> bool;

    /// Returns true if the image depends on the scene's environment.
    fn sees_environment(&self) -> bool;

    /// Returns true if the image shows the environment, or a light infinitely far away, where there is no surface.
    fn shows_environment(&self, scene: &Scene) -> bool {
        let _ = scene;
        false
    }

    /// Everything that the samples of an image depend on besides scene, camera, size and seed: metadata keys and values. `None`: the key is absent from the
    /// metadata.
    fn identity(&self, job: &RenderJob) -> Vec<(&'static str, Option<String>)>;

    /// Renders. `tile_mask`: the tiles of the image that show geometry; the others are skipped.
    ///
    /// # Errors
    /// Those of the device; [`crate::Error::Usage`] for settings that do not fit the camera; [`crate::Error::Interrupted`] when `control` says so.
    fn render(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        job: &RenderJob,
        tile_mask: Option<Arc<TileMask>>,
        control: &mut dyn Control,
    ) -> Result<Rendered>;

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
        // ambient occlusion is like the light of a white sky: its noise does not depend on materials
        let grey =
            || path::PathOptions { size: job.size, pixel_filter: job.pixel_filter, white_sky: Some(1.0), ..Default::default() };
        Ok(path.or_else(|| self.capabilities().contains(&Capability::Denoising).then(grey)))
    }
}

impl RenderJob<'_> {
    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }

    /// The camera as shaders read it.
    pub fn camera_record(&self, flat: &FlatScene) -> CameraRecord {
        CameraRecord::new(self.camera, flat.origin, self.aspect())
    }
}

/// The name of an existing integrator.
#[derive(Clone, Copy)]
pub struct IntegratorName(&'static dyn Integrator);

impl IntegratorName {
    /// Finds an integrator by name.
    pub fn find(name: &str) -> Option<Self> {
        ALL.iter().find(|i| i.name() == name).map(|i| Self(*i))
    }

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// The integrator.
    pub fn get(self) -> &'static dyn Integrator {
        self.0
    }
}

/// Name and capabilities of all integrators.
fn capabilities() -> Vec<settings::Integrator> {
    ALL.iter().map(|i| (i.name(), i.capabilities())).collect()
}

/// Checks that each of these settings has an effect on what an integrator renders: real-time frames if `frames` is the setting that selects them, else a still.
///
/// # Errors
/// [`Error::Usage`] for the first setting without effect.
pub fn check(given: &[GivenSetting], integrator: IntegratorName, frames: Option<&GivenSetting>) -> Result<()> {
    settings::check(given, &(integrator.name(), integrator.get().capabilities()), &capabilities(), frames)
}

impl Default for IntegratorName {
    fn default() -> Self {
        Self(ALL[0])
    }
}

impl PartialEq for IntegratorName {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for IntegratorName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for IntegratorName {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let names = || ALL.iter().map(|i| i.name()).collect::<Vec<_>>().join(", ");
        Self::find(name).ok_or_else(|| Error::Usage(format!("unknown integrator {name}; choose one of {}", names())))
    }
}

impl serde::Serialize for IntegratorName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> serde::Deserialize<'de> for IntegratorName {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

/// Parser of the command line, which lists the integrators with their descriptions.
#[cfg(feature = "cli")]
pub fn parser() -> impl clap::builder::TypedValueParser<Value = IntegratorName> {
    use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(ALL.iter().map(|i| PossibleValue::new(i.name()).help(i.help())))
        .try_map(|name| name.parse::<IntegratorName>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrators_have_names_of_their_own() {
        for integrator in ALL {
            assert_eq!(IntegratorName::find(integrator.name()).unwrap().name(), integrator.name());
            assert_eq!(ALL.iter().filter(|i| i.name() == integrator.name()).count(), 1);
        }
        assert!("ambient".parse::<IntegratorName>().unwrap_err().to_string().contains("choose one of ao, path"));
    }

    /// A setting that applies to no integrator would have no effect.
    #[test]
    fn settings_apply_to_some_integrator() {
        let mut settings = IntegratorSettings::default();
        let all = settings.ao.editable().into_iter().chain(settings.path.editable()).collect::<Vec<_>>();
        assert!(all.len() >= 14);
        for setting in all {
            assert!(capabilities().iter().any(|i| setting.applies.includes(i)), "{}", setting.name);
        }
    }
}
