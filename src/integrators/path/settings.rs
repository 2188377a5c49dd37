//! Settings of path tracing and of the integrators based on it: the settings as given
//! ([`PathSettings`]), the resolved options of a render ([`PathOptions`]), the shader features that
//! they require, and their metadata and JSON record. An option that is a number in shaders is also
//! a field of [`PathOptionsRecord`].

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::ambient::{Ambient, EnvironmentLight, OccludedLight};
use super::params::PathParams;
use super::{PixelFilter, View};
use crate::error::{Error, Result};
use crate::film::SampleSettings;
use crate::integrators::RenderJob;
use crate::integrators::backdrop::Backdrop;
use crate::interface::{PathFeature, PathOptionsRecord};
use crate::scene::{Ground, Projection};
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_albedo, parse_positive, parse_radiance};
use crate::settings::{AppliesTo, Capability, choices, settings};

/// Integrators that trace light paths.
const LIGHT: AppliesTo = AppliesTo::all_of(Capability::LightTransport);
/// Stills of integrators that trace light paths.
const PATHS: AppliesTo = AppliesTo::stills_of(Capability::LightTransport);
/// Integrators whose path length is configurable.
const LONG: AppliesTo = AppliesTo::all_of(Capability::PathLength);
/// Integrators that use a pixel filter and a lens.
const CAMERA: AppliesTo = AppliesTo::stills_of(Capability::CameraModel);
/// Integrators that read textures.
const TEXTURES: AppliesTo = AppliesTo::all_of(Capability::Textures);
/// Integrators with a choice of sampling strategy.
const SAMPLED: AppliesTo = AppliesTo::all_of(Capability::SamplingStrategy);
/// The integrator with a white sky.
const SKY: AppliesTo = AppliesTo::all_of(Capability::WhiteSky);
/// The integrator with ambient light.
const AMBIENT: AppliesTo = AppliesTo::all_of(Capability::AmbientLight);

/// Maximum path length, in bounces; Russian roulette ends paths long before.
pub const MAX_DEPTH: u32 = 4096;

/// Default albedo of `ao-sky`.
const SKY_ALBEDO: f64 = 0.5;
/// Height of the sensor that an f-number refers to, metres.
const SENSOR_HEIGHT: f64 = 0.024;

choices! {
    /// How directions are sampled. All strategies estimate the same image; all but the first are
    /// for comparison.
    pub enum Strategy {
        /// Multiple importance sampling of BSDF and lights, power heuristic (Veach 1997)
        Mis = "mis",
        /// BSDF sampling only
        Bsdf = "bsdf",
        /// Light sampling for emitters that it can sample, BSDF sampling for the rest
        Light = "light",
        /// Cosine-weighted hemisphere sampling
        Cosine = "cosine",
        /// Uniform hemisphere sampling
        Uniform = "uniform",
    }
}

impl Strategy {
    pub(super) fn samples_lights(self) -> bool {
        matches!(self, Strategy::Mis | Strategy::Light)
    }
}

choices! {
    /// How a path reads textures.
    pub enum TextureFilter {
        /// Bilinear lookups: the samples of a pixel average them
        Bilinear = "bilinear",
        /// Ray cones choose a mip level: less noise at low sample counts, biased
        RayCone = "ray-cone",
    }
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Lens {
    /// Lens radius, scene units.
    pub radius: f32,
    /// Focus distance along the view, scene units.
    pub focus: f32,
}

choices! {
    /// How paths are traced; images are the same.
    pub enum PathKernel {
        /// The megakernel for scenes of few primitives on CPU drivers, else the wavefront
        Auto = "auto",
        /// A kernel for each step: rays and states are handed on in memory
        Wavefront = "wavefront",
        /// One kernel for whole paths, for static scenes of few primitives on CPU drivers
        Megakernel = "megakernel",
    }
}

settings! {
    /// Paths.
    "Path tracing (--integrator path, direct, lit, whitted, ao-sky; views)"
    pub struct PathSettings {
        /// Maximum path length, in bounces [default: the scene's, or no limit]
        ///
        /// 0 is emitted light alone, 1 adds direct light.
        max_depth: Option<u32>, option(value_name = "N"), applies(LONG);
        /// Leave out paths of fewer bounces [default: 0]
        ///
        /// 1 hides emitters and the environment behind the scene, 2 leaves indirect light alone.
        min_depth: Option<u32>, option(value_name = "N"), applies(LIGHT), research;
        /// Bounces before Russian roulette may end a path [default: 5]
        rr_depth: Option<u32>, option(value_name = "N"), applies(LIGHT), research;
        /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
        firefly_clamp: Option<f64>,
            option(value_name = "X", value_parser = parse_positive, allow_hyphen_values = true), applies(LIGHT);
        /// Scale factor of indirect light, of two bounces or more; biased but for 1 [default: 1]
        indirect_scale: Option<f64>,
            option(value_name = "X", value_parser = parse_positive, allow_hyphen_values = true), applies(LIGHT), research;
        /// Sampling strategy; all but the default are for comparison [default: mis]
        sampling: Option<Strategy>, option(value_enum), applies(SAMPLED), research;
        /// Compensate for energy lost to multiple scattering between microfacets (Turquin 2019)
        energy_compensation: bool, option(), applies(LIGHT);
        /// Albedo of all surfaces with --integrator ao-sky [default: 0.5]
        sky_albedo: Option<f64>, option(value_name = "X", value_parser = parse_albedo, allow_hyphen_values = true), applies(SKY), research;
        /// Ambient radiance of --integrator lit, linear RGB [default: 1,1,1]
        ambient: Option<DVec3>, option(value_name = "R,G,B", value_parser = parse_radiance, allow_hyphen_values = true), applies(AMBIENT);
        /// How the environment lights surfaces with --integrator lit [default: traced]
        environment_light: Option<EnvironmentLight>, option(value_enum), applies(AMBIENT);
        /// Which light ambient occlusion darkens with --integrator lit [default: ambient]
        occluded_light: Option<OccludedLight>, option(value_enum), applies(AMBIENT);
        /// How paths are traced, for comparison: images are the same [default: auto]
        path_kernel: Option<PathKernel>, option(value_enum), applies(PATHS), research;
        /// Texture filter of paths [default: bilinear]
        texture_filter: Option<TextureFilter>, option(value_enum), applies(TEXTURES), research;
        /// f-number of a thin lens with a 36x24 mm sensor; scene units are taken as metres
        /// [default: a pinhole]
        f_number: Option<f64>,
            option(value_name = "N", value_parser = parse_positive, requires = "focus_distance", allow_hyphen_values = true), applies(CAMERA);
        /// Focus distance along the view, in scene units
        focus_distance: Option<f64>,
            option(value_name = "D", value_parser = parse_positive, requires = "f_number", allow_hyphen_values = true), applies(CAMERA);
    }
}

/// Options of a path-traced image.
#[derive(Clone, Debug)]
pub struct PathOptions {
    /// Settings of samples, of one path each. A tile mask needs a black environment,
    /// and neither a lens nor a wide pixel filter.
    pub samples: SampleSettings,
    /// Maximum path length in bounces: 0 is emitted light, 1 adds direct light.
    pub max_depth: u32,
    /// Sampling strategy.
    pub strategy: Strategy,
    /// Continue paths by delta lobes only, as all other light is sampled: with [`Strategy::Light`].
    pub specular_only: bool,
    /// Albedo of all surfaces, which are diffuse, under a white sky as the only emitter: the
    /// rendering equation that ambient occlusion approximates.
    pub white_sky: Option<f32>,
    /// Ambient light at the first surface of each path.
    pub ambient: Option<Ambient>,
    /// The environment is seen by the camera and lights no surface.
    pub background_only: bool,
    /// The background of camera rays that leave the scene.
    pub backdrop: Backdrop,
    /// The material of a ground that catches shadows: camera rays see what is behind it, darkened
    /// by what the scene hides of its light ([`crate::scene::Scene::catcher`]).
    pub catcher: Option<u32>,
    /// Surface property that is rendered in place of radiance; 0 where camera rays miss.
    pub view: Option<View>,
    /// Paths begin at given points of surfaces, not at the camera ([`super::points`]).
    pub begins_at_points: bool,
    /// Texture filter; [`TextureFilter::RayCone`] requires [`crate::tracer::Needs::mip_levels`].
    pub texture_filter: TextureFilter,
    /// Thin lens of a perspective camera; `None`: a pinhole.
    pub lens: Option<Lens>,
    /// Minimum number of bounces: shorter paths are left out.
    pub min_depth: u32,
    /// Bounces before Russian roulette may end a path.
    pub rr_depth: u32,
    /// Radiance to which indirect light is clamped; infinite: it is not.
    pub firefly_clamp: f32,
    /// Scale factor of indirect light, of two bounces or more.
    pub indirect_scale: f32,
    /// How paths are traced, which no image depends on.
    pub kernel: PathKernel,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self {
            samples: SampleSettings::default(),
            max_depth: MAX_DEPTH,
            strategy: Strategy::Mis,
            specular_only: false,
            white_sky: None,
            ambient: None,
            background_only: false,
            backdrop: Backdrop::Map,
            catcher: None,
            view: None,
            begins_at_points: false,
            texture_filter: TextureFilter::Bilinear,
            lens: None,
            min_depth: 0,
            rr_depth: 5,
            firefly_clamp: f32::INFINITY,
            indirect_scale: 1.0,
            kernel: PathKernel::Auto,
        }
    }
}

impl PathSettings {
    /// The values of settings that are not given, by name.
    pub fn defaults() -> Map<String, Value> {
        let options = PathOptions::default();
        let defaults = [
            ("min_depth", json!(options.min_depth)),
            ("rr_depth", json!(options.rr_depth)),
            ("firefly_clamp", json!(options.firefly_clamp)),
            ("indirect_scale", json!(options.indirect_scale)),
            ("sampling", json!(Strategy::default())),
            ("texture_filter", json!(TextureFilter::default())),
            ("sky_albedo", json!(SKY_ALBEDO)),
            ("path_kernel", json!(PathKernel::default())),
        ];
        defaults.into_iter().filter(|(_, v)| !v.is_null()).map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

impl PathOptions {
    /// The options that the samples of an image depend on, each with its key, its text in an
    /// image's metadata (`None`: the key is absent), and its value in the JSON record.
    fn described(&self) -> Vec<(&'static str, Option<String>, Value)> {
        // Without `..`, so that a new option must be added here.
        let Self {
            samples:
                SampleSettings {
                    size: _,
                    spp: _,
                    seed: _,
                    pixel_filter,
                    time_limit: _,
                    keep_rays: _,
                    tile_mask: _,
                    film: _,
                },
            max_depth,
            min_depth,
            rr_depth,
            firefly_clamp,
            indirect_scale,
            strategy,
            white_sky,
            ambient,
            background_only,
            backdrop,
            catcher,
            view,
            // no image of a camera
            begins_at_points: _,
            specular_only: _,
            texture_filter,
            lens,
            kernel: _,
        } = self;

        // Texts of metadata are short, and absent where the default holds.
        let default = Self::default();
        let depth_limit = (*max_depth < MAX_DEPTH).then_some(max_depth);
        let lookup = (*texture_filter != TextureFilter::Bilinear).then(|| texture_filter.to_string());
        let light = if *background_only { EnvironmentLight::Ambient } else { EnvironmentLight::Traced };
        // samples are the same before any colour, and before none
        let seen = match backdrop {
            Backdrop::Map => "map",
            Backdrop::Blurred => "blurred",
            Backdrop::Colour(_) | Backdrop::Transparent => "hidden",
        };
        let aperture = lens.map(|lens| format!("radius {}, focus {}", lens.radius, lens.focus));
        vec![
            ("max_depth", Some(depth_text(*max_depth)), json!(depth_limit)),
            ("sampling", Some(strategy.to_string()), json!(strategy)),
            ("min_depth", text_unless_default(min_depth, &default.min_depth), json!(min_depth)),
            // shaders read it in any case
            ("rr_depth", Some(rr_depth.to_string()), json!(rr_depth)),
            ("firefly_clamp", text_unless_default(firefly_clamp, &default.firefly_clamp), json!(firefly_clamp)),
            ("indirect_scale", text_unless_default(indirect_scale, &default.indirect_scale), json!(indirect_scale)),
            ("pixel_filter", Some(pixel_filter.to_string()), json!(pixel_filter)),
            ("texture_filter", lookup, json!(texture_filter)),
            ("lens", aperture, json!(lens)),
            ("sky_albedo", white_sky.map(|albedo| albedo.to_string()), json!(white_sky)),
            ("ambient", ambient.map(|a| a.to_string()), json!(ambient)),
            ("environment_light", background_only.then(|| EnvironmentLight::Ambient.to_string()), json!(light)),
            ("background", (*backdrop != Backdrop::Map).then(|| seen.to_owned()), json!(seen)),
            ("ground", catcher.map(|_| Ground::Catcher.to_string()), json!(catcher.map(|_| Ground::Catcher))),
            // the name of the integrator says it in metadata
            ("view", None, json!(view)),
        ]
    }

    /// Replaces the numbers for which there is a setting.
    fn set_numbers(&mut self, settings: &PathSettings) {
        let PathSettings { min_depth, rr_depth, firefly_clamp, indirect_scale, .. } = settings;
        self.min_depth = min_depth.unwrap_or(self.min_depth);
        self.rr_depth = rr_depth.unwrap_or(self.rr_depth);
        self.firefly_clamp = firefly_clamp.map_or(self.firefly_clamp, |x| x as f32);
        self.indirect_scale = indirect_scale.map_or(self.indirect_scale, |x| x as f32);
    }

    /// The numbers as shaders read them.
    fn numbers(&self) -> PathOptionsRecord {
        PathOptionsRecord {
            min_depth: self.min_depth,
            rr_depth: self.rr_depth,
            firefly_clamp: self.firefly_clamp,
            indirect_scale: self.indirect_scale,
            reserved: Default::default(),
        }
    }

    /// Shader features that the numbers require.
    fn number_features(&self) -> Vec<(PathFeature, bool)> {
        let default = Self::default();
        vec![
            (PathFeature::MinDepth, self.min_depth != default.min_depth),
            (PathFeature::Clamp, self.firefly_clamp != default.firefly_clamp),
            (PathFeature::IndirectScale, self.indirect_scale != default.indirect_scale),
        ]
    }

    /// Remarks for the user about bias that numbers bring into the image.
    fn number_remarks(&self) -> Vec<String> {
        let default = Self::default();
        let clamped = (self.firefly_clamp != default.firefly_clamp)
            .then(|| format!("indirect radiance clamped to {}: biased, too dark", self.firefly_clamp));
        let scaled = (self.indirect_scale != default.indirect_scale)
            .then(|| format!("indirect light scaled by {}: biased", self.indirect_scale));
        clamped.into_iter().chain(scaled).collect()
    }
}

/// An option's text in metadata: none where it is the default.
fn text_unless_default<T: PartialEq + ToString>(number: &T, default: &T) -> Option<String> {
    (number != default).then(|| number.to_string())
}

impl PathSettings {
    /// Albedo of `ao-sky`.
    pub(super) fn sky_albedo(&self) -> f32 {
        self.sky_albedo.unwrap_or(SKY_ALBEDO) as f32
    }

    /// The thin lens that the settings describe, if any.
    fn lens(&self, projection: Projection) -> Result<Option<Lens>> {
        let (Some(f_number), Some(focus)) = (self.f_number, self.focus_distance) else { return Ok(None) };
        match projection {
            Projection::Perspective { fov_y } => {
                let focal_length = 0.5 * SENSOR_HEIGHT / (0.5 * fov_y).tan();
                Ok(Some(Lens { radius: (0.5 * focal_length / f_number) as f32, focus: focus as f32 }))
            }
            Projection::Orthographic { .. } => {
                Err(Error::Usage("--f-number: the camera is orthographic and has no lens".into()))
            }
        }
    }
}

impl PathOptions {
    /// The options of a job for rendering light with all strategies.
    pub(super) fn new(job: &RenderJob) -> Result<Self> {
        let settings = &job.settings.path;
        let mut options = Self {
            samples: job.samples.clone(),
            max_depth: settings.max_depth.or(job.scene.hints.max_depth).unwrap_or(MAX_DEPTH),
            strategy: settings.sampling.unwrap_or_default(),
            texture_filter: settings.texture_filter.unwrap_or_default(),
            lens: settings.lens(job.camera.projection)?,
            kernel: settings.path_kernel.unwrap_or_default(),
            backdrop: job.backdrop,
            catcher: job.scene.catcher(),
            ..Self::default()
        };
        options.set_numbers(settings);
        if options.catcher.is_some() && !options.strategy.samples_lights() {
            return Err(Error::Usage(format!(
                "--ground catcher needs light samples, and --sampling {} takes none: leave --sampling out",
                options.strategy
            )));
        }
        Ok(options)
    }

    /// The same options with changed settings of samples.
    pub fn with_samples(mut self, change: impl FnOnce(&mut SampleSettings)) -> Self {
        change(&mut self.samples);
        self
    }

    /// Metadata by which a film is known to be of the same render. `None`: the key is absent.
    pub fn identity(&self) -> Vec<(&'static str, Option<String>)> {
        self.described().into_iter().map(|(key, text, _)| (key, text)).collect()
    }

    /// Shader features that the options require, whatever the scene.
    pub(super) fn features(&self) -> Vec<(PathFeature, bool)> {
        let mut features = self.number_features();
        features.extend([
            (PathFeature::CosineSampling, self.strategy == Strategy::Cosine),
            (PathFeature::UniformSampling, self.strategy == Strategy::Uniform),
            (PathFeature::SpecularOnly, self.specular_only),
            (PathFeature::ConstantAlbedo, self.white_sky.is_some()),
            (PathFeature::Ambient, self.ambient.is_some()),
            (PathFeature::OccludedLight, self.occludes_all()),
            (PathFeature::BackgroundOnly, self.background_only),
            (PathFeature::HiddenBackground, self.backdrop.hides_environment()),
            (PathFeature::BlurredBackground, self.backdrop == Backdrop::Blurred),
            (PathFeature::Catcher, self.catches()),
            (PathFeature::View, self.view.is_some()),
            (PathFeature::SurfacePoints, self.begins_at_points),
            (PathFeature::Lens, self.lens.is_some_and(|l| l.radius > 0.0)),
            (PathFeature::PixelFilter, self.samples.pixel_filter != PixelFilter::Box),
        ]);
        features
    }

    /// Returns true if ambient occlusion darkens all light of a surface.
    pub(super) fn occludes_all(&self) -> bool {
        self.ambient.is_some_and(|a| a.occluded == OccludedLight::All)
    }

    /// Returns true if camera rays meet a ground that catches shadows.
    pub(super) fn catches(&self) -> bool {
        self.catcher.is_some() && self.view.is_none() && !self.begins_at_points
    }

    /// Maximum number of bounces.
    pub(super) fn bounces(&self) -> u32 {
        if self.view.is_some() { 0 } else { self.max_depth.min(MAX_DEPTH) }
    }

    /// The options as shaders read them; other fields are 0.
    pub(super) fn params(&self) -> PathParams {
        PathParams {
            max_depth: self.bounces(),
            view: self.view.map_or(0, |v| v as u32),
            options: self.numbers(),
            catcher: self.catcher.unwrap_or_default(),
            albedo: self.white_sky.unwrap_or(0.0),
            ambient_color: self.ambient.map_or([0.0; 3], |a| a.color.to_array()),
            occludes_all: self.occludes_all().into(),
            occlusion: self.ambient.map(|a| a.occlusion.record()).unwrap_or_default(),
            lens_radius: self.lens.map_or(0.0, |l| l.radius),
            focus: self.lens.map_or(1.0, |l| l.focus),
            ..Default::default()
        }
    }

    /// Remarks for the user about bias in the image.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = self.number_remarks();
        if self.texture_filter == TextureFilter::RayCone {
            remarks.push("textures filtered by ray cones: blurred, however many samples (biased)".into());
        }
        remarks
    }

    /// The options' part of the JSON record.
    pub(super) fn record(&self) -> Map<String, Value> {
        self.described().into_iter().map(|(key, _, value)| (key.to_owned(), value)).collect()
    }
}

/// Text of a maximum number of bounces.
pub(super) fn depth_text(max_depth: u32) -> String {
    if max_depth >= MAX_DEPTH { "unlimited".into() } else { max_depth.to_string() }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::interface::path_options;

    /// Every number of shaders is a setting, an option, and described; and shaders get its value.
    #[test]
    fn numbers_stand_in_every_table() {
        let fields = path_options::FILE.records[0].fields.iter();
        let numbers: BTreeSet<&str> = fields.map(|f| f.name).filter(|name| *name != "reserved").collect();
        assert!(numbers.len() >= 4);
        let described: BTreeSet<&str> = PathOptions::default().described().iter().map(|d| d.0).collect();
        assert!(numbers.is_subset(&described), "{numbers:?} are not all in {described:?}");
        let mut settings = PathSettings::default();
        for name in numbers {
            let mut setting = settings.editable().into_iter().find(|s| s.name == name).expect(name);
            let before = setting.is_given();
            match &mut setting.value {
                crate::settings::Value::Count(count) => **count = Some(7),
                crate::settings::Value::Number(number) => **number = Some(0.5),
                _ => panic!("{name} is no number"),
            }
            assert!(!before && setting.is_given());
            let mut options = PathOptions::default();
            options.set_numbers(&settings);
            assert_ne!(options.numbers(), PathOptions::default().numbers(), "shaders do not get {name}");
            let value =
                |options: &PathOptions| options.described().into_iter().find(|d| d.0 == name).map(|d| (d.1, d.2));
            assert_ne!(value(&options), value(&PathOptions::default()), "{name} is not described");
            settings = PathSettings::default();
        }
    }

    /// Options that need code of their own have it, and biased ones are remarked on.
    #[test]
    fn numbers_have_their_features_and_remarks() {
        let enabled = |options: &PathOptions| -> Vec<PathFeature> {
            options.number_features().into_iter().filter(|f| f.1).map(|f| f.0).collect()
        };
        let default = PathOptions::default();
        assert!(enabled(&default).is_empty() && default.remarks().is_empty());
        let all = PathOptions { min_depth: 1, firefly_clamp: 2.0, indirect_scale: 0.5, ..default };
        assert_eq!(enabled(&all), [PathFeature::MinDepth, PathFeature::Clamp, PathFeature::IndirectScale]);
        let expected = ["indirect radiance clamped to 2: biased, too dark", "indirect light scaled by 0.5: biased"];
        assert_eq!(all.remarks(), expected);
    }
}
