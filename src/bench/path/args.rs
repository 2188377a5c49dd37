//! Command-line arguments of `skylit bench path`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueHint};

use crate::bench::common::CommonArgs;
use crate::bench::session::BenchSession;
use crate::integrators::path::Strategy;
use crate::output::parse_size;
use crate::settings::parse::parse_seconds;
use crate::tracer::settings::{BuildChoice, TracerChoice};

/// Default image size, pixels, and with `--quick`.
const SIZE: [[u32; 2]; 2] = [[256, 256], [64, 64]];
/// Default timed images of each sample count, and with `--quick`.
const REPEATS: [u32; 2] = [5, 2];
/// Default target seconds of the longest image, and with `--quick`.
const SECONDS: [f64; 2] = [4.0, 0.3];
/// Time of a reference relative to the longest image.
const REFERENCE_SHARE: f64 = 15.0;

const EXAMPLES: &str = "\
Examples:
  skylit bench path --quick                              # does everything work?
  skylit bench path cornell --strategies mis,bsdf --plot path.svg";

/// `skylit bench path`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchPathArgs {
    /// Scenes, as `render` takes them, or cornell, sphere-diffuse, ... [default: well-known ones]
    ///
    /// cornell is the box with Lambertian walls; sphere-diffuse, sphere-metal, sphere-mirror and
    /// sphere-glass are a sphere alone. The default is cornell, FlightHelmet and Sponza if
    /// available, and the first three spheres.
    pub scenes: Vec<String>,
    /// Sampling strategies of skylit, separated by commas [default: all]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub strategies: Vec<Strategy>,
    /// Image size in pixels [default: 256x256; 64x64 with --quick]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Timed images of each sample count, interleaved, after one warm-up [default: 5; 2 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Quadruple samples until an image takes about this long [default: 4; 0.3 with --quick]
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    pub seconds: Option<Duration>,
    /// Time spent on the reference image of each engine and scene [default: 15 times --seconds]
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    pub reference_seconds: Option<Duration>,
    /// Environment map for scenes without lights [default: the shared sun map, or a built-in one]
    ///
    /// It is an equirectangular .hdr or .exr.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub environment: Option<PathBuf>,
    /// Tracer
    #[arg(long, value_enum, default_value = "auto")]
    pub tracer: TracerChoice,
    /// Build quality of the compute tracer's hierarchy
    #[arg(long, value_enum, default_value = "default")]
    pub build: BuildChoice,
    /// Peers to compare with: a file, or `none` [default: benches/peers.toml of this version]
    ///
    /// Commands of the file are run. benches/peers.toml in the working folder is taken by default
    /// if it is the one of this version.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub peers: Option<String>,
    /// Options of every benchmark
    #[command(flatten)]
    pub common: CommonArgs,
}

/// A run of `skylit bench path`.
pub type PathSession<'a> = BenchSession<'a, BenchPathArgs>;

impl BenchPathArgs {
    /// Image size, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.common.setting(self.size, SIZE)
    }

    /// Timed images of each kind.
    pub fn repeats(&self) -> u32 {
        self.common.setting(self.repeats, REPEATS)
    }

    /// Target seconds of the longest image.
    pub fn seconds(&self) -> f64 {
        self.common.setting(self.seconds.map(|d| d.as_secs_f64()), SECONDS)
    }

    /// Seconds for each reference.
    pub fn reference_seconds(&self) -> f64 {
        self.reference_seconds.map_or(REFERENCE_SHARE * self.seconds(), |d| d.as_secs_f64())
    }

    /// Sampling strategies to measure, in the order of the tables.
    pub fn strategies(&self) -> Vec<Strategy> {
        let all = [Strategy::Mis, Strategy::Light, Strategy::Bsdf, Strategy::Cosine, Strategy::Uniform];
        all.into_iter().filter(|s| self.strategies.is_empty() || self.strategies.contains(s)).collect()
    }
}
