//! The arguments of each command, checked as far as possible without a scene or a device. `render` has its own file.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use crate::integrators::rays::Mode;
use crate::settings::parse::parse_limit;
use crate::terminal::console::Verbosity;
use crate::tracer::DeviceSettings;

/// `skylit rays`.
#[derive(Clone, Debug, Args)]
pub struct RaysArgs {
    /// Mesh: .bin (u32 vertices, u32 triangles, f32 xyz[], u32 abc[]) or any scene that `render` takes
    #[arg(long, value_name = "MESH", value_hint = ValueHint::FilePath)]
    pub mesh: String,
    /// Rays: f32 origin[3], tmin, direction[3], tmax each
    #[arg(long, value_name = "RAYS.bin", value_hint = ValueHint::FilePath)]
    pub rays: PathBuf,
    /// Query: the closest hit of each ray, or whether there is any hit
    #[arg(long, value_enum, default_value = "closest")]
    pub mode: Mode,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// Write the hits to this file: f32 t (inf = miss), u32 instance, u32 primitive, f32 u, f32 v each
    #[arg(long, value_name = "HITS.bin", value_hint = ValueHint::FilePath)]
    pub hits: Option<PathBuf>,
    /// Repetitions, after one warm-up
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub repeats: u32,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// `skylit export`.
#[derive(Clone, Debug, Args)]
pub struct ExportArgs {
    /// Scene file (.gltf, .glb, .obj, .brhan) or builtin:NAME
    pub scene: String,
    /// File to write: .bin (triangle soup in world space), .glb or .gltf
    #[arg(value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// `skylit scenes`.
#[derive(Clone, Debug, Args)]
pub struct ScenesArgs {
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
}

/// `skylit doctor`.
#[derive(Clone, Debug, Args)]
pub struct DoctorArgs {
    /// Device to examine, by index or part of its name [default: the most capable]
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
}

/// `skylit diff`.
#[derive(Clone, Debug, Args)]
pub struct DiffArgs {
    /// First image, .exr or .png
    pub a: PathBuf,
    /// Second image: the reference, for metrics that are not symmetric
    pub b: PathBuf,
    /// Fail (exit code 1) if the RMSE of a compared channel exceeds this
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    pub max_rmse: Option<f64>,
    /// Channels to compare, separated by commas: depth.Z,Ng.X [default: the colour channels; the others are only listed]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub channels: Vec<String>,
    /// Compare all pixels, also those that neither image covers
    #[arg(long)]
    pub all_pixels: bool,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}
