//! Options of `skylit render` that are about paths.

use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};
use glam::{DMat3, Vec3};

use super::denoise::DenoiseChoice;
use crate::cli::args::{Aov, Integrator, RenderArgs};
use crate::error::{Error, Result};
use crate::integrators::path::{PixelFilter, TextureFilter};
use crate::output::tone_map::ToneMap;
use crate::scene::{Environment, load};
use crate::terminal::lights::{self, LightSpec};
use crate::terminal::parse::{parse_number, parse_vector, parse_where};
use crate::terminal::sampling::Sampling;

/// Reconstruction filter of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PixelFilterChoice {
    /// Box filter of one pixel
    Box,
    /// Tent filter of radius 1
    Tent,
    /// Blackman-Harris filter of radius 1.5
    BlackmanHarris,
}

impl From<PixelFilterChoice> for PixelFilter {
    fn from(f: PixelFilterChoice) -> Self {
        match f {
            PixelFilterChoice::Box => PixelFilter::Box,
            PixelFilterChoice::Tent => PixelFilter::Tent,
            PixelFilterChoice::BlackmanHarris => PixelFilter::BlackmanHarris,
        }
    }
}

/// What is read of textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TextureFilterChoice {
    /// Bilinear lookups: the samples of a pixel average them
    Bilinear,
    /// Ray cones choose a mip level: less noise at low sample counts, biased
    RayCone,
}

impl From<TextureFilterChoice> for TextureFilter {
    fn from(f: TextureFilterChoice) -> Self {
        match f {
            TextureFilterChoice::Bilinear => TextureFilter::Bilinear,
            TextureFilterChoice::RayCone => TextureFilter::RayCone,
        }
    }
}

/// How radiance is brought below 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneMapChoice {
    /// Clamp at 1
    Linear,
    /// Exponential, 1 - e^-x
    Exp,
    /// Reinhard, by luminance
    Reinhard,
    /// Khronos PBR Neutral
    Neutral,
    /// AgX
    Agx,
}

impl From<ToneMapChoice> for ToneMap {
    fn from(t: ToneMapChoice) -> Self {
        match t {
            ToneMapChoice::Linear => ToneMap::Linear,
            ToneMapChoice::Exp => ToneMap::Exponential,
            ToneMapChoice::Reinhard => ToneMap::Reinhard,
            ToneMapChoice::Neutral => ToneMap::Neutral,
            ToneMapChoice::Agx => ToneMap::Agx,
        }
    }
}

/// Paths.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Paths (--integrator path, direct, ao-sky; views)")]
pub struct PathArgs {
    /// Maximum path length in bounces: 0 is emitted light, 1 adds direct light [default: the scene's, or no limit; direct: 1]
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Bounces before Russian roulette may end a path [default: 5]
    #[arg(long, value_name = "N")]
    pub rr_depth: Option<u32>,
    /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
    #[arg(long, value_name = "X", value_parser = parse_clamp, allow_hyphen_values = true)]
    pub firefly_clamp: Option<f64>,
    /// Sampling strategy; all but the default are for comparison [default: mis]
    #[arg(long, value_enum)]
    pub sampling: Option<Sampling>,
    /// Environment light: an equirectangular map (.hdr, .exr), or a constant radiance R,G,B [default: the scene's]
    #[arg(long, value_name = "FILE|R,G,B", value_hint = ValueHint::FilePath)]
    pub environment: Option<String>,
    /// Rotate the environment map about the vertical axis by this angle, counter-clockwise from above
    #[arg(long, value_name = "DEG", value_parser = parse_number, requires = "environment", allow_hyphen_values = true)]
    pub environment_turn: Option<f64>,
    /// Factor of the environment's radiance
    #[arg(long, value_name = "X", value_parser = parse_scale, requires = "environment", allow_hyphen_values = true)]
    pub environment_scale: Option<f64>,
    /// Compensate for energy lost to multiple scattering between microfacets (Turquin 2019)
    #[arg(long)]
    pub energy_compensation: bool,
    /// Add a light: point, spot, sun, sphere, rectangle or disk, then key=value: position, direction (in which it emits), radius, size=W,H,
    /// intensity (cd), irradiance (lux) or radiance, color=R,G,B or temperature=K, and outer, inner, angle in degrees. May be repeated
    #[arg(long, value_name = "SPEC", value_parser = lights::parse)]
    pub light: Vec<LightSpec>,
    /// Albedo of all surfaces with --integrator ao-sky [default: 0.5]
    #[arg(long, value_name = "X", value_parser = parse_albedo, allow_hyphen_values = true)]
    pub sky_albedo: Option<f64>,
    /// Denoise the final image (biased): oidn, filter, or auto (oidn if it is installed). An .exr keeps the noisy image as noisy.R, noisy.G, noisy.B
    /// [default: off; without METHOD: auto]
    #[arg(long, value_name = "METHOD", value_enum, num_args = 0..=1, require_equals = false, default_missing_value = "auto")]
    pub denoise: Option<DenoiseChoice>,
    /// Pixel reconstruction filter, by importance sampling [default: box]
    #[arg(long, value_enum)]
    pub pixel_filter: Option<PixelFilterChoice>,
    /// Texture filter of paths [default: bilinear]
    #[arg(long, value_enum)]
    pub texture_filter: Option<TextureFilterChoice>,
    /// f-number of a thin lens with a 36x24 mm sensor; scene units are taken as metres [default: a pinhole]
    #[arg(long, value_name = "N", value_parser = parse_clamp, requires = "focus_distance", allow_hyphen_values = true)]
    pub f_number: Option<f64>,
    /// Focus distance along the view, in scene units
    #[arg(long, value_name = "D", value_parser = parse_clamp, requires = "f_number", allow_hyphen_values = true)]
    pub focus_distance: Option<f64>,
    /// Tone mapping operator of .png outputs [default: linear]
    #[arg(long, value_enum)]
    pub tone_map: Option<ToneMapChoice>,
    /// Exposure of .png outputs, in stops [default: 0]
    #[arg(long, value_name = "EV", value_parser = parse_number, allow_hyphen_values = true)]
    pub exposure: Option<f64>,
}

fn parse_clamp(text: &str) -> std::result::Result<f64, String> {
    parse_where(text, |v| v > 0.0, "must be above 0")
}

fn parse_scale(text: &str) -> std::result::Result<f64, String> {
    parse_where(text, |v| v >= 0.0 && v.is_finite(), "must be finite and not negative")
}

fn parse_albedo(text: &str) -> std::result::Result<f64, String> {
    parse_where(text, |v| v > 0.0 && v <= 1.0, "must be above 0 and at most 1")
}

impl PathArgs {
    /// Checks what concerns more than one option: none may be given that would have no effect.
    pub fn check(&self, args: &RenderArgs) -> Result<()> {
        let of_light = [
            (self.max_depth.is_some(), "--max-depth"),
            (self.rr_depth.is_some(), "--rr-depth"),
            (self.firefly_clamp.is_some(), "--firefly-clamp"),
            (self.sampling.is_some(), "--sampling"),
            (self.energy_compensation, "--energy-compensation"),
            (self.environment.is_some(), "--environment"),
            (!self.light.is_empty(), "--light"),
            (self.denoise.is_some(), "--denoise"),
        ];
        let of_images = [
            (self.exposure.is_some(), "--exposure"),
            (self.tone_map.is_some(), "--tone-map"),
            (self.pixel_filter.is_some(), "--pixel-filter"),
            (self.texture_filter.is_some(), "--texture-filter"),
            (self.f_number.is_some(), "--f-number"),
        ];
        let wrong = |what: String| Err(Error::Usage(what));
        match args.integrator {
            Integrator::Ao => {
                if let Some((_, option)) = of_light.iter().chain(&of_images).find(|o| o.0) {
                    return wrong(format!("{option} is about paths: add --integrator path"));
                }
            }
            integrator => {
                let name = integrator.name();
                if let Some(option) = args.frames.wanted() {
                    return wrong(format!(
                        "{option} is about frames in real time, and --integrator {name} renders stills: leave it out, or use --integrator ao"
                    ));
                }
                let of_occlusion = [
                    (args.ao_radius.is_finite(), "--ao-radius"),
                    (args.ao_falloff.is_some(), "--ao-falloff"),
                    (args.wants(Aov::Bent), "--aov bent"),
                    (args.dump_rays.is_some(), "--dump-rays"),
                ];
                if let Some((_, option)) = of_occlusion.iter().find(|o| o.0) {
                    return wrong(format!(
                        "{option} is about occlusion rays, and --integrator {name} traces none: leave it out, or use --integrator ao"
                    ));
                }
                if integrator == Integrator::Direct && self.max_depth.is_some() {
                    return wrong("--max-depth: --integrator direct has one bounce; use --integrator path".into());
                }
                if integrator == Integrator::AoSky && (self.environment.is_some() || !self.light.is_empty()) {
                    let option = if self.environment.is_some() { "--environment" } else { "--light" };
                    return wrong(format!(
                        "{option}: nothing but a white sky emits light in --integrator ao-sky; leave it out"
                    ));
                }
            }
        }
        // views know nothing of light
        if super::view(args.integrator).is_some()
            && let Some((_, option)) = of_light.iter().find(|o| o.0)
        {
            return wrong(format!("{option}: --integrator {} shows surfaces, not light", args.integrator.name()));
        }
        if self.texture_filter.is_some() && matches!(args.integrator, Integrator::AoSky | Integrator::Depth) {
            return wrong(format!("--texture-filter: --integrator {} reads no textures", args.integrator.name()));
        }
        if self.sky_albedo.is_some() && args.integrator != Integrator::AoSky {
            return wrong("--sky-albedo is of --integrator ao-sky".into());
        }
        Ok(())
    }

    /// The environment that is asked for, instead of the scene's.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read, [`Error::Usage`] for a negative radiance.
    pub fn environment(&self) -> Result<Option<Environment>> {
        let Some(text) = &self.environment else { return Ok(None) };
        let scale = self.environment_scale.unwrap_or(1.0) as f32;
        if let Ok(colour) = parse_vector(text) {
            if colour.min_element() < 0.0 {
                return Err(Error::Usage(format!("--environment {text}: radiance is not negative")));
            }
            return Ok(Some(Environment::Uniform(colour.as_vec3() * scale)));
        }
        let mut map = load::load_environment(&PathBuf::from(text))?;
        map.factor = Vec3::splat(scale);
        map.to_map = DMat3::from_rotation_y(-self.environment_turn.unwrap_or(0.0).to_radians());
        Ok(Some(Environment::Map(map)))
    }
}
