//! Settings of the real-time pipeline, and presets.

use crate::error::{Error, Result};
use crate::gpu::{DeviceInfo, Specialization};
use crate::integrators::ao::Occlusion;
use crate::integrators::path::PathOptions;
pub use crate::interface::Resolution;
use crate::interface::constants;
use crate::interface::records::passes::FilterParams;
use crate::raster::Primary;
use crate::sampling::Sequence;
use crate::settings::choices;
use crate::tracer::stream::launch_rays;

choices! {
    /// How a pixel's ambient visibility is estimated.
    pub enum Technique {
        /// Ray-traced ambient occlusion
        Traced = "traced",
        /// Screen-space ground-truth AO (Jimenez et al. 2016)
        Gtao = "gtao",
        /// The pipeline of Larsen (2019)
        Larsen = "larsen",
    }
}

impl Resolution {
    /// Number of frames after which every pixel has been sampled once.
    pub fn period(self) -> u32 {
        1 << self as u32
    }

    /// Size of the image of sampled pixels, for an image of `size`: one pixel of each cell.
    pub fn sampled_size(self, size: [u32; 2]) -> [u32; 2] {
        let cell = match self {
            Self::Full => [1, 1],
            Self::Checkerboard => [2, 1],
            Self::Half => [2, 2],
        };
        [0, 1].map(|k| size[k].div_ceil(cell[k]))
    }
}

choices! {
    /// Spatial filter of a frame. Its radius follows from how many samples a pixel has.
    pub enum FilterKind (default Box) {
        /// No spatial filter
        None = "none",
        /// Edge-aware box filter; fewer samples, larger radius
        Box = "box",
        /// Edge-aware a-trous filter
        Atrous = "atrous",
    }
}

/// A step of a filter: a box, with a distance between taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilterStep {
    /// Maximum number of taps to each side.
    pub radius: u32,
    /// Distance between taps, in pixels.
    pub stride: u32,
}

impl FilterStep {
    /// Parameters for shaders; all other fields are 0.
    pub fn params(&self) -> FilterParams {
        FilterParams { stride: self.stride, radius: self.radius, ..Default::default() }
    }
}

/// Settings of the spatial filter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Filter {
    /// Kind of filter.
    pub kind: FilterKind,
    /// Maximum radius, in pixels.
    pub radius: u32,
    /// Samples that a filtered pixel should average: the box grows until it holds this many.
    pub samples: f32,
}

impl Filter {
    /// Constants of the filter's shader that its steps share.
    pub fn specialization(&self) -> Specialization {
        Specialization::default().set(constants::FILTER_STRIDES, self.steps().iter().any(|s| s.stride > 1))
    }

    /// Steps of the filter, at least one, because the last one converts estimates to the result.
    pub fn steps(&self) -> Vec<FilterStep> {
        let step = |radius, stride| FilterStep { radius, stride };
        match self.kind {
            FilterKind::None => vec![step(0, 1)],
            FilterKind::Box => vec![step(self.radius, 1)],
            FilterKind::Atrous => {
                // 1, 1 + 2, 1 + 2 + 4, ... pixels
                let levels = (self.radius + 1).max(2).ilog2();
                (0..levels).map(|k| step(self.radius.min(1), 1 << k)).collect()
            }
        }
    }
}

/// Constants of the screen-space technique, as XeGTAO (Intel 2021) has them. They make up for what
/// a depth image and a few steps cannot know.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct GtaoConstants {
    /// Factor of the distances at which geometry occludes, above 0.
    pub radius_scale: f32,
    /// Share of the radius over which occlusion fades out before it, above 0, at most 1.
    pub fade: f32,
    /// Exponent of the distances of steps: 1 spaces them evenly, more brings them closer.
    pub step_exponent: f32,
    /// Factor of distances along the view beyond 1: hits far behind or before occlude less.
    pub thinness: f32,
    /// Exponent of the ambient visibility.
    pub visibility_exponent: f32,
}

impl GtaoConstants {
    /// The formula of Jimenez et al. (2016), for images with all occluders and many steps.
    pub const FORMULA: Self =
        Self { radius_scale: 1.0, fade: 0.2, step_exponent: 2.0, thinness: 0.0, visibility_exponent: 1.0 };
    /// Constants of the presets, as `benches/studies/tune_gtao.rs` fitted them.
    pub const PRESETS: Self =
        Self { radius_scale: 2.0125, fade: 0.7625, step_exponent: 1.1875, thinness: 0.0, visibility_exponent: 1.375 };
}

/// Settings of the real-time pipeline.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// AO technique. Settings below are for ray-traced AO; but for rays, also for screen space.
    pub technique: Technique,
    /// Primary visibility; `None`: the faster one on the device ([`Primary::auto`]).
    pub primary: Option<Primary>,
    /// Occlusion rays of each pixel that is sampled in a frame, 1 to [`Settings::MAX_RAYS`].
    pub rays_per_pixel: u32,
    /// Pattern of pixels that are sampled in a frame.
    pub resolution: Resolution,
    /// Sampler of ray directions.
    pub sequence: Sequence,
    /// Seed of the sampler.
    pub seed: u32,
    /// Which hits occlude.
    #[serde(flatten)]
    pub occlusion: Occlusion,
    /// Maximum history length, in frames; 1 disables temporal accumulation.
    pub history: u32,
    /// Stop tracing rays for pixels whose history is full while nothing moves.
    pub rest: bool,
    /// Half width of history clamping near moving objects, in standard errors of the mean; 0: off.
    pub clamp: f32,
    /// Strength with which moving objects shorten histories; 0: off.
    pub moved_weight: f32,
    /// Spatial filter.
    pub filter: Filter,
    /// Screen-space technique: number of slices through the view ray, and of steps on each side.
    pub gtao: [u32; 2],
    /// Screen-space technique: its constants.
    pub gtao_constants: GtaoConstants,
    /// Larsen's pipeline: scene units per unit of length in the paper.
    pub unit: f64,
    /// Sample positions in pixels change from frame to frame, and averaging antialiases edges.
    pub antialias: bool,
    /// At rest the image converges to the still: the mean of all samples at rest takes over.
    pub converge: bool,
    /// Samples per pixel at rest after which a converging image counts as converged.
    pub rest_samples: u32,
    /// Radiance at rest: bounces before Russian roulette may end paths, if more than in motion.
    pub rest_rr_depth: u32,
    /// Also compute bent normals: the mean unoccluded direction.
    pub bent: bool,
    /// Ambient visibility: the material of a ground that catches occlusion, and is else not seen
    /// ([`crate::scene::Scene::catcher`]). Of radiance it is that of the paths' options.
    #[serde(skip)]
    pub catcher: Option<u32>,
    /// Maximum rays of a launch, if fewer than the device's
    /// ([`crate::tracer::stream::launch_rays`]). Frames of small launches can be interrupted soon
    /// ([`super::Realtime::frame_with`]); images do not depend on it.
    #[serde(skip)]
    pub launch_rays: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Preset::Balanced.settings()
    }
}

impl Settings {
    /// Maximum rays per pixel and frame.
    pub const MAX_RAYS: u32 = 4096;
    /// Maximum history length in samples, up to which half floats represent all integers.
    pub const MAX_SAMPLES: u32 = 2048;

    /// Minimum of [`Settings::rest_samples`] for radiance, which is noisier.
    pub const RADIANCE_REST_SAMPLES: u32 = 4096;

    /// Returns true if the image converges at rest.
    pub fn converges(&self) -> bool {
        self.converge && self.history > 1 && self.technique == Technique::Traced
    }

    /// Positions within a pixel that antialiasing averages at rest, in as many frames.
    const PLACES: u32 = 64;

    /// Number of frames at rest after which the image no longer changes, if there is one.
    pub fn frames_to_rest(&self) -> Option<u32> {
        let period = self.resolution.period();
        if self.converges() {
            Some(self.rest_samples.div_ceil(self.rays_per_pixel) * period)
        } else if self.antialias && self.rest && self.history > 1 {
            Some(self.history.min(Self::MAX_SAMPLES) * period + Self::PLACES)
        } else {
            None
        }
    }

    /// Maximum history length, in samples.
    pub fn most_samples(&self) -> u32 {
        (self.history.saturating_mul(self.rays_per_pixel)).min(Self::MAX_SAMPLES).max(self.rays_per_pixel)
    }

    /// Checks that the settings are in their ranges and fit together.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the first that is not.
    pub fn check(&self) -> Result<()> {
        let wrong = |what: &str| Err(Error::Usage(what.to_owned()));
        if !(1..=Self::MAX_RAYS).contains(&self.rays_per_pixel) {
            return wrong(&format!("rays per pixel must be 1 to {}", Self::MAX_RAYS));
        }
        if self.history == 0 {
            return wrong("the history must be at least 1 frame (1 = no temporal accumulation)");
        }
        let Occlusion { radius, falloff, .. } = self.occlusion;
        let good = radius > 0.0 && falloff >= 1.0 && falloff.is_finite();
        if !good {
            return wrong("the radius must be above 0, and the falloff at least 1 (1 = binary) and finite");
        }
        if !(self.clamp >= 0.0 && self.moved_weight >= 0.0 && self.filter.samples >= 0.0) {
            return wrong("clamp, moved weight and filter samples must not be negative");
        }
        if self.antialias && self.technique == Technique::Larsen {
            return wrong(
                "--preset larsen has one sample place in a pixel: leave antialiasing out, or choose another preset",
            );
        }
        if self.catcher.is_some() && self.technique == Technique::Larsen {
            return wrong("--preset larsen has no ground that catches occlusion: choose another preset, or a plane");
        }
        if self.bent && self.technique != Technique::Traced {
            return wrong("bent normals need traced directions: choose --technique traced");
        }
        Ok(())
    }
}

impl Settings {
    /// Constants of shaders that treat a ground that catches occlusion by itself.
    pub fn catcher_constants(&self) -> Specialization {
        Specialization::default().set(constants::HAS_CATCHER, self.catcher.is_some())
    }

    /// The settings with launches no larger than a device takes.
    pub(super) fn with_launches_of(&self, info: &DeviceInfo) -> Self {
        Self { launch_rays: self.launch_rays.min(launch_rays(info)), ..*self }
    }

    /// Checks that the settings fit frames of radiance.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the first that does not.
    pub fn check_radiance(&self) -> Result<()> {
        let wrong = |what: &str| {
            Err(Error::Usage(format!("{what} is for ambient occlusion: leave it out, or use --integrator ao")))
        };
        match self {
            Settings { technique: Technique::Gtao, .. } => wrong("--technique gtao"),
            Settings { technique: Technique::Larsen, .. } => wrong("--preset larsen"),
            Settings { primary: Some(Primary::Raster), .. } => wrong("--primary raster"),
            Settings { bent: true, .. } => wrong("the bent normal"),
            _ => Ok(()),
        }
    }
}

choices! {
    /// Settings by name.
    pub enum Preset (default Balanced) {
        /// The pipeline of Larsen (2019): half resolution, 64 rays, box filter, history weight 0.5
        Larsen = "larsen",
        /// The same ray budget, with correct sampling, reprojection and filter
        LarsenFixed = "larsen-fixed",
        /// 1 ray per pixel, short history, small filter
        Fast = "fast",
        /// 1 ray per pixel, long history
        Balanced = "balanced",
        /// 4 rays per pixel, longer history, wider filter
        Quality = "quality",
        /// 1024 rays per pixel, no history
        Reference = "reference",
    }
}

impl Preset {
    /// Whether a renderer's frames are antialiased by default, which lowers their error
    /// (docs/design/real-time.md). [`Preset::settings`] samples pixel centres, to measure the
    /// pipeline alone.
    pub fn antialiases(self) -> bool {
        matches!(self, Self::Fast | Self::Balanced | Self::Quality)
    }

    /// Default number of bounces before Russian roulette may end a path. With `fast` it may end at
    /// the first: that halves the time of rays, and the filter takes away more noise than it adds.
    pub fn rr_depth(self) -> u32 {
        if self == Self::Fast { 1 } else { PathOptions::default().rr_depth }
    }

    /// The settings of the preset.
    pub fn settings(self) -> Settings {
        // Settings that presets share.
        let common = Settings {
            technique: Technique::Traced,
            primary: None,
            rays_per_pixel: 1,
            resolution: Resolution::Full,
            sequence: Sequence::Sobol,
            seed: 0,
            occlusion: Occlusion::default(),
            history: 32,
            rest: true,
            clamp: 2.0,
            moved_weight: 4.0,
            filter: Filter { kind: FilterKind::Box, radius: 3, samples: 256.0 },
            gtao: [3, 6],
            gtao_constants: GtaoConstants::PRESETS,
            unit: 1.0,
            antialias: false,
            converge: false,
            rest_samples: 256,
            rest_rr_depth: PathOptions::default().rr_depth,
            bent: false,
            catcher: None,
            launch_rays: u32::MAX,
        };

        // Each preset's own; the paper traces closest hits up to 100 units, whatever the falloff.
        match self {
            Preset::Larsen => Settings {
                technique: Technique::Larsen,
                rays_per_pixel: 64,
                resolution: Resolution::Half,
                occlusion: Occlusion::new(f64::INFINITY, 8.0),
                ..common
            },
            Preset::LarsenFixed => Settings {
                rays_per_pixel: 64,
                resolution: Resolution::Half,
                history: 8,
                filter: Filter { radius: 1, ..common.filter },
                ..common
            },
            Preset::Reference => Settings {
                rays_per_pixel: 1024,
                history: 1,
                sequence: Sequence::Sobol,
                filter: Filter { kind: FilterKind::None, ..common.filter },
                ..common
            },
            Preset::Fast => Settings { filter: Filter { radius: 2, samples: 128.0, ..common.filter }, ..common },
            Preset::Balanced => Settings { history: 64, ..common },
            Preset::Quality => Settings {
                rays_per_pixel: 4,
                history: 128,
                rest_samples: 768,
                filter: Filter { radius: 4, samples: 1024.0, ..common.filter },
                ..common
            },
        }
    }
}
