//! Settings of path tracing and of the integrators that are made of it: how they are given ([`PathSettings`]), what a render does with them ([`PathOptions`]), what
//! they require of shaders, and what of them an image's metadata and record say. An option is added in this file.

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::params::PathParams;
use super::{PixelFilter, View};
use crate::error::{Error, Result};
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::integrators::Shot;
use crate::interface::PathFeature;
use crate::scene::Projection;
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_albedo, parse_positive};
use crate::settings::{AppliesTo, choices, settings};

/// What follows light.
const LIGHT: AppliesTo = AppliesTo::stills_of(&["path", "direct", "whitted", "ao-sky"]);
/// Paths of any length.
const LONG: AppliesTo = AppliesTo::stills_of(&["path", "whitted", "ao-sky"]);
/// What looks through a camera.
const CAMERA: AppliesTo =
    AppliesTo::stills_of(&["path", "direct", "whitted", "ao-sky", "normals", "albedo", "depth", "baked-occlusion"]);
/// What reads textures.
const TEXTURES: AppliesTo = AppliesTo::stills_of(&["path", "direct", "whitted", "normals", "albedo", "baked-occlusion"]);
/// What samples directions by a strategy of choice.
const SAMPLED: AppliesTo = AppliesTo::stills_of(&["path", "direct", "ao-sky"]);
/// The white sky alone.
const SKY: AppliesTo = AppliesTo::stills_of(&["ao-sky"]);

choices! {
    /// Denoiser of path-traced images.
    pub enum DenoiseChoice {
        /// Open Image Denoise if it is installed, else the filter
        Auto = "auto",
        /// Intel Open Image Denoise: a neural network, on the CPU
        Oidn = "oidn",
        /// The filter of real-time ambient occlusion, over radiance
        Filter = "filter",
    }
}

settings! {
    /// Paths.
    "Paths (--integrator path, direct, ao-sky; views)"
    pub struct PathSettings {
        /// Maximum path length in bounces: 0 is emitted light, 1 adds direct light [default: the scene's, or no limit]
        max_depth: Option<u32>, option(value_name = "N"), applies(LONG);
        /// Leave out paths of fewer bounces: 1 hides emitters and the environment behind the scene, 2 leaves indirect light alone [default: 0]
        min_depth: Option<u32>, option(value_name = "N"), applies(LIGHT);
        /// Bounces before Russian roulette may end a path [default: 5]
        rr_depth: Option<u32>, option(value_name = "N"), applies(LIGHT);
        /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
        firefly_clamp: Option<f64>, option(value_name = "X", value_parser = parse_positive, allow_hyphen_values = true), applies(LIGHT);
        /// Sampling strategy; all but the default are for comparison [default: mis]
        sampling: Option<Strategy>, option(value_enum), applies(SAMPLED);
        /// Compensate for energy lost to multiple scattering between microfacets (Turquin 2019)
        energy_compensation: bool, option(), applies(LIGHT);
        /// Albedo of all surfaces with --integrator ao-sky [default: 0.5]
        sky_albedo: Option<f64>, option(value_name = "X", value_parser = parse_albedo, allow_hyphen_values = true), applies(SKY);
        /// Denoise the final image (biased): oidn, filter, or auto (oidn if it is installed). An .exr keeps the noisy image as noisy.R, noisy.G, noisy.B
        /// [default: off; without METHOD: auto]
        denoise: Option<DenoiseChoice>,
            option(value_name = "METHOD", value_enum, num_args = 0..=1, require_equals = false, default_missing_value = "auto"), applies(LIGHT);
        /// Pixel reconstruction filter, by importance sampling [default: box]
        pixel_filter: Option<PixelFilter>, option(value_enum), applies(CAMERA);
        /// Texture filter of paths [default: bilinear]
        texture_filter: Option<TextureFilter>, option(value_enum), applies(TEXTURES);
        /// f-number of a thin lens with a 36x24 mm sensor; scene units are taken as metres [default: a pinhole]
        f_number: Option<f64>,
            option(value_name = "N", value_parser = parse_positive, requires = "focus_distance", allow_hyphen_values = true), applies(CAMERA);
        /// Focus distance along the view, in scene units
        focus_distance: Option<f64>,
            option(value_name = "D", value_parser = parse_positive, requires = "f_number", allow_hyphen_values = true), applies(CAMERA);
    }
}

/// Longest path, bounces. Russian roulette (`MAX_SURVIVAL` in shaders/path/path.glsl) ends paths long before.
pub const MOST_DEPTH: u32 = 4096;

/// Grey of `ao-sky`.
const SKY_ALBEDO: f64 = 0.5;
/// Height of the sensor that an f-number is about, metres.
const SENSOR_HEIGHT: f64 = 0.024;

choices! {
    /// How directions are sampled. All strategies estimate the same image; all but the first are for comparison.
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
    /// World units.
    pub radius: f32,
    /// Distance along the view at which the image is sharp, world units.
    pub focus: f32,
}

/// What to render.
#[derive(Clone, Debug)]
pub struct PathOptions {
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Paths per pixel.
    pub spp: u32,
    /// Of the sampler.
    pub seed: u32,
    /// Bounces at most: 0 shows what emits, 1 adds direct light. [`MOST_DEPTH`] is the limit, which nobody reaches.
    pub max_depth: u32,
    /// Paths of fewer bounces add nothing: 1 leaves out what emits, 2 direct light as well.
    pub min_depth: u32,
    /// Bounces before Russian roulette.
    pub rr_depth: u32,
    /// No path vertex but the first adds more than this radiance in any channel; infinite: unbiased.
    pub firefly_clamp: f32,
    /// How directions are sampled.
    pub strategy: Strategy,
    /// Paths go on by delta lobes alone, so that light samples bring all other light: with [`Strategy::Light`].
    pub specular_only: bool,
    /// Every surface is diffuse and of this grey, and nothing shines but a white sky: the rendering equation that ambient occlusion
    /// approximates.
    pub white_sky: Option<f32>,
    /// No light, but what camera rays see. Misses count 0.
    pub view: Option<View>,
    /// What a pixel is the mean of.
    pub pixel_filter: PixelFilter,
    /// How textures are read; [`TextureFilter::RayCone`] asks for [`crate::tracer::Needs::mip_levels`].
    pub texture_filter: TextureFilter,
    /// A perspective camera's; without it a pinhole.
    pub lens: Option<Lens>,
    /// Stop after this time with what there is.
    pub time_limit: Option<Duration>,
    /// Which tiles of the image show anything; only where the environment is black and [`PathOptions::is_sharp`].
    pub tile_mask: Option<Arc<TileMask>>,
    /// What the film starts from, and where it stops on its way.
    pub film: FilmOptions,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self {
            size: [1280, 720],
            spp: 16,
            seed: 0,
            max_depth: MOST_DEPTH,
            min_depth: 0,
            rr_depth: 5,
            firefly_clamp: f32::INFINITY,
            strategy: Strategy::Mis,
            specular_only: false,
            white_sky: None,
            view: None,
            pixel_filter: PixelFilter::Box,
            texture_filter: TextureFilter::Bilinear,
            lens: None,
            time_limit: None,
            tile_mask: None,
            film: FilmOptions::default(),
        }
    }
}

impl PathSettings {
    /// Albedo of `ao-sky`.
    pub(super) fn sky_albedo(&self) -> f32 {
        self.sky_albedo.unwrap_or(SKY_ALBEDO) as f32
    }

    /// The lens that is described, if any.
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
    /// Those of a shot's settings: of light, by all that finds it.
    pub(super) fn new(shot: &Shot) -> Result<Self> {
        let (settings, default) = (&shot.settings.path, Self::default());
        Ok(Self {
            size: shot.size,
            spp: shot.spp,
            seed: shot.seed,
            max_depth: settings.max_depth.or(shot.scene.hints.max_depth).unwrap_or(MOST_DEPTH),
            min_depth: settings.min_depth.unwrap_or(default.min_depth),
            rr_depth: settings.rr_depth.unwrap_or(default.rr_depth),
            firefly_clamp: settings.firefly_clamp.map_or(f32::INFINITY, |c| c as f32),
            strategy: settings.sampling.unwrap_or_default(),
            pixel_filter: settings.pixel_filter.unwrap_or_default(),
            texture_filter: settings.texture_filter.unwrap_or_default(),
            lens: settings.lens(shot.camera.projection)?,
            time_limit: shot.time_limit,
            film: shot.film.clone(),
            ..default
        })
    }

    /// What the samples of an image depend on: keys of its metadata, and values. `None`: not in the metadata.
    pub(super) fn identity(&self) -> Vec<(&'static str, Option<String>)> {
        // no `..`: a new option has to be put where it belongs
        let Self {
            size: _,
            spp: _,
            time_limit: _,
            tile_mask: _,
            film: _,
            seed: _,
            max_depth,
            min_depth,
            rr_depth,
            firefly_clamp,
            strategy,
            white_sky,
            view: _,
            specular_only: _,
            pixel_filter,
            texture_filter,
            lens,
        } = self;
        vec![
            ("max_depth", Some(depth_text(*max_depth))),
            ("min_depth", (*min_depth > 0).then(|| min_depth.to_string())),
            ("rr_depth", Some(rr_depth.to_string())),
            ("sampling", Some(strategy.to_string())),
            ("firefly_clamp", firefly_clamp.is_finite().then(|| firefly_clamp.to_string())),
            ("pixel_filter", (*pixel_filter != PixelFilter::Box).then(|| pixel_filter.to_string())),
            ("texture_filter", (*texture_filter != TextureFilter::Bilinear).then(|| texture_filter.to_string())),
            ("lens", lens.map(|lens| format!("radius {}, focus {}", lens.radius, lens.focus))),
            ("sky_albedo", white_sky.map(|albedo| albedo.to_string())),
        ]
    }

    /// What of shaders the options decide, whatever the scene.
    pub(super) fn features(&self) -> Vec<(PathFeature, bool)> {
        vec![
            (PathFeature::CosineSampling, self.strategy == Strategy::Cosine),
            (PathFeature::UniformSampling, self.strategy == Strategy::Uniform),
            (PathFeature::SpecularOnly, self.specular_only),
            (PathFeature::ConstantAlbedo, self.white_sky.is_some()),
            (PathFeature::View, self.view.is_some()),
            (PathFeature::MinDepth, self.min_depth > 0),
            (PathFeature::Clamp, self.firefly_clamp.is_finite()),
            (PathFeature::Lens, self.lens.is_some_and(|l| l.radius > 0.0)),
            (PathFeature::PixelFilter, self.pixel_filter != PixelFilter::Box),
        ]
    }

    /// Bounces at most.
    pub(super) fn bounces(&self) -> u32 {
        if self.view.is_some() { 0 } else { self.max_depth.min(MOST_DEPTH) }
    }

    /// What of them shaders read.
    pub(super) fn params(&self) -> PathParams {
        PathParams {
            max_depth: self.bounces(),
            view: self.view.map_or(0, |v| v as u32),
            min_depth: self.min_depth,
            rr_depth: self.rr_depth,
            clamp_to: self.firefly_clamp,
            albedo: self.white_sky.unwrap_or(0.0),
            lens_radius: self.lens.map_or(0.0, |l| l.radius),
            focus: self.lens.map_or(1.0, |l| l.focus),
            pixel_filter: self.pixel_filter as u32,
            ..Default::default()
        }
    }

    /// What a user should know of an image that was rendered with them.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.firefly_clamp.is_finite() {
            remarks.push(format!("indirect radiance clamped to {}: biased, too dark", self.firefly_clamp));
        }
        if self.texture_filter == TextureFilter::RayCone {
            remarks.push("textures filtered by ray cones: blurred, however many samples (biased)".into());
        }
        remarks
    }

    /// Their part of `--json`.
    pub(super) fn record(&self) -> Value {
        json!({
            "max_depth": if self.max_depth >= MOST_DEPTH { Value::Null } else { json!(self.max_depth) },
            "min_depth": self.min_depth,
            "rr_depth": self.rr_depth,
            "firefly_clamp": if self.firefly_clamp.is_finite() { json!(self.firefly_clamp) } else { Value::Null },
            "sampling": self.strategy,
            "view": self.view,
            "texture_filter": self.texture_filter,
            "sky_albedo": self.white_sky,
        })
    }

    /// Does every pixel see nothing but what projects into it?
    pub fn is_sharp(&self) -> bool {
        self.pixel_filter == PixelFilter::Box && self.lens.is_none()
    }
}

/// A limit of bounces in words.
pub(super) fn depth_text(max_depth: u32) -> String {
    if max_depth >= MOST_DEPTH { "unlimited".into() } else { max_depth.to_string() }
}
