//! `skylit bench`: how fast skylit's tracers are, beside each other and beside those of others; and how fast and how good its
//! real-time ambient occlusion and its path tracing are.

mod ao;
mod args;
mod common;
mod contestant;
mod path;
mod peer;
mod peers_file;
mod process;
mod rays;
mod scenes;
mod streams;
mod table;

pub use args::BenchArgs;

use crate::terminal::console::Failure;

/// Runs the benchmark that was asked for.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    match &args.what {
        args::What::Rays(args) => rays::run(args),
        args::What::Ao(args) => ao::run(args),
        args::What::Path(args) => path::run(args),
    }
}
