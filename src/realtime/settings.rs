//! How the frames of a real-time renderer are made, and the presets that people choose from.

use crate::error::{Error, Result};
use crate::integrators::ao::{Attenuation, Hemisphere};
pub use crate::interface::Resolution;
use crate::interface::records::frame::{STEP_HORIZONTAL, STEP_VERTICAL};
use crate::interface::records::passes::FilterParams;
use crate::raster::Primary;
use crate::sampling::Sequence;
use crate::settings::choices;

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
    /// Frames after which every pixel was sampled.
    pub fn period(self) -> u32 {
        1 << self as u32
    }
}

choices! {
    /// How the rays of a frame are distributed over its pixels.
    pub enum Budget {
        /// The same number for every pixel
        Uniform = "uniform",
        /// The same total, in proportion to the standard error of pixels
        Variance = "variance",
    }
}

choices! {
    /// Spatial filter of a frame. Its radius follows from how many samples a pixel has.
    pub enum FilterKind (default Box) {
        /// No spatial filter
        None = "none",
        /// Edge-aware box filter; fewer samples, larger radius
        Box = "box",
        /// Edge-aware box filter, separable
        Separable = "separable",
        /// Edge-aware a-trous filter
        Atrous = "atrous",
    }
}

/// A step of a filter: half sides of its box in taps, and their distance in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilterStep {
    /// Along rows, along columns.
    pub sides: [bool; 2],
    /// Taps to each side at most.
    pub radius: u32,
    /// Pixels from tap to tap.
    pub stride: u32,
}

impl FilterStep {
    /// What shaders are told of it, everything else 0.
    pub fn params(&self) -> FilterParams {
        let [along_rows, along_columns] = self.sides;
        FilterParams {
            sides: if along_rows { STEP_HORIZONTAL } else { 0 } | if along_columns { STEP_VERTICAL } else { 0 },
            stride: self.stride,
            radius: self.radius,
            ..Default::default()
        }
    }
}

/// How frames are filtered.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Filter {
    /// How.
    pub kind: FilterKind,
    /// Pixels; the box grows no further.
    pub radius: u32,
    /// Samples that a filtered pixel should rest on: the box grows until it holds so many.
    pub samples: f32,
}

impl Filter {
    /// What is done one after the other. There is one step at least: it turns estimates into what is shown.
    pub fn steps(&self) -> Vec<FilterStep> {
        let step = |sides, radius, stride| FilterStep { sides, radius, stride };
        match self.kind {
            FilterKind::None => vec![step([true, true], 0, 1)],
            FilterKind::Box => vec![step([true, true], self.radius, 1)],
            FilterKind::Separable => vec![step([true, false], self.radius, 1), step([false, true], self.radius, 1)],
            FilterKind::Atrous => {
                // 1, 1 + 2, 1 + 2 + 4, ... pixels
                let levels = (self.radius + 1).max(2).ilog2();
                (0..levels).map(|k| step([true, true], self.radius.min(1), 1 << k)).collect()
            }
        }
    }
}

/// How frames are made.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Where occlusion comes from. What follows is of the traced one, and but for rays of the screen-space one.
    pub technique: Technique,
    /// How it is found what pixels show; `None`: what costs less ([`Primary::auto`]).
    pub primary: Option<Primary>,
    /// Rays of a pixel that is sampled in a frame; 1 to [`Settings::MAX_RAYS`].
    pub rays_per_pixel: u32,
    /// Whose they are: so many on average, or each pixel's own.
    pub budget: Budget,
    /// Which pixels are.
    pub resolution: Resolution,
    /// Where their directions come from.
    pub sequence: Sequence,
    /// Of the sequence.
    pub seed: u32,
    /// World units beyond which nothing occludes; infinite for no limit.
    pub radius: f64,
    /// c: a hit at distance d counts c^-d; 1 counts every hit alike.
    pub falloff: f64,
    /// Axis of the hemisphere.
    #[serde(skip)]
    pub hemisphere: Hemisphere,
    /// Frames that a history counts at most; 1: none is kept.
    pub history: u32,
    /// Pixels with a full history get no more rays while nothing moves.
    pub rest: bool,
    /// Where things move: standard errors by which a history may differ from its surroundings; 0: by any.
    pub clamp: f32,
    /// Where things move: how much that shortens histories; 0: not.
    pub moved_weight: f32,
    /// Over pixels.
    pub filter: Filter,
    /// Of the screen-space technique: slices through the view ray, and steps on each side of one.
    pub gtao: [u32; 2],
    /// Of the reference work's pipeline: world units that one of its own is.
    pub unit: f64,
    /// Bent normals besides: the mean direction in which a point is open.
    pub bent: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Preset::Balanced.settings()
    }
}

impl Settings {
    /// Rays of a pixel in a frame at most.
    pub const MAX_RAYS: u32 = 4096;
    /// With a budget: rays of a pixel in a frame at most, times those that it has on average.
    pub const MAX_SHARE: u32 = 4;
    /// With a budget: rays of a pixel in a frame on average at most. Four bits count them.
    const MAX_BUDGET: u32 = 4;
    /// Samples that a history counts at most: as many as half floats count one by one.
    pub const MAX_SAMPLES: u32 = 2048;

    /// How far hits occlude, and how much.
    pub fn attenuation(&self) -> Attenuation {
        Attenuation { radius: self.radius, falloff: self.falloff }
    }

    /// Samples that a history counts at most.
    pub fn most_samples(&self) -> u32 {
        (self.history.saturating_mul(self.rays_per_pixel)).min(Self::MAX_SAMPLES).max(self.rays_per_pixel)
    }

    /// Rays of a pixel in a frame at most, where a budget distributes them; else 0.
    pub fn most_rays(&self) -> u32 {
        if self.budget == Budget::Variance { Self::MAX_SHARE * self.rays_per_pixel } else { 0 }
    }

    /// Are the numbers in their ranges?
    ///
    /// # Errors
    /// [`Error::Usage`], naming the first that is not.
    pub fn check(&self) -> Result<()> {
        let wrong = |what: &str| Err(Error::Usage(what.to_owned()));
        if !(1..=Self::MAX_RAYS).contains(&self.rays_per_pixel) {
            return wrong(&format!("rays per pixel must be 1 to {}", Self::MAX_RAYS));
        }
        if self.budget == Budget::Variance
            && (self.rays_per_pixel > Self::MAX_BUDGET || self.history < 2 || self.technique != Technique::Traced)
        {
            return wrong(&format!(
                "a budget by variance needs traced rays, a history, and 1 to {} rays per pixel",
                Self::MAX_BUDGET
            ));
        }
        if self.history == 0 {
            return wrong("a history of 0 frames: 1 keeps none");
        }
        let good = self.radius > 0.0 && self.falloff >= 1.0 && self.falloff.is_finite();
        if !good {
            return wrong("the radius must be above 0, and the falloff at least 1 (1 = binary) and finite");
        }
        if !(self.clamp >= 0.0 && self.moved_weight >= 0.0 && self.filter.samples >= 0.0) {
            return wrong("clamp, weight of motion and samples of the filter must not be negative");
        }
        if self.bent && self.technique != Technique::Traced {
            return wrong("bent normals are made of traced directions: choose the technique traced");
        }
        Ok(())
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
    /// What it stands for.
    pub fn settings(self) -> Settings {
        let common = Settings {
            technique: Technique::Traced,
            primary: None,
            rays_per_pixel: 1,
            budget: Budget::Uniform,
            resolution: Resolution::Full,
            sequence: Sequence::Sobol,
            seed: 0,
            radius: f64::INFINITY,
            falloff: 1.0,
            hemisphere: Hemisphere::Geometric,
            history: 32,
            rest: true,
            clamp: 2.0,
            moved_weight: 4.0,
            filter: Filter { kind: FilterKind::Box, radius: 3, samples: 256.0 },
            gtao: [3, 6],
            unit: 1.0,
            bent: false,
        };
        match self {
            // it looks for the nearest hit up to 100 units, whatever the falloff leaves of it
            Preset::Larsen => Settings {
                technique: Technique::Larsen,
                rays_per_pixel: 64,
                resolution: Resolution::Half,
                falloff: 8.0,
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
                filter: Filter { radius: 4, samples: 1024.0, ..common.filter },
                ..common
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_reach_to_the_radius() {
        for kind in FilterKind::ALL {
            for radius in [0, 1, 3, 7, 15] {
                let steps = Filter { kind, radius, samples: 64.0 }.steps();
                let reach = |axis: usize| steps.iter().filter(|s| s.sides[axis]).map(|s| s.radius * s.stride).sum::<u32>();
                let wanted = if kind == FilterKind::None { 0 } else { radius };
                assert_eq!([reach(0), reach(1)], [wanted; 2], "{kind:?} {radius}");
            }
        }
    }

    #[test]
    fn presets_are_sound() {
        for preset in Preset::ALL {
            preset.settings().check().unwrap();
        }
        let wrong = Settings { rays_per_pixel: 0, ..Settings::default() };
        assert_eq!(wrong.check().unwrap_err().exit_code(), 64);
    }
}
