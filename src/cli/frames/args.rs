//! What `render` takes where it makes frames in real time.

use std::path::PathBuf;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum, ValueHint};

use crate::error::{Error, Result};
use crate::output::{apng, frames};
use crate::raster::Primary;
use crate::realtime::display::Shown;
use crate::realtime::{Budget, FilterKind, Preset, Resolution, Settings, Technique};
use crate::sampling::Sequence;

/// Implements clap's enumeration by what a type has already: all values, names and a line of help for each.
macro_rules! choices {
    ($type:ty, $help:expr) => {
        impl ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                &Self::ALL
            }

            fn to_possible_value(&self) -> Option<PossibleValue> {
                let help: fn(&Self) -> &'static str = $help;
                Some(PossibleValue::new(self.name()).help(help(self)))
            }
        }
    };
}

choices!(Preset, |p| match p {
    Preset::Larsen => "The pipeline of Larsen (2019): half resolution, 64 rays, box filter, history weight 0.5",
    Preset::LarsenFixed => "The same ray budget, with correct sampling, reprojection and filter",
    Preset::Fast => "1 ray per pixel, short history, small filter",
    Preset::Balanced => "1 ray per pixel, long history",
    Preset::Quality => "4 rays per pixel, longer history, wider filter",
    Preset::Reference => "1024 rays per pixel, no history",
});
choices!(Technique, |t| match t {
    Technique::Traced => "Ray-traced ambient occlusion",
    Technique::Gtao => "Screen-space ground-truth AO (Jimenez et al. 2016)",
    Technique::Larsen => "The pipeline of Larsen (2019)",
});
choices!(Resolution, |r| match r {
    Resolution::Full => "Every pixel in every frame",
    Resolution::Checkerboard => "Half of the pixels per frame, alternating",
    Resolution::Half => "A quarter of the pixels per frame: half the resolution per axis",
});
choices!(Sequence, |s| match s {
    Sequence::White => "Independent random numbers",
    Sequence::Stratified => "Jittered on a 4x4 grid",
    Sequence::Sobol => "Owen-scrambled Sobol, one sequence per pixel",
    Sequence::Blue => "Owen-scrambled Sobol over the image: blue-noise error",
    Sequence::R2 => "R2 sequence (Roberts), Cranley-Patterson rotation per pixel",
});
choices!(Budget, |b| match b {
    Budget::Uniform => "The same number for every pixel",
    Budget::Variance => "The same total, in proportion to the standard error of pixels",
});
choices!(FilterKind, |f| match f {
    FilterKind::None => "No spatial filter",
    FilterKind::Box => "Edge-aware box filter; fewer samples, larger radius",
    FilterKind::Separable => "Edge-aware box filter, separable",
    FilterKind::Atrous => "Edge-aware a-trous filter",
});
choices!(Shown, |s| match s {
    Shown::Accessibility => "The filtered result",
    Shown::Unfiltered => "The input of the spatial filter",
    Shown::Samples => "Accumulated samples; white: maximum history length",
    Shown::Variance => "Variance of one sample; white: 0.25",
    Shown::Depth => "Depth along the view; white is near",
    Shown::Normal => "Geometric normal, -1 to 1 mapped to 0 to 1",
    Shown::Position => "World position, repeating every quarter of the scene",
    Shown::Bent => "Bent normal, -1 to 1 mapped to 0 to 1",
});

/// Primary visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PrimaryChoice {
    /// Whichever is faster on the device
    #[default]
    Auto,
    /// Ray traced
    Traced,
    /// Rasterized
    Raster,
}

/// Frames from the first to the one before the last: `A..B`; a number is one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// The first.
    pub first: u32,
    /// One more than the last.
    pub end: u32,
}

fn parse_frames(text: &str) -> std::result::Result<FrameRange, String> {
    const EXPECTED: &str = "expected A..B, frames A to B - 1, like 0..60";
    let number = |s: &str| s.trim().parse::<u32>().map_err(|_| EXPECTED.to_owned());
    let range = match text.split_once("..") {
        Some((a, b)) => FrameRange { first: number(a)?, end: number(b)? },
        None => {
            let first = number(text)?;
            FrameRange { first, end: first.checked_add(1).ok_or(EXPECTED)? }
        }
    };
    if range.end <= range.first { Err(format!("{text} has no frames: {EXPECTED}")) } else { Ok(range) }
}

fn parse_rate(text: &str) -> std::result::Result<f64, String> {
    let rate = text.trim().parse::<f64>().ok().filter(|r| *r >= 0.01 && *r <= 1000.0);
    rate.ok_or_else(|| "must be between 0.01 and 1000 frames a second".to_owned())
}

/// Frames in real time.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Frames in real time")]
pub struct FrameArgs {
    /// Render with the real-time pipeline and these settings
    #[arg(long, value_enum)]
    pub preset: Option<Preset>,
    /// Render frames A to B - 1 [default: one frame, after warm-up]
    #[arg(long, value_name = "A..B", value_parser = parse_frames)]
    pub frames: Option<FrameRange>,
    /// Frames per second [default: the camera path's, or 30]
    #[arg(long, value_name = "N", value_parser = parse_rate)]
    pub fps: Option<f64>,
    /// Play an animation of the scene, by index or name [default: the first]
    #[arg(long, value_name = "INDEX|NAME", num_args = 0..=1, default_missing_value = "0")]
    pub animate: Option<String>,
    /// Animate the camera along the key frames of a file (docs/sequences.md)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with_all = ["orbit", "eye", "camera", "fov_y"])]
    pub camera_path: Option<PathBuf>,
    /// Orbit the camera around the centre of the scene, one turn in this many frames
    #[arg(long, value_name = "FRAMES", num_args = 0..=1, default_missing_value = "240", value_parser = clap::value_parser!(u32).range(1..))]
    pub orbit: Option<u32>,
    /// Warm-up frames, identical to the first, that are rendered and discarded [default: 0; for a single frame, the history length]
    #[arg(long, value_name = "N")]
    pub warm_up: Option<u32>,
    /// AO technique [default: the preset's]
    #[arg(long, value_enum)]
    pub technique: Option<Technique>,
    /// Primary visibility: rasterized or ray traced
    #[arg(long, value_enum, default_value = "auto")]
    pub primary: PrimaryChoice,
    /// Occlusion rays per pixel and frame [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_RAYS)))]
    pub rays_per_pixel: Option<u32>,
    /// How rays are distributed over pixels (docs/realtime.md)
    #[arg(long, value_enum, default_value = "uniform")]
    pub budget: Budget,
    /// Resolution of ray tracing per frame [default: the preset's]
    #[arg(long, value_enum)]
    pub resolution: Option<Resolution>,
    /// Sampler of ray directions [default: the preset's]
    #[arg(long, value_enum)]
    pub sequence: Option<Sequence>,
    /// Maximum history length in frames; 1 disables temporal accumulation [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub history: Option<u32>,
    /// Spatial filter [default: the preset's]
    #[arg(long, value_enum)]
    pub filter: Option<FilterKind>,
    /// Maximum filter radius in pixels [default: the preset's]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(0..=16))]
    pub filter_radius: Option<u32>,
    /// What .png and .apng outputs show [default: accessibility]
    #[arg(long, value_name = "NAME", value_enum)]
    pub show: Option<Shown>,
}

impl FrameArgs {
    /// Is anything asked for that only frames have?
    pub fn wanted(&self) -> Option<&'static str> {
        let given = [
            (self.preset.is_some(), "--preset"),
            (self.frames.is_some(), "--frames"),
            (self.fps.is_some(), "--fps"),
            (self.animate.is_some(), "--animate"),
            (self.camera_path.is_some(), "--camera-path"),
            (self.orbit.is_some(), "--orbit"),
            (self.warm_up.is_some(), "--warm-up"),
            (self.technique.is_some(), "--technique"),
            (self.primary != PrimaryChoice::Auto, "--primary"),
            (self.rays_per_pixel.is_some(), "--rays-per-pixel"),
            (self.budget != Budget::Uniform, "--budget"),
            (self.resolution.is_some(), "--resolution"),
            (self.sequence.is_some(), "--sequence"),
            (self.history.is_some(), "--history"),
            (self.filter.is_some(), "--filter"),
            (self.filter_radius.is_some(), "--filter-radius"),
            (self.show.is_some(), "--show"),
        ];
        given.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// The frames that are kept.
    pub fn range(&self) -> FrameRange {
        self.frames.unwrap_or(FrameRange { first: 0, end: 1 })
    }

    /// The preset with what was said otherwise.
    ///
    /// # Errors
    /// [`Error::Usage`] for what has no effect together.
    pub fn settings(&self) -> Result<Settings> {
        let mut s = self.preset.unwrap_or_default().settings();
        let technique = self.technique.unwrap_or(s.technique);
        if technique == Technique::Larsen && s.technique != Technique::Larsen {
            return Err(Error::Usage("--technique larsen is --preset larsen: its settings are its own".into()));
        }
        if s.technique == Technique::Larsen {
            let own = [
                (technique != Technique::Larsen, "--technique"),
                (self.rays_per_pixel.is_some(), "--rays-per-pixel"),
                (self.budget != Budget::Uniform, "--budget"),
                (self.resolution.is_some(), "--resolution"),
                (self.sequence.is_some(), "--sequence"),
                (self.history.is_some(), "--history"),
                (self.filter.is_some(), "--filter"),
                (self.filter_radius.is_some(), "--filter-radius"),
            ];
            if let Some((_, name)) = own.iter().find(|o| o.0) {
                return Err(Error::Usage(format!(
                    "{name} has no effect on --preset larsen: leave it out, or choose another preset"
                )));
            }
        }
        s.technique = technique;
        s.primary = match self.primary {
            PrimaryChoice::Auto => None,
            PrimaryChoice::Traced => Some(Primary::Traced),
            PrimaryChoice::Raster => Some(Primary::Raster),
        };
        s.rays_per_pixel = self.rays_per_pixel.unwrap_or(s.rays_per_pixel);
        s.budget = self.budget;
        s.resolution = self.resolution.unwrap_or(s.resolution);
        s.sequence = self.sequence.unwrap_or(s.sequence);
        s.history = self.history.unwrap_or(s.history);
        s.filter.kind = self.filter.unwrap_or(s.filter.kind);
        s.filter.radius = self.filter_radius.unwrap_or(s.filter.radius);
        Ok(s)
    }

    /// Can each output hold what there is to write?
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_outputs(&self, outputs: &[PathBuf]) -> Result<()> {
        let range = self.range();
        for path in outputs {
            let numbered = frames::is_pattern(path)?;
            if apng::is_apng(path) {
                if numbered {
                    return Err(Error::Usage(format!("{}: an animation holds all frames; leave the # out", path.display())));
                }
            } else if range.end - range.first > 1 && !numbered {
                return Err(Error::Usage(format!(
                    "{}: {} frames need a name with a place for their number, like out.####.exr, or an animation, like out.apng",
                    path.display(),
                    range.end - range.first
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frames() {
        assert_eq!(parse_frames("3..7"), Ok(FrameRange { first: 3, end: 7 }));
        assert_eq!(parse_frames("5"), Ok(FrameRange { first: 5, end: 6 }));
        for bad in ["", "..", "7..3", "3..3", "-1..2", "a..b", "4294967295"] {
            assert!(parse_frames(bad).is_err(), "{bad}");
        }
    }
}
