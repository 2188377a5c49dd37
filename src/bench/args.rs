//! What `skylit bench` takes.

use clap::{Args, Subcommand};

use super::ao::BenchAoArgs;
use super::path::BenchPathArgs;
use super::rays::BenchRaysArgs;

/// `skylit bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// What is measured
    #[command(subcommand)]
    pub benchmark: Benchmark,
}

/// What is measured.
#[derive(Clone, Debug, Subcommand)]
pub enum Benchmark {
    /// Rays a second of each tracer, kernel and peer, by stream of rays and scene
    Rays(Box<BenchRaysArgs>),
    /// Real-time ambient occlusion: time, rays and error of each preset, by scene, view and kind of motion
    Ao(Box<BenchAoArgs>),
    /// Path tracing: error against time of each sampling strategy and peer, by scene
    Path(Box<BenchPathArgs>),
}
