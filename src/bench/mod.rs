//! `skylit bench`: speed of tracers, frames in real time and path tracing, beside those of others.
//!
//! Each benchmark is a folder: `rays`, `frames`, `path`, `builders`. All make the measurements of
//! `record`, which `table`, `chart` and `page` show, `baseline` compares with an earlier run, and
//! `report` shows again. `peers` runs the programs of others, `scenes` knows well-known scenes,
//! `session` is a run under way, and `device` alone opens the device and builds tracers.

mod args;
mod baseline;
mod builders;
mod chart;
mod common;
mod device;
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

pub use args::BenchArgs;

use crate::terminal::console::Failure;

/// Runs a benchmark, or reports what was measured.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    match &args.benchmark {
        args::Benchmark::Rays(args) => rays::run(args),
        args::Benchmark::Ao(args) => frames::run(&args.of_ambient_occlusion()),
        args::Benchmark::Path(args) => path::run(args),
        args::Benchmark::Frames(args) => frames::run(args),
        args::Benchmark::Builders(args) => builders::run(args),
        args::Benchmark::Report(args) => report::run(args),
    }
}
