//! Command-line arguments of `skylit bench frames`.

use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};

use super::candidates::{CANDIDATES, Candidate};
use crate::bench::common::CommonArgs;
use crate::bench::session::BenchSession;
use crate::error::{Error, Result};
use crate::integrators::{self, IntegratorName};
use crate::output::parse_size;
use crate::realtime::Preset;
use crate::renderer::frames::is_ambient_occlusion;
use crate::settings::Capability;
use crate::tracer::BuildOptions;
use crate::tracer::settings::{BuildChoice, TracerChoice};

/// Default image size, pixels, and with `--quick`.
const SIZE: [[u32; 2]; 2] = [[160, 90], [64, 36]];
/// Default frames of a run, and with `--quick`: some are left after the 64 that flicker has to end.
const FRAMES: [u32; 2] = [72, 16];
/// Default samples per pixel of the reference of a still camera, and with `--quick`.
const REFERENCE_PATHS: [u32; 2] = [1024, 128];
/// Share of a still reference's paths for frames in motion, whose errors and number are larger.
const MOVING_SHARE: f64 = 0.25;
/// Default timed updates of each acceleration structure, and with `--quick`.
const REPEATS: [u32; 2] = [9, 3];

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Static camera: time, error after 1, 2, 4, ... frames, flicker
    Still,
    /// Ambient occlusion, static camera, with sampling stopped once histories are full
    Rest,
    /// Orbiting camera
    Moving,
    /// Turning environment map, where the scene has one
    Sun,
    /// Objects that move: the scene's first animation, or the box of `room` that slides
    Animation,
    /// Environment map turned at once, camera stepping aside, box appearing: lag, ghosting, disocclusion
    Change,
    /// Ambient occlusion: `balanced` with as many rays as fit the time of `larsen`
    EqualTime,
    /// Time of frames at 1 to 4 bounces, beside Coello (2024)
    Bounces,
    /// Updates of acceleration structures
    Structures,
}

/// A number that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Series {
    /// One terrain of 10^4 to 10^7 triangles, and 2.5*10^7 by instancing
    Triangles,
    /// 1 to 64 rays, or paths, per pixel
    Rays,
    /// 320x180 to 1920x1080
    Resolution,
    /// Every sample sequence of ambient occlusion
    Sampling,
}

/// From where a scene is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ViewChoice {
    /// The scene's own camera, or as `render` would choose; of well-known scenes the near one
    Near,
    /// A framing of the whole scene; of well-known scenes the far one
    Far,
}

impl ViewChoice {
    /// In tables.
    pub fn name(self) -> &'static str {
        if self == Self::Near { "near" } else { "far" }
    }
}

/// Falloff of occlusion with distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FalloffChoice {
    /// Exponential: a hit at the scene's occlusion radius counts 1/255 of a near one
    Exponential,
    /// Binary: hits count fully up to the scene's occlusion radius, and not at all beyond
    Binary,
}

const EXAMPLES: &str = "\
Examples:
  skylit bench frames --quick                            # does everything work?
  skylit bench frames scene.glb --presets balanced --parts still,moving
  skylit bench frames --integrator ao --series rays,resolution scene.glb --html report";

/// `skylit bench frames`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchFramesArgs {
    /// Scenes, as `render` takes them, interior, or room [default: well-known and built-in ones]
    ///
    /// interior is the built-in atrium with one lamp; in room a box appears and slides. The default
    /// of light is the Cornell box with matte blocks, a mirror and a sphere of glass, interior,
    /// parade, and Sponza and FlightHelmet if available. That of ambient occlusion is all
    /// well-known scenes that are available, two large built-in ones, room and parade.
    pub scenes: Vec<String>,
    /// Integrator [default: path]
    #[arg(long, value_name = "NAME", value_parser = integrators::parser())]
    pub integrator: Option<IntegratorName>,
    /// Presets, separated by commas [default: all that the integrator has, but reference]
    ///
    /// gtao is balanced with GTAO (screen space) instead of rays.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = candidate_names())]
    pub presets: Vec<String>,
    /// Parts, separated by commas [default: all; for named scenes all but bounces and structures]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub parts: Vec<Part>,
    /// Vary one number instead, the others fixed; several separated by commas
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', conflicts_with = "parts")]
    pub series: Vec<Series>,
    /// Views, separated by commas [default: near; of ambient occlusion near,far]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub views: Vec<ViewChoice>,
    /// Image size in pixels [default: 160x90; 64x36 with --quick]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Frames of a run [default: 72; 16 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=10_000))]
    pub frames: Option<u32>,
    /// Seed of the samples of frames; where nothing moves plain accumulation has the same
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Runs of a still camera, with seeds one after another, whose errors are averaged
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub runs: u32,
    /// Paths, or occlusion rays, per pixel of the reference [default: 1024; 128 with --quick]
    ///
    /// References of frames in motion have a quarter.
    #[arg(long, visible_alias = "reference-rays", value_name = "N", value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    pub reference_paths: Option<u32>,
    /// Timed updates of each acceleration structure [default: 9; 3 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Falloff of ambient occlusion with distance
    #[arg(long, value_enum, default_value = "exponential")]
    pub ao_falloff: FalloffChoice,
    /// Environment map for scenes without lights [default: the shared sun map, or a built-in one]
    ///
    /// It is an equirectangular .hdr or .exr.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub environment: Option<PathBuf>,
    /// Peers that render paths: a file, or `none` [default: benches/peers.toml of this version]
    ///
    /// They are measured where the camera stands still. Commands of the file are run.
    /// benches/peers.toml in the working folder is taken by default if it is the one of this
    /// version.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub peers: Option<String>,
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

/// A run of `skylit bench frames`.
pub type FramesSession<'a> = BenchSession<'a, BenchFramesArgs>;

fn candidate_names() -> clap::builder::PossibleValuesParser {
    CANDIDATES.iter().map(|c| c.name).collect::<Vec<_>>().into()
}

impl BenchFramesArgs {
    /// The same of ambient occlusion, unless another integrator is named.
    pub fn of_ambient_occlusion(&self) -> Self {
        Self { integrator: Some(self.integrator.unwrap_or_default()), ..self.clone() }
    }

    /// The integrator.
    pub fn integrator(&self) -> IntegratorName {
        self.integrator.or_else(|| IntegratorName::find("path")).unwrap_or_default()
    }

    /// Whether frames are of ambient occlusion.
    pub fn is_occlusion(&self) -> bool {
        is_ambient_occlusion(self.integrator())
    }

    /// Checks that the integrator has frames in real time, these presets, and what is varied.
    pub fn check(&self) -> Result<()> {
        let name = self.integrator().name();
        if !self.integrator().get().capabilities().contains(&Capability::RealTimeFrames) {
            return Err(Error::Usage(format!("--integrator {name}: it has no frames in real time")));
        }
        let for_occlusion =
            |what: String| Err(Error::Usage(format!("{what}: it is for ambient occlusion (--integrator ao)")));
        let is_foreign = |n: &&String| Candidate::find(n).is_some_and(|c| !self.has(c));
        if let Some(preset) = self.presets.iter().find(is_foreign) {
            return for_occlusion(format!("--presets {preset}"));
        }
        if self.series.contains(&Series::Sampling) && !self.is_occlusion() {
            return for_occlusion("--series sampling".into());
        }
        Ok(())
    }

    /// Is a part requested?
    pub fn wants(&self, part: Part) -> bool {
        let is_here = match part {
            Part::Rest | Part::EqualTime => self.is_occlusion(),
            Part::Bounces => self.integrator().can(Capability::GlobalIllumination),
            _ => true,
        };
        let is_named = if self.parts.is_empty() {
            // these have scenes of their own
            !matches!(part, Part::Bounces | Part::Structures) || self.scenes.is_empty()
        } else {
            self.parts.contains(&part)
        };
        self.series.is_empty() && is_here && is_named
    }

    /// Is any part requested that looks at scenes?
    pub fn wants_views(&self) -> bool {
        Part::value_variants().iter().any(|p| !matches!(p, Part::Bounces | Part::Structures) && self.wants(*p))
    }

    /// Whether a still camera is measured, by which equal time is judged, too.
    pub fn wants_still(&self) -> bool {
        self.wants(Part::Still) || self.wants(Part::EqualTime)
    }

    /// Does any part show what peers render, the paths of a still camera?
    pub fn wants_peers(&self) -> bool {
        self.integrator().can(Capability::GlobalIllumination) && self.wants(Part::Still)
    }

    fn has(&self, candidate: &Candidate) -> bool {
        self.is_occlusion() || !candidate.is_for_occlusion_alone()
    }

    /// The presets to compare, in the order in which they are listed to users.
    pub fn candidates(&self) -> Vec<&'static Candidate> {
        let is_wanted = |c: &&Candidate| {
            if self.presets.is_empty() {
                // larsen's ray budget is for ambient occlusion, and the reference is no preset
                let is_larsens = c.preset == Preset::LarsenFixed && !self.is_occlusion();
                self.has(c) && c.preset != Preset::Reference && !is_larsens
            } else {
                self.presets.iter().any(|n| n == c.name)
            }
        };
        CANDIDATES.iter().filter(is_wanted).collect()
    }

    /// From where scenes are seen.
    pub fn views(&self) -> Vec<ViewChoice> {
        match self.views.as_slice() {
            [] if self.is_occlusion() => vec![ViewChoice::Near, ViewChoice::Far],
            [] => vec![ViewChoice::Near],
            named => named.to_vec(),
        }
    }

    /// Image size, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.common.setting(self.size, SIZE)
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        let [width, height] = self.size();
        f64::from(width) / f64::from(height)
    }

    /// Build options of a hierarchy for images of this size.
    pub fn build_options(&self, [width, height]: [u32; 2]) -> BuildOptions {
        let rays = u64::from(width) * u64::from(height) * u64::from(self.reference_paths());
        BuildOptions { preset: self.build.preset(), on_device: self.build.on_device(), rays, ..Default::default() }
    }

    /// Frames of a run.
    pub fn frames(&self) -> u32 {
        self.common.setting(self.frames, FRAMES)
    }

    /// Timed updates of each acceleration structure.
    pub fn repeats(&self) -> u32 {
        self.common.setting(self.repeats, REPEATS)
    }

    /// Samples per pixel of the reference of a still camera.
    pub fn reference_paths(&self) -> u32 {
        self.common.setting(self.reference_paths, REFERENCE_PATHS)
    }

    /// Samples per pixel of the reference of a frame in motion.
    pub fn moving_reference_paths(&self) -> u32 {
        (f64::from(self.reference_paths()) * MOVING_SHARE).ceil() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::parse::parse_args;

    fn parse(extra: &[&str]) -> BenchFramesArgs {
        parse_args(extra).unwrap()
    }

    #[test]
    fn parts_by_what_is_named() {
        let all = parse(&[]);
        assert!(
            all.wants(Part::Still) && all.wants(Part::Sun) && all.wants(Part::Bounces) && all.wants(Part::Structures)
        );
        assert!(!parse(&["a.glb"]).wants(Part::Bounces) && parse(&["a.glb"]).wants(Part::Change));
        assert!(!parse(&["a.glb"]).wants(Part::Structures) && !all.wants(Part::EqualTime));
        let some = parse(&["--parts", "bounces"]);
        assert!(some.wants(Part::Bounces) && !some.wants_views());
        // ambient occlusion has no bounces
        let occlusion = parse(&[]).of_ambient_occlusion();
        assert!(!occlusion.wants(Part::Bounces) && occlusion.wants(Part::Rest) && occlusion.wants_still());
        assert!(!parse(&["--series", "rays"]).wants_views());
        assert!(parse_args::<BenchFramesArgs>(&["--series", "rays", "--parts", "still"]).is_err());
    }

    #[test]
    fn presets_of_an_integrator() {
        let names = |extra: &[&str]| parse(extra).candidates().iter().map(|c| c.name).collect::<Vec<_>>();
        assert_eq!(names(&[]), ["fast", "balanced", "quality"]);
        let occlusion = ["larsen", "larsen-fixed", "fast", "balanced", "quality", "gtao"];
        assert_eq!(names(&["--integrator", "ao"]), occlusion);
        assert_eq!(names(&["--presets", "reference,fast"]), ["fast", "reference"]);
        let wrong = |extra: &[&str]| parse(extra).check().unwrap_err().to_string();
        assert!(wrong(&["--presets", "larsen"]).contains("--presets larsen"));
        assert!(wrong(&["--series", "sampling"]).contains("--series sampling"));
        assert!(wrong(&["--integrator", "normals"]).contains("no frames in real time"));
    }

    #[test]
    fn ambient_occlusion_is_the_same_benchmark() {
        let occlusion = parse(&["--reference-rays", "64"]).of_ambient_occlusion();
        assert!(occlusion.is_occlusion() && occlusion.views().len() == 2 && occlusion.reference_paths() == 64);
        assert_eq!(parse(&[]).views(), [ViewChoice::Near]);
        // an integrator that is named stays
        assert_eq!(parse(&["--integrator", "direct"]).of_ambient_occlusion().integrator().name(), "direct");
    }
}
