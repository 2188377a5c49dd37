//! `skylit bench`: how fast skylit's tracers are, beside each other and beside those of others; and how fast and how good its
//! real-time frames and its path tracing are.
//!
//! Each benchmark is a folder: `rays`, `frames`, `path`. What they share is beside them: `record` is the list of measurements that all of them make, `table`, `chart` and
//! `page` show it, `baseline` compares it with an earlier run, `report` does so with records that were saved, `peers` runs the programs of others, `scenes` knows the
//! well-known scenes, `session` is a run under way, and `device` alone opens the device and builds tracers.

mod args;
mod baseline;
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
        args::Benchmark::Report(args) => report::run(args),
    }
}
