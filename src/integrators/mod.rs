//! Integrators of stills: how samples become pixels, a folder each. [`ALL`] is the one list of them; the command line, the renderer and reports know an
//! integrator by what [`Integrator`] says.
//!
//! [`aov`] are auxiliary outputs, and [`rays`] traces a set of rays as it is.

pub mod ao;
pub mod aov;
pub mod lighting;
pub mod path;
pub mod rays;

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::output::Image;
use crate::output::tone_map::ToneMap;
use crate::ray::Ray;
use crate::scene::{Camera, Scene};
use crate::shaders::StreamShaders;
use crate::tracer::{Needs, Tracer};

/// All integrators, in the order in which they are listed to users.
pub static ALL: [&dyn Integrator; 9] = [
    &ao::AmbientOcclusion,
    &path::kinds::PATH,
    &path::kinds::DIRECT,
    &path::kinds::WHITTED,
    &path::kinds::AO_SKY,
    &path::kinds::NORMALS,
    &path::kinds::ALBEDO,
    &path::kinds::DEPTH,
    &path::kinds::BAKED_OCCLUSION,
];

/// The settings of all integrators: a struct each.
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
    pub fn given(&self) -> Vec<crate::settings::Given> {
        [self.ao.given(), self.path.given()].concat()
    }
}

/// A still that is to be rendered.
pub struct Shot<'a> {
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
    /// Settings of integrators.
    pub settings: &'a IntegratorSettings,
    /// Stop after this time with what there is.
    pub time_limit: Option<Duration>,
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// What the film starts from, and where it stops on its way.
    pub film: FilmOptions,
}

/// How a picture of 8 bits is made of an image.
#[derive(Clone, Copy, Debug, Default)]
pub struct PictureOptions {
    /// Tone mapping operator.
    pub tone_map: ToneMap,
    /// Stops.
    pub exposure: f32,
}

/// What an integrator has to say of an image, for people and for programs.
#[derive(Clone, Debug, Default)]
pub struct IntegratorReport {
    /// Sentences.
    pub lines: Vec<String>,
    /// What was skipped because neither the scene nor the settings need it, a sentence each.
    pub explanations: Vec<String>,
    /// Keys of the record besides those that all images have.
    pub record: Map<String, Value>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// An image and how it came about.
#[derive(Default)]
pub struct Rendered {
    /// The film and the work that it took.
    pub image: Accumulated,
    /// What the integrator says of it.
    pub report: IntegratorReport,
    /// Camera rays and occlusion rays of the first sample, if they were to be kept.
    pub kept_rays: [Vec<Ray>; 2],
}

/// An integrator of stills.
pub trait Integrator: Sync {
    /// As on the command line and in files.
    fn name(&self) -> &'static str;

    /// What it computes, in a line.
    fn help(&self) -> &'static str;

    /// Names of its film's channels: one, or three.
    fn channels(&self) -> &'static [&'static str];

    /// Of what the mean of its channels is reported: `radiance`.
    fn quantity(&self) -> &'static str;

    /// The scene as it traces it.
    ///
    /// # Errors
    /// [`crate::Error::Scene`].
    fn flatten<'s>(&self, scene: &'s Scene) -> Result<FlatScene<'s>>;

    /// What it needs of the scene in device memory.
    fn needs(&self, settings: &IntegratorSettings) -> Needs;

    /// Streams that it will trace, as far as they can be known before the scene is there: they are compiled beside the hierarchy's build.
    fn streams(&self, settings: &IntegratorSettings) -> Vec<&'static StreamShaders>;

    /// Rays of a sample, about: what the hierarchy's build is planned for.
    fn rays_per_sample(&self) -> u64;

    /// Can tiles of the image be skipped in which no primitive projects?
    fn skips_empty_tiles(&self, shot: &Shot) -> bool;

    /// Does it see the scene's environment, so that the image depends on it?
    fn sees_environment(&self) -> bool;

    /// All that the samples of an image depend on beside scene, camera, size and seed: keys of its metadata, and values. `None`: not in the metadata.
    fn identity(&self, shot: &Shot) -> Vec<(&'static str, Option<String>)>;

    /// Renders. `tile_mask` says which tiles are to be skipped.
    ///
    /// # Errors
    /// Those of the device; [`crate::Error::Usage`] for settings that do not fit the camera; [`crate::Error::Interrupted`] when `control` says so.
    fn render(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        shot: &Shot,
        tile_mask: Option<Arc<TileMask>>,
        control: &mut dyn Control,
    ) -> Result<Rendered>;

    /// How the image is shown with 8 bits a channel.
    fn picture(&self, image: &Image, options: &PictureOptions) -> Image;

    /// How paths are traced, if it traces paths: what denoisers need to know.
    ///
    /// # Errors
    /// Those of [`Integrator::render`] that settings have.
    fn path_options(&self, shot: &Shot) -> Result<Option<path::PathOptions>> {
        let _ = shot;
        Ok(None)
    }
}

impl Shot<'_> {
    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }

    /// The camera as shaders take it.
    pub fn camera_record(&self, flat: &FlatScene) -> CameraRecord {
        CameraRecord::new(self.camera, flat.origin, self.aspect())
    }
}

/// The name of an integrator that there is.
#[derive(Clone, Copy)]
pub struct IntegratorName(&'static dyn Integrator);

impl IntegratorName {
    /// The integrator that is called so.
    pub fn find(name: &str) -> Option<Self> {
        ALL.iter().find(|i| i.name() == name).map(|i| Self(*i))
    }

    /// As on the command line and in files.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// The integrator.
    pub fn get(self) -> &'static dyn Integrator {
        self.0
    }
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
        Self::find(name).ok_or_else(|| Error::Usage(format!("no integrator is called {name}; there are {}", names())))
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

/// For the command line: lists the integrators with what they compute.
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
        assert!("ambient".parse::<IntegratorName>().unwrap_err().to_string().contains("there are ao, path"));
    }

    /// A setting that names an integrator which does not exist would be of no use.
    #[test]
    fn settings_name_integrators_that_exist() {
        let every = serde_json::json!({
            "ao": { "ao_radius": 1.0, "ao_falloff": 2.0, "ao_normal": "shading" },
            "path": {
                "max_depth": 1, "min_depth": 1, "rr_depth": 1, "firefly_clamp": 1.0, "sampling": "bsdf", "energy_compensation": true, "sky_albedo": 0.1,
                "denoise": "filter", "pixel_filter": "tent", "texture_filter": "ray-cone", "f_number": 1.0, "focus_distance": 1.0
            }
        });
        let settings: IntegratorSettings = serde_json::from_value(every).unwrap();
        let given = settings.given();
        assert!(given.len() >= 14);
        for setting in given {
            for name in setting.applies.integrators {
                assert!(IntegratorName::find(name).is_some(), "{}: {name}", setting.name);
            }
        }
    }
}
