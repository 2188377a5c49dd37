//! Command-line arguments of `skylit bench builders`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use crate::bench::common::CommonArgs;

const EXAMPLES: &str = "\
Examples:
  skylit bench builders --quick                           # does everything work?
  skylit bench builders --html report                     # Falcone's placements, and the rays of images
  skylit bench builders scene.glb --areas none            # a scene of yours, by the rays of its image
  skylit bench builders --counts --json builders.json     # counts on the host alone";

/// `skylit bench builders`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchBuildersArgs {
    /// Scenes whose images' rays are measured [default: Sponza, the dragon and builtin:atrium]
    ///
    /// Sponza and the dragon are measured where they are available.
    pub scenes: Vec<String>,
    /// Influence areas by scene, as Falcone (2024) placed them, or `none` [default: a shared file]
    ///
    /// The default is falcone_influence_areas.json in the folder `references` beside that of the
    /// shared scenes, if it exists.
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub areas: Option<String>,
    /// Results of Falcone (2024) to show beside [default: falcone_runs.csv beside the areas]
    ///
    /// The file has scene, area, orient, variant and costs in CSV.
    #[arg(long, value_name = "FILE.csv", value_hint = ValueHint::FilePath)]
    pub runs: Option<PathBuf>,
    /// Width of the images whose rays are measured, 16:9 [default: 256; 64 with --quick]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub width: Option<u32>,
    /// Timed repeats on the device, after one warm-up [default: 5; 1 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Count on the host alone: no rates on the device
    #[arg(long)]
    pub counts: bool,
    /// Options of every benchmark
    #[command(flatten)]
    pub common: CommonArgs,
}

impl BenchBuildersArgs {
    /// Size of the images.
    pub fn size(&self) -> [u32; 2] {
        let width = self.common.setting(self.width, [256, 64]);
        [width, (width * 9 / 16).max(1)]
    }

    /// Timed repeats.
    pub fn repeats(&self) -> u32 {
        self.common.setting(self.repeats, [5, 1])
    }
}
