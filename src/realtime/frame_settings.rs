//! Settings of real-time frames: the range of frames, and the pipeline's settings.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::integrators::ao::settings::AoSettings;
use crate::output::{frames, is_animation};
use crate::raster::Primary;
use crate::realtime::display::DisplayMode;
use crate::realtime::{FilterKind, Preset, Resolution, Settings, Technique};
use crate::sampling::Sequence;
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_playback_time, parse_rate};
use crate::settings::{AppliesTo, Capability, Editable, Value, choices, settings};

/// Settings of real-time frames.
const FRAMES: AppliesTo = AppliesTo::frames_of(Capability::RealTimeFrames);

/// Settings of a time line, of frames in real time or of stills.
const TIMELINE: AppliesTo = AppliesTo::ALL;

choices! {
    /// Primary visibility, as requested.
    pub enum PrimaryChoice {
        /// Whichever is faster on the device
        Auto = "auto",
        /// Ray traced
        Traced = "traced",
        /// Rasterized
        Raster = "raster",
    }
}

choices! {
    /// Antialiasing in time.
    pub enum Antialias {
        /// Samples move within their pixels
        On = "on",
        /// Samples stay at the centres of pixels
        Off = "off",
    }
}

choices! {
    /// What an image does at rest.
    pub enum AtRest {
        /// It converges to the still of the same integrator
        Converge = "converge",
        /// It keeps what the history holds
        Hold = "hold",
    }
}

/// A half-open range of frames, `A..B`; a single number is one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// First frame.
    pub first: u32,
    /// One past the last frame.
    pub end: u32,
}

impl Editable for Option<FrameRange> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

impl serde::Serialize for FrameRange {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}..{}", self.first, self.end))
    }
}

impl<'de> serde::Deserialize<'de> for FrameRange {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        parse_frames(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
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

settings! {
    /// Frames in real time.
    "Frames in real time"
    pub struct FrameSettings {
        /// Render with the real-time pipeline and these settings
        preset: Option<Preset>, option(value_enum), applies(FRAMES), basic;
        /// Render frames A to B - 1; with --spp a still each [default: one frame, after warm-up]
        frames: Option<FrameRange>, option(value_name = "A..B", value_parser = parse_frames), applies(TIMELINE), basic;
        /// Frames per second [default: the camera path's, or 30]
        fps: Option<f64>, option(value_name = "N", value_parser = parse_rate), applies(TIMELINE);
        /// Play an animation of the scene, by index or name [default: the first]
        animate: Option<String>, option(value_name = "INDEX|NAME", num_args = 0..=1, default_missing_value = "0"), applies(TIMELINE);
        /// Hold the animation at this time, in seconds since its start [default: frames play it]
        time: Option<f64>, option(value_name = "SECONDS", value_parser = parse_playback_time), applies(TIMELINE);
        /// Animate the camera along the key frames of a file
        ///
        /// docs/guide/animation.md describes the file.
        camera_path: Option<PathBuf>,
            option(value_name = "FILE", value_hint = clap::ValueHint::FilePath, conflicts_with_all = ["orbit", "eye", "camera", "fov_y"]),
            applies(TIMELINE);
        /// Orbit the camera around the centre of the scene, one revolution in this many frames
        orbit: Option<u32>,
            option(value_name = "FRAMES", num_args = 0..=1, default_missing_value = "240", value_parser = clap::value_parser!(u32).range(1..)),
            applies(TIMELINE), basic;
        /// Warm-up frames that are rendered and discarded [default: for one frame until histories
        /// are full]
        ///
        /// They are identical to the first frame. Sequences have none by default.
        warm_up: Option<u32>, option(value_name = "N"), applies(FRAMES);
        /// Frames before the first that are rendered and discarded [default: 0]
        ///
        /// The sequence then begins as it goes on. An orbit has them before frame 0, too.
        lead_in: Option<u32>, option(value_name = "N"), applies(FRAMES);
        /// AO technique [default: the preset's]
        technique: Option<Technique>, option(value_enum), applies(FRAMES);
        /// Primary visibility: rasterized or ray traced [default: auto]
        primary: Option<PrimaryChoice>, option(value_enum), applies(FRAMES), research;
        /// Occlusion rays, or paths, per pixel and frame [default: the preset's]
        rays_per_pixel: Option<u32>,
            option(value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_RAYS))), applies(FRAMES);
        /// Resolution of ray tracing per frame [default: the preset's]
        resolution: Option<Resolution>, option(value_enum), applies(FRAMES);
        /// Sampler of ray directions [default: the preset's]
        sequence: Option<Sequence>, option(value_enum), applies(FRAMES), research;
        /// Maximum history length in frames; 1 disables temporal accumulation [default: the preset's]
        history: Option<u32>, option(value_name = "N", value_parser = clap::value_parser!(u32).range(1..)), applies(FRAMES);
        /// Spatial filter [default: the preset's]
        filter: Option<FilterKind>, option(value_enum), applies(FRAMES);
        /// Maximum filter radius in pixels [default: the preset's]
        filter_radius: Option<u32>, option(value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(0..=16)), applies(FRAMES), research;
        /// Antialias edges, by samples at other places of pixels in each frame [default: the
        /// preset's]
        antialias: Option<Antialias>, option(value_enum), applies(FRAMES);
        /// What the image does while nothing moves [default: converge if antialiased, and of light]
        at_rest: Option<AtRest>, option(value_enum), applies(FRAMES);
        /// What .png and .apng outputs show [default: result]
        show: Option<DisplayMode>, option(value_name = "NAME", value_enum), applies(FRAMES);
    }
}

impl FrameSettings {
    /// The range of frames that are kept.
    pub fn range(&self) -> FrameRange {
        self.frames.unwrap_or(FrameRange { first: 0, end: 1 })
    }

    /// The animation to play, an index or a name; the first one where only a time is given.
    pub fn animation(&self) -> Option<&str> {
        self.animate.as_deref().or(self.time.map(|_| "0"))
    }

    /// The settings of the pipeline: the preset's, with those given, and `ao`.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings without effect together.
    pub fn settings(&self, ao: &AoSettings, seed: u32) -> Result<Settings> {
        // Larsen's pipeline is a preset as a whole.
        let mut s = self.preset.unwrap_or_default().settings();
        let technique = self.technique.unwrap_or(s.technique);
        if technique == Technique::Larsen && s.technique != Technique::Larsen {
            return Err(Error::Usage("--technique larsen: use --preset larsen, which fixes its settings".into()));
        }
        if s.technique == Technique::Larsen {
            let own = [
                (technique != Technique::Larsen, "--technique"),
                (self.rays_per_pixel.is_some(), "--rays-per-pixel"),
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

        // Settings that are given replace those of the preset.
        s.technique = technique;
        s.primary = match self.primary.unwrap_or_default() {
            PrimaryChoice::Auto => None,
            PrimaryChoice::Traced => Some(Primary::Traced),
            PrimaryChoice::Raster => Some(Primary::Raster),
        };
        s.rays_per_pixel = self.rays_per_pixel.unwrap_or(s.rays_per_pixel);
        s.resolution = self.resolution.unwrap_or(s.resolution);
        s.sequence = self.sequence.unwrap_or(s.sequence);
        s.history = self.history.unwrap_or(s.history);
        s.filter.kind = self.filter.unwrap_or(s.filter.kind);
        s.filter.radius = self.filter_radius.unwrap_or(s.filter.radius);
        s.antialias = self.antialias.map_or(s.antialias, |a| a == Antialias::On);
        s.converge = self.at_rest.map_or(s.converge, |r| r == AtRest::Converge);
        s.occlusion = ao.occlusion_with(s.occlusion.falloff);
        s.seed = seed;
        Ok(s)
    }

    /// Checks that each output can hold the frames.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_outputs(&self, outputs: &[PathBuf]) -> Result<()> {
        let range = self.range();
        for path in outputs {
            let numbered = frames::is_pattern(path)?;
            if is_animation(path) {
                if numbered {
                    return Err(Error::Usage(format!(
                        "{}: an animation holds all frames; leave out the #",
                        path.display()
                    )));
                }
            } else if range.end - range.first > 1 && !numbered {
                return Err(Error::Usage(format!(
                    "{}: {} frames need a name with a # for each digit of the frame number, like out.####.exr, or an animation, like out.apng",
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
