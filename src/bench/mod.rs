//! `skylit bench`: speed of tracers, frames in real time and path tracing, beside those of others.
//!
//! Each benchmark is a folder: `rays`, `frames`, `path`, `builders`. All make the measurements of
//! `record`, which `table`, `chart` and `page` show, `baseline` compares with an earlier run, and
//! `report` shows again. `peers` runs the programs of others, `scenes` knows well-known scenes, and
//! `session` is a run under way.

mod baseline;
mod builders;
mod chart;
mod common;
mod frames;
mod page;
mod path;
mod peers;
mod quantity;
mod rays;
mod record;
mod report;
mod scenes;
mod session;
mod table;

use clap::{Args, Subcommand};

use crate::terminal::console::Failure;

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
    Rays(Box<rays::BenchRaysArgs>),
    /// Real-time ambient occlusion: `frames --integrator ao`
    Ao(Box<frames::BenchFramesArgs>),
    /// Frames in real time: time and error of each preset beside plain accumulation at equal time
    Frames(Box<frames::BenchFramesArgs>),
    /// Path tracing: error over time of each sampling strategy and peer, by scene
    Path(Box<path::BenchPathArgs>),
    /// Builders of hierarchies: what rays cost in trees built for them, beside Falcone (2024)
    Builders(Box<builders::BenchBuildersArgs>),
    /// Show, plot and compare saved JSON records of the benchmarks without measuring anything
    Report(report::BenchReportArgs),
}

/// Runs a benchmark, or reports what was measured.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    match &args.benchmark {
        Benchmark::Rays(args) => rays::run(args),
        Benchmark::Ao(args) => frames::run(&args.of_ambient_occlusion()),
        Benchmark::Path(args) => path::run(args),
        Benchmark::Frames(args) => frames::run(args),
        Benchmark::Builders(args) => builders::run(args),
        Benchmark::Report(args) => report::run(args),
    }
}
