//! Command-line arguments of `skylit bench`.

use clap::{Args, Subcommand};

use super::builders::BenchBuildersArgs;
use super::frames::BenchFramesArgs;
use super::path::BenchPathArgs;
use super::rays::BenchRaysArgs;
use super::report::BenchReportArgs;

/// `skylit bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// Benchmark to run
    #[command(subcommand)]
    pub benchmark: Benchmark,
}

/// The benchmarks.
#[derive(Clone, Debug, Subcommand)]
pub enum Benchmark {
    /// Ray tracing: rays per second of each tracer, kernel and peer, by ray stream and scene
    Rays(Box<BenchRaysArgs>),
    /// Real-time ambient occlusion: `frames --integrator ao`
    Ao(Box<BenchFramesArgs>),
    /// Frames in real time: time and error of each preset beside plain accumulation at equal time
    Frames(Box<BenchFramesArgs>),
    /// Path tracing: error over time of each sampling strategy and peer, by scene
    Path(Box<BenchPathArgs>),
    /// Builders of hierarchies: what rays cost in trees built for them, beside Falcone (2024)
    Builders(Box<BenchBuildersArgs>),
    /// Show, plot and compare saved JSON records of the benchmarks without measuring anything
    Report(BenchReportArgs),
}
