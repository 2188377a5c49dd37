//! Command-line arguments of `skylit bench frames`.

use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};

use crate::bench::common::CommonArgs;
use crate::error::{Error, Result};
use crate::integrators::{self, IntegratorName};
use crate::output::parse_size;
use crate::realtime::{Preset, Technique};
use crate::renderer::frames::is_ambient_occlusion;
use crate::settings::Capability;
use crate::tracer::settings::{BuildChoice, TracerChoice};

/// Default image size, pixels.
const DEFAULT_SIZE: [u32; 2] = [160, 90];
/// The default with `--quick`.
const QUICK_SIZE: [u32; 2] = [64, 36];
/// Default frames of a run: some are left after the 64 that flicker has to end.
const DEFAULT_FRAMES: u32 = 72;
/// The default with `--quick`.
const QUICK_FRAMES: u32 = 16;
/// Default paths per pixel of the reference of a still camera.
const DEFAULT_REFERENCE_PATHS: u32 = 1024;
/// The default with `--quick`.
const QUICK_REFERENCE_PATHS: u32 = 128;
/// Paths of a reference of a frame in motion, relative to those of a still camera: the errors are larger, and the references several.
const MOVING_SHARE: f64 = 0.25;

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Static camera: time, error after 1, 2, 4, ... frames, flicker
    Still,
    /// Orbiting camera
    Moving,
    /// Turning environment map, where the scene has one
    Sun,
    /// The scene's first animation, if it has any
    Animation,
    /// Environment map turned at once, camera stepping aside: lag, ghosting, disocclusion
    Change,
    /// Time of frames at 1 to 4 bounces, beside Coello (2024)
    Bounces,
}

const EXAMPLES: &str = "\
Examples:
  skylit bench frames --quick                            # does everything work?
  skylit bench frames scene.glb --presets balanced --parts still,moving
  skylit bench frames --integrator ao-sky --html report";

/// `skylit bench frames`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchFramesArgs {
    /// Scenes: as `render` takes them, or interior (the built-in atrium with one lamp)
    /// [default: the Cornell box with matte blocks, a mirror and a sphere of glass, interior, parade, and Sponza and FlightHelmet if available]
    pub scenes: Vec<String>,
    /// Integrator
    #[arg(long, value_name = "NAME", value_parser = integrators::parser(), default_value = "path")]
    pub integrator: IntegratorName,
    /// Presets, separated by commas [default: all that the integrator has, but reference]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub presets: Vec<Preset>,
    /// Parts, separated by commas [default: all; for named scenes all but bounces]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub parts: Vec<Part>,
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
    /// Paths per pixel of the reference of a still camera; a quarter for those of frames in motion [default: 1024; 128 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    pub reference_paths: Option<u32>,
    /// Environment map for scenes without lights, an equirectangular .hdr or .exr [default: the shared sun map if available, or a built-in one]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub environment: Option<PathBuf>,
    /// Peers that render paths, beside a still camera: a file like benches/peers.toml, or `none`: its commands are run [default: benches/peers.toml if it is the one of this version]
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

impl BenchFramesArgs {
    /// Checks that the integrator has frames in real time, and these presets.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self) -> Result<()> {
        if !self.integrator.get().capabilities().contains(&Capability::RealTimeFrames) {
            return Err(Error::Usage(format!("--integrator {}: it has no frames in real time", self.integrator.name())));
        }
        match self.presets.iter().find(|p| !self.has(**p)) {
            Some(p) => Err(Error::Usage(format!("--presets {p}: it is for ambient occlusion (--integrator ao)"))),
            None => Ok(()),
        }
    }

    /// Is a part requested?
    pub fn wants(&self, part: Part) -> bool {
        match self.parts.as_slice() {
            // its scenes are its own
            [] => part != Part::Bounces || self.scenes.is_empty() && self.integrator.can(Capability::GlobalIllumination),
            parts => parts.contains(&part),
        }
    }

    /// Is any part requested that looks at scenes?
    pub fn wants_views(&self) -> bool {
        Part::value_variants().iter().any(|p| *p != Part::Bounces && self.wants(*p))
    }

    /// Does any part show what peers render, the paths of a still camera?
    pub fn wants_peers(&self) -> bool {
        self.integrator.can(Capability::GlobalIllumination) && self.wants(Part::Still)
    }

    fn has(&self, preset: Preset) -> bool {
        is_ambient_occlusion(self.integrator) || preset.settings().technique != Technique::Larsen
    }

    /// The presets to compare, in the order in which they are listed to users.
    pub fn presets(&self) -> Vec<Preset> {
        let is_wanted = |p: &Preset| match self.presets.as_slice() {
            // larsen's budget of rays is for ambient occlusion, and the reference is no preset to compare
            [] => {
                self.has(*p) && *p != Preset::Reference && (is_ambient_occlusion(self.integrator) || *p != Preset::LarsenFixed)
            }
            named => named.contains(p),
        };
        Preset::ALL.iter().copied().filter(is_wanted).collect()
    }

    /// Image size, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.common.setting(self.size, DEFAULT_SIZE, QUICK_SIZE)
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        let [width, height] = self.size();
        f64::from(width) / f64::from(height)
    }

    /// Frames of a run.
    pub fn frames(&self) -> u32 {
        self.common.setting(self.frames, DEFAULT_FRAMES, QUICK_FRAMES)
    }

    /// Paths per pixel of the reference of a still camera.
    pub fn reference_paths(&self) -> u32 {
        self.common.setting(self.reference_paths, DEFAULT_REFERENCE_PATHS, QUICK_REFERENCE_PATHS)
    }

    /// Paths per pixel of the reference of a frame in motion.
    pub fn moving_reference_paths(&self) -> u32 {
        (f64::from(self.reference_paths()) * MOVING_SHARE).ceil() as u32
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        args: BenchFramesArgs,
    }

    fn parse(extra: &[&str]) -> BenchFramesArgs {
        Alone::try_parse_from([&["bench"], extra].concat()).unwrap().args
    }

    #[test]
    fn parts_by_what_is_named() {
        let all = parse(&[]);
        assert!(all.wants(Part::Still) && all.wants(Part::Sun) && all.wants(Part::Bounces));
        assert!(!parse(&["a.glb"]).wants(Part::Bounces) && parse(&["a.glb"]).wants(Part::Change));
        let some = parse(&["--parts", "bounces"]);
        assert!(some.wants(Part::Bounces) && !some.wants_views());
        // ambient occlusion has no bounces
        assert!(!parse(&["--integrator", "ao"]).wants(Part::Bounces));
    }

    #[test]
    fn presets_of_an_integrator() {
        let names = |extra: &[&str]| parse(extra).presets().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(names(&[]), ["fast", "balanced", "quality"]);
        assert_eq!(names(&["--integrator", "ao"]), ["larsen", "larsen-fixed", "fast", "balanced", "quality"]);
        assert_eq!(names(&["--presets", "reference,fast"]), ["fast", "reference"]);
        let wrong = |extra: &[&str]| parse(extra).check().unwrap_err().to_string();
        assert!(wrong(&["--presets", "larsen"]).contains("--presets larsen"));
        assert!(wrong(&["--integrator", "normals"]).contains("no frames in real time"));
    }
}
