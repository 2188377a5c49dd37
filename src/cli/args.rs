//! Arguments of loading, and of the commands that have no file of their own for them, checked as
//! far as possible without a scene or a device.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use crate::error::Result;
use crate::integrators::rays::Mode;
use crate::renderer::Renderer;
use crate::scene::load::{Confine, GeometryOptions, LoadOptions, NormalSource, Projection, UpAxis, load_with};
use crate::scene::{Scene, SceneSettings};
use crate::settings::parse::parse_limit;
use crate::terminal::console::{Console, Verbosity};
use crate::terminal::loading::with_progress;
use crate::tracer::DeviceSettings;

/// Which files of a scene are read, and which of a file's scenes.
#[derive(Clone, Debug, Default, Args)]
pub struct LoadArgs {
    /// Scene of a glTF file, by its name or its number from 0 [default: the one that the file
    /// names]
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Scene", hide_short_help = true)]
    pub gltf_scene: Option<String>,
    /// Shading normals: the file's, flat, smooth, or smooth at edges of up to ANGLE degrees
    /// [default: file]
    ///
    /// `smooth` takes the mean of the normals of the triangles around a vertex. With ANGLE, edges
    /// at which the surface bends by more degrees stay sharp. A mesh whose file has no normals is
    /// flat by default.
    #[arg(long, value_name = "file|flat|smooth|ANGLE", help_heading = "Scene", hide_short_help = true)]
    pub normals: Option<NormalSource>,
    /// Project texture coordinates onto meshes that have none [default: none]
    ///
    /// Meshes get them whose material has textures, projected from the bounds of each mesh. Others
    /// keep theirs.
    #[arg(long, value_enum, value_name = "PROJECTION", help_heading = "Scene", hide_short_help = true)]
    pub uv: Option<Projection>,
    /// Axis of the file that points up: z in files of CAD programs, robots and maps [default: y]
    #[arg(long, value_enum, value_name = "y|z", help_heading = "Scene", hide_short_help = true)]
    pub up_axis: Option<UpAxis>,
    /// Refuse a scene that refers to files outside of its own folder
    ///
    /// It is for scenes of strangers, which could name any file of this machine.
    ///
    /// Buffers, images, material libraries and models count, links in the folder that lead out of it, and what a skylit.toml beside the scene names.
    #[arg(long, hide_short_help = true)]
    pub confine: bool,
}

impl LoadArgs {
    /// The options of the loader.
    pub fn options(&self) -> LoadOptions<'_> {
        let (scene, confine, geometry) = (self.gltf_scene.as_deref(), self.confine(), self.geometry());
        LoadOptions { scene, confine, geometry, ..LoadOptions::default() }
    }

    /// Loads a scene, and shows the progress.
    pub fn load(&self, source: &str, console: &Console) -> Result<Scene> {
        with_progress(source, console, |progress| load_with(source, &LoadOptions { progress, ..self.options() }))
    }

    /// Opens a renderer of a scene, and shows the progress of loading.
    pub fn open(&self, source: &str, device: &DeviceSettings, console: &Console) -> Result<Renderer> {
        with_progress(source, console, |progress| {
            Renderer::open_with(source, &LoadOptions { progress, ..self.options() }, device)
        })
    }

    /// How the options understand the geometry.
    pub fn geometry(&self) -> GeometryOptions {
        let (normals, up) = (self.normals.unwrap_or_default(), self.up_axis.unwrap_or_default());
        GeometryOptions { normals, uv: self.uv, up }
    }

    /// Where the files must lie that a scene refers to.
    pub fn confine(&self) -> Confine<'static> {
        if self.confine { Confine::SceneFolder } else { Confine::Nowhere }
    }
}

const RAYS_EXAMPLES: &str = "\
Examples:
  skylit render scene.glb -o ao.png --dump-rays set      # writes set.primary.bin and set.ao.bin
  skylit rays --mesh scene.glb --rays set.ao.bin --mode any --repeats 9";

/// `skylit rays`.
#[derive(Clone, Debug, Args)]
#[command(before_help = RAYS_EXAMPLES)]
pub struct RaysArgs {
    /// Mesh: .bin (u32 vertices, u32 triangles, f32 xyz[], u32 abc[]) or any scene that `render` takes
    #[arg(long, value_name = "MESH", value_hint = ValueHint::FilePath)]
    pub mesh: String,
    /// Files of the mesh
    #[command(flatten)]
    pub load: LoadArgs,
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

const EXPORT_EXAMPLES: &str = "\
Examples:
  skylit export scene.obj -o scene.glb
  skylit export builtin:atrium -o atrium.gltf
  skylit export scene.glb -o triangles.bin";

/// `skylit export`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXPORT_EXAMPLES)]
pub struct ExportArgs {
    /// Scene file (.gltf, .glb, .obj, .brhan) or builtin:NAME
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: String,
    /// File to write: .bin (triangle soup in world space), .glb or .gltf
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, required_unless_present = "output_argument")]
    pub output: Option<PathBuf>,
    /// The same without -o
    #[arg(value_name = "OUTPUT", value_hint = ValueHint::FilePath, conflicts_with = "output")]
    pub output_argument: Option<PathBuf>,
    /// Replace files beside a .gltf that no earlier export has written, too: its .bin and .png
    #[arg(long)]
    pub force: bool,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// Meaning of the file
    #[command(flatten)]
    pub meaning: SceneSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// `skylit scenes`.
#[derive(Clone, Debug, Args)]
#[command(
    before_help = "Examples:\n  skylit scenes\n  skylit builtin:atrium                   # look at one\n  skylit render builtin:grid:20 -o a.png  # some have a parameter"
)]
pub struct ScenesArgs {
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
}

/// `skylit doctor`.
#[derive(Clone, Debug, Args)]
#[command(before_help = "Examples:\n  skylit doctor\n  skylit doctor --device 1 --json")]
pub struct DoctorArgs {
    /// Device to examine, by index or part of its name [default: the most capable]
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
}

const DIFF_EXAMPLES: &str = "\
Examples:
  skylit diff new.exr reference.exr                      # prints the metrics
  skylit diff new.exr reference.exr --max-rmse 0.01      # exit code 1 if they are further apart";

/// `skylit diff`.
#[derive(Clone, Debug, Args)]
#[command(before_help = DIFF_EXAMPLES)]
pub struct DiffArgs {
    /// First image: .exr, .png, .jpg or .webp
    pub a: PathBuf,
    /// Second image: the reference, for metrics that are not symmetric
    pub b: PathBuf,
    /// Fail (exit code 1) if the RMSE of a compared channel exceeds this [default: no bound]
    ///
    /// Without it only NaN and images with no pixel to compare fail.
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    pub max_rmse: Option<f64>,
    /// Channels to compare, separated by commas: depth.Z,Ng.X [default: the colour channels]
    ///
    /// The others are only listed.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub channels: Vec<String>,
    /// Compare all pixels, also black ones that neither image covers
    #[arg(long)]
    pub all_pixels: bool,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}
