//! Command-line arguments of `skylit bench ao`.

use clap::{Args, ValueEnum};

use super::candidates::{CANDIDATES, Candidate, Occlusion};
use crate::bench::common::CommonArgs;
use crate::error::Result;
use crate::output::parse_size;
use crate::tracer::BuildOptions;
use crate::tracer::settings::{BuildChoice, TracerChoice};

/// Default image size, pixels.
const DEFAULT_SIZE: [u32; 2] = [640, 360];
/// The default with `--quick`.
const QUICK_SIZE: [u32; 2] = [160, 90];
/// Default frames of a run.
const DEFAULT_FRAMES: u32 = 64;
/// The default with `--quick`.
const QUICK_FRAMES: u32 = 16;
/// Default rays per pixel of a reference.
const DEFAULT_REFERENCE_RAYS: u32 = 512;
/// The default with `--quick`.
const QUICK_REFERENCE_RAYS: u32 = 64;
/// Default timed updates of each acceleration structure.
const DEFAULT_REPEATS: u32 = 9;
/// The default with `--quick`.
const QUICK_REPEATS: u32 = 3;
/// Preset that is measured only if named, because it is the reference itself.
const LEFT_OUT: &str = "reference";

/// Falloff of occlusion with distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FalloffChoice {
    /// Exponential: a hit at the scene's occlusion radius counts 1/255 of a near one
    Exponential,
    /// Binary: hits count fully up to the scene's occlusion radius, and not at all beyond
    Binary,
}

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Static camera: time, and error after 1, 2, 4, ... frames
    Still,
    /// Static camera, with sampling stopped once histories are full
    Rest,
    /// Orbiting camera
    Moving,
    /// Equal-time comparison: `balanced` with as many rays as fit the time of `larsen`
    EqualTime,
    /// Changing scenes: lag, ghosting, recovery
    Changes,
    /// Updates of acceleration structures
    Structures,
}

/// A parameter sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Series {
    /// One terrain of 10^4 to 10^7 triangles, and 2.5*10^7 by instancing
    Triangles,
    /// 1 to 64 rays per pixel
    Rays,
    /// 320x180 to 1920x1080
    Resolution,
    /// Every sample sequence
    Sampling,
}

const EXAMPLES: &str = "\
Examples:
  skylit bench ao --quick                                # does everything work?
  skylit bench ao scene.glb --presets fast,balanced --html report
  skylit bench ao --baseline ao.json                     # is anything worse than then?";

/// `skylit bench ao`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchAoArgs {
    /// Scenes, as `render` takes them [default: the well-known scenes that are available, and two large built-in ones]
    pub scenes: Vec<String>,
    /// Presets, separated by commas; gtao is balanced with GTAO (screen space) instead of rays [default: all but reference]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = preset_names())]
    pub presets: Vec<String>,
    /// Parts, separated by commas [default: all; for named scenes, those that render a view]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub parts: Vec<Part>,
    /// Sweep one parameter instead, the others fixed; several separated by commas
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', conflicts_with_all = ["parts", "structures"])]
    pub series: Vec<Series>,
    /// Also measure updates of acceleration structures if scenes are named
    #[arg(long)]
    pub structures: bool,
    /// Image size in pixels [default: 640x360; 160x90 with --quick]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Frames of a run [default: 64; 16 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=10_000))]
    pub frames: Option<u32>,
    /// Rays per pixel of each reference image [default: 512; 64 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 20))]
    pub reference_rays: Option<u32>,
    /// Timed updates of each acceleration structure [default: 9; 3 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Falloff of occlusion with distance
    #[arg(long, value_enum, default_value = "exponential")]
    pub ao_falloff: FalloffChoice,
    /// Tracer
    #[arg(long, value_enum, default_value = "auto")]
    pub tracer: TracerChoice,
    /// Build quality of the compute tracer's hierarchy
    #[arg(long, value_enum, default_value = "default")]
    pub build: BuildChoice,
    /// Options of every benchmark
    #[command(flatten)]
    pub common: CommonArgs,
}

fn preset_names() -> clap::builder::PossibleValuesParser {
    CANDIDATES.iter().map(|c| c.name).collect::<Vec<_>>().into()
}

impl BenchAoArgs {
    /// Is a part requested?
    pub fn wants(&self, part: Part) -> bool {
        if !self.series.is_empty() {
            return false;
        }
        match part {
            Part::Structures if self.structures => true,
            _ if !self.parts.is_empty() => self.parts.contains(&part),
            // these use built-in scenes of their own
            Part::Changes | Part::Structures => self.scenes.is_empty(),
            Part::Still | Part::Rest | Part::Moving | Part::EqualTime => true,
        }
    }

    /// Is any part requested that renders views of scenes?
    pub fn wants_views(&self) -> bool {
        [Part::Still, Part::Rest, Part::Moving, Part::EqualTime].into_iter().any(|p| self.wants(p))
    }

    /// The presets to compare, in the order of [`CANDIDATES`].
    pub fn candidates(&self) -> Vec<&'static Candidate> {
        let wanted = |c: &&Candidate| match self.presets.as_slice() {
            [] => c.name != LEFT_OUT,
            names => names.iter().any(|n| n == c.name),
        };
        CANDIDATES.iter().filter(wanted).collect()
    }

    /// The occlusion settings of a scene with occlusion radius `reach`, scene units.
    ///
    /// # Errors
    /// Those of [`Occlusion::new`].
    pub fn occlusion(&self, reach: f64) -> Result<Occlusion> {
        Occlusion::new(reach, self.ao_falloff == FalloffChoice::Binary)
    }

    /// Image size, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.common.setting(self.size, DEFAULT_SIZE, QUICK_SIZE)
    }

    /// Frames of a run.
    pub fn frames(&self) -> u32 {
        self.common.setting(self.frames, DEFAULT_FRAMES, QUICK_FRAMES)
    }

    /// Rays per pixel of a reference.
    pub fn reference_rays(&self) -> u32 {
        self.common.setting(self.reference_rays, DEFAULT_REFERENCE_RAYS, QUICK_REFERENCE_RAYS)
    }

    /// Timed updates of each acceleration structure.
    pub fn repeats(&self) -> u32 {
        self.common.setting(self.repeats, DEFAULT_REPEATS, QUICK_REPEATS)
    }

    /// How the compute tracer's hierarchies are built.
    pub fn build_options(&self) -> BuildOptions {
        let [width, height] = self.size();
        let rays = u64::from(width) * u64::from(height) * u64::from(self.reference_rays());
        BuildOptions { preset: self.build.preset(), rays, cache: None, streams: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        args: BenchAoArgs,
    }

    fn parse(extra: &[&str]) -> BenchAoArgs {
        Alone::try_parse_from([&["bench"], extra].concat()).unwrap().args
    }

    #[test]
    fn parts_by_what_is_named() {
        let all = parse(&[]);
        assert!(all.wants(Part::Still) && all.wants(Part::Changes) && all.wants(Part::Structures));
        let scene = parse(&["a.glb"]);
        assert!(scene.wants(Part::EqualTime) && !scene.wants(Part::Changes) && !scene.wants(Part::Structures));
        assert!(parse(&["a.glb", "--structures"]).wants(Part::Structures));
        let some = parse(&["a.glb", "--parts", "changes,rest"]);
        assert!(some.wants(Part::Changes) && some.wants(Part::Rest) && !some.wants(Part::Still) && some.wants_views());
        assert!(!parse(&["--series", "rays"]).wants_views());
        assert!(Alone::try_parse_from(["bench", "--series", "rays", "--structures"]).is_err());
    }

    #[test]
    fn the_reference_has_to_be_named() {
        let names = |extra: &[&str]| parse(extra).candidates().iter().map(|c| c.name).collect::<Vec<_>>();
        assert_eq!(names(&[]), ["larsen", "larsen-fixed", "fast", "balanced", "quality", "gtao"]);
        assert_eq!(names(&["--presets", "reference,fast"]), ["fast", "reference"]);
    }
}
