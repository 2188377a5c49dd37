//! Settings of path tracing, and of the integrators that are made of it.

use super::{PixelFilter, Strategy, TextureFilter};
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
