//! What each command takes, checked as far as that goes without looking at a scene or a device.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum, ValueHint};
use glam::DVec3;

use super::film::args::FilmArgs;
use super::frames::args::FrameArgs;
use super::paths::args::PathArgs;
use crate::error::{Error, Result};
use crate::film::camera::Choice;
use crate::integrators::ao::Hemisphere;
use crate::integrators::rays::Mode;
use crate::output::{ImageFormat, apng};
use crate::terminal::device_args::{DeviceArgs, Verbosity};
use crate::terminal::parse::{parse_falloff, parse_fov, parse_limit, parse_radius, parse_seconds, parse_size, parse_vector};

/// Samples per pixel when neither the command line nor the scene says.
pub const DEFAULT_SPP: u32 = 16;
/// Image size when neither the command line nor the scene says.
pub const DEFAULT_SIZE: [u32; 2] = [1280, 720];
/// Degrees.
pub const DEFAULT_FOV_Y: f64 = 45.0;

/// What is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Integrator {
    /// Ambient occlusion
    Ao,
    /// Path tracing: global illumination
    Path,
    /// Direct lighting: paths of one bounce
    Direct,
    /// Path traced grey diffuse surfaces under a white sky, divided by albedo: the ground truth that AO approximates
    AoSky,
    /// Shading normals, in world space
    Normals,
    /// Base colours
    Albedo,
    /// Distance along camera rays
    Depth,
    /// Baked occlusion textures
    BakedOcclusion,
}

impl Integrator {
    /// As on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default()
    }
}

/// Axis of the hemisphere that occlusion rays fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AoNormal {
    /// Geometric normal, on the viewer's side
    Geometric,
    /// Shading normal (interpolated)
    Shading,
}

impl From<AoNormal> for Hemisphere {
    fn from(n: AoNormal) -> Self {
        match n {
            AoNormal::Geometric => Hemisphere::Geometric,
            AoNormal::Shading => Hemisphere::Shading,
        }
    }
}

/// An auxiliary output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Aov {
    /// Distance along the ray: depth.Z
    Depth,
    /// World position: position.X, .Y, .Z
    Position,
    /// Geometric normal: Ng.X, .Y, .Z
    Ng,
    /// Shading normal: Ns.X, .Y, .Z
    Ns,
    /// Indices: id.instance, id.primitive, id.material
    Ids,
    /// Base colour: albedo.R, .G, .B
    Albedo,
    /// Bent normal, of frames in real time: bent.X, .Y, .Z
    Bent,
    /// All of these but the bent normal
    All,
}

/// What to find of each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RayMode {
    /// Any hit
    Any,
    /// Closest hit
    Closest,
}

impl From<RayMode> for Mode {
    fn from(m: RayMode) -> Self {
        match m {
            RayMode::Any => Mode::Any,
            RayMode::Closest => Mode::Closest,
        }
    }
}

/// `skylit render`.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    /// Scene: a .gltf, .glb, .obj or .brhan file, or builtin:NAME (`skylit scenes` lists them)
    pub scene: String,
    /// Image to write: .exr (all channels, metadata) or .png (8-bit sRGB); may be given more than once
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, required = true)]
    pub output: Vec<PathBuf>,
    /// What to render
    #[arg(long, value_enum, default_value = "ao")]
    pub integrator: Integrator,
    /// Samples per pixel: one camera ray and one occlusion ray each [default: the scene's, or 16]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub spp: Option<u32>,
    /// Image size in pixels [default: the scene's, or 1280x720]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Camera of the scene, by index or name [default: the first one, or one that sees the whole scene]
    #[arg(long, value_name = "INDEX|NAME", conflicts_with = "eye")]
    pub camera: Option<String>,
    /// Camera position
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, requires = "target", allow_hyphen_values = true)]
    pub eye: Option<DVec3>,
    /// Point that the camera looks at
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true)]
    pub target: Option<DVec3>,
    /// Up vector [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees [default: the camera's, or 45]
    #[arg(long, value_name = "DEG", value_parser = parse_fov, allow_hyphen_values = true)]
    pub fov_y: Option<f64>,
    /// AO radius in scene units: hits beyond do not occlude
    #[arg(long, value_name = "R", default_value = "inf", value_parser = parse_radius, allow_hyphen_values = true)]
    pub ao_radius: f64,
    /// AO falloff: a hit at distance d occludes by C^-d; 1 is binary [default: 1; 8 with --preset larsen]
    #[arg(long, value_name = "C", value_parser = parse_falloff, allow_hyphen_values = true)]
    pub ao_falloff: Option<f64>,
    /// Normal of the hemisphere that AO samples
    #[arg(long, value_enum, default_value = "geometric")]
    pub ao_normal: AoNormal,
    /// What it runs on
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Seed of the sampler
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Stop after this time and write the image so far (at least one sample per pixel)
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    pub time_limit: Option<Duration>,
    /// Write the image so far on Ctrl-C, too (the exit code is still 130)
    #[arg(long)]
    pub keep_partial: bool,
    /// Auxiliary outputs to add to the .exr, separated by commas
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    pub aov: Vec<Aov>,
    /// Also write a depth image of one ray per pixel: .png (near is white, far and background black) or .exr (depth.Z)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub depth_image: Option<PathBuf>,
    /// Also write the rays of the first sample to PREFIX.primary.bin and PREFIX.ao.bin
    #[arg(long, value_name = "PREFIX")]
    pub dump_rays: Option<PathBuf>,
    /// Print what was skipped because the scene or the options do not need it, and what that saved
    #[arg(long)]
    pub explain: bool,
    /// Frames in real time
    #[command(flatten)]
    pub frames: FrameArgs,
    /// Paths
    #[command(flatten)]
    pub paths: PathArgs,
    /// The film
    #[command(flatten)]
    pub film: FilmArgs,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

impl RenderArgs {
    /// Will an .exr be written?
    pub fn writes_exr(&self) -> bool {
        self.output.iter().any(|p| ImageFormat::of(p).is_ok_and(|f| f == ImageFormat::Exr))
    }

    /// Will a picture be written, a still or an animation, rather than numbers?
    pub fn writes_picture(&self) -> bool {
        self.output.iter().any(|p| apng::is_apng(p) || ImageFormat::of(p).is_ok_and(|f| f == ImageFormat::Png))
    }

    /// Checks what concerns more than one option.
    pub fn check(&self) -> Result<()> {
        self.device.check()?;
        self.paths.check(self)?;
        self.film.check(self)?;
        if self.frames.show.is_some() && !self.writes_picture() {
            return Err(Error::Usage("--show is of .png and .apng outputs: an .exr has its channels, see --aov".into()));
        }
        let in_time = self.frames.wanted();
        let images = self.output.iter().filter(|p| in_time.is_none() || !apng::is_apng(p));
        let formats = images.map(|p| ImageFormat::of(p)).collect::<Result<Vec<_>>>()?;
        let only_film = [
            (self.spp.is_some(), "--spp", "use --rays-per-pixel"),
            (self.time_limit.is_some(), "--time-limit", "leave it out"),
            (self.keep_partial, "--keep-partial", "leave it out"),
            (self.depth_image.is_some(), "--depth-image", "use --aov depth"),
            (self.dump_rays.is_some(), "--dump-rays", "leave it out"),
        ];
        if let (Some(frames), Some((_, option, remedy))) = (in_time, only_film.iter().find(|o| o.0)) {
            return Err(Error::Usage(format!("{option} is not for frames in real time, which {frames} asks for: {remedy}")));
        }
        if !self.aov.is_empty() && !formats.contains(&ImageFormat::Exr) {
            return Err(Error::Usage("--aov needs an .exr output: PNG holds colour only".into()));
        }
        if in_time.is_none() && self.wants(Aov::Bent) {
            return Err(Error::Usage("--aov bent is of frames in real time: add --preset".into()));
        }
        if let Some(path) = &self.depth_image {
            ImageFormat::of(path)?;
        }
        if self.eye.is_some() && self.eye == self.target {
            return Err(Error::Usage("--eye and --target are the same point: the view has no direction".into()));
        }
        if self.up == Some(DVec3::ZERO) {
            return Err(Error::Usage("--up 0,0,0 is no direction".into()));
        }
        Ok(())
    }

    /// The camera asked for.
    pub fn camera_choice(&self) -> Choice {
        match (self.eye, self.target, &self.camera) {
            (Some(eye), Some(target), _) => Choice::LookAt {
                eye,
                target,
                up: self.up.unwrap_or(DVec3::Y),
                fov_y: self.fov_y.unwrap_or(DEFAULT_FOV_Y).to_radians(),
            },
            (_, _, Some(name)) => Choice::Named(name.clone()),
            _ => Choice::Auto,
        }
    }

    /// Was this auxiliary output asked for?
    pub fn wants(&self, aov: Aov) -> bool {
        self.aov.contains(&aov) || aov != Aov::Bent && self.aov.contains(&Aov::All)
    }

    /// Every file that will be written.
    pub fn outputs(&self) -> Vec<PathBuf> {
        let dumps = self.dump_rays.iter().flat_map(|p| [dump_path(p, "primary"), dump_path(p, "ao")]);
        self.output.iter().chain(&self.depth_image).cloned().chain(dumps).collect()
    }
}

/// PREFIX.KIND.bin; the prefix may hold dots itself.
pub fn dump_path(prefix: &std::path::Path, kind: &str) -> PathBuf {
    let mut name = prefix.as_os_str().to_owned();
    name.push(format!(".{kind}.bin"));
    name.into()
}

/// `skylit rays`.
#[derive(Clone, Debug, Args)]
pub struct RaysArgs {
    /// Mesh: .bin (u32 vertices, u32 triangles, f32 xyz[], u32 abc[]) or any scene that `render` takes
    #[arg(long, value_name = "MESH", value_hint = ValueHint::FilePath)]
    pub mesh: String,
    /// Rays: f32 origin[3], tmin, direction[3], tmax each
    #[arg(long, value_name = "RAYS.bin", value_hint = ValueHint::FilePath)]
    pub rays: PathBuf,
    /// What to find
    #[arg(long, value_enum, default_value = "closest")]
    pub mode: RayMode,
    /// What it runs on
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Where to write the hits: f32 t (inf = miss), u32 instance, u32 primitive, f32 u, f32 v each
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
    /// Scene, as `render` takes it
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
    /// Fail (exit code 1) when the RMSE of a channel is above this
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    pub max_rmse: Option<f64>,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("1x1"), Ok([1, 1]));
        assert_eq!(parse_size("16384x16384"), Ok([16384, 16384]));
        for bad in ["0x5", "5x0", "16385x16384", "5", "x", "-1x5", "1x2x3", "4294967296x1", ""] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers() {
        assert_eq!(parse_vector("1,-2.5,3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        for bad in ["1,2", "1,2,3,4", "a,b,c", "nan,0,0", "inf,0,0", ""] {
            assert!(parse_vector(bad).is_err(), "{bad}");
        }
        assert!(parse_fov("nan").is_err() && parse_fov("0").is_err() && parse_fov("180").is_err() && parse_fov("45").is_ok());
        assert!(parse_falloff("0.9").is_err() && parse_falloff("inf").is_err() && parse_falloff("1").is_ok());
        assert!(parse_radius("-1").is_err() && parse_radius("0").is_err() && parse_radius("inf").is_ok());
        assert!(parse_seconds("-1").is_err() && parse_seconds("1e300").is_err() && parse_seconds("0.5").is_ok());
    }

    #[test]
    fn options_without_effect_are_refused() {
        #[derive(clap::Parser)]
        struct Alone {
            #[command(flatten)]
            device: DeviceArgs,
        }
        let refused = |line: &str| {
            let args = ["a"].into_iter().chain(line.split_whitespace());
            let device = <Alone as clap::Parser>::try_parse_from(args).unwrap().device;
            device.check().err().map(|e| {
                assert_eq!(e.exit_code(), 64);
                e.to_string()
            })
        };
        for (line, about) in [
            ("--tracer pipeline --build best", "--build is about the compute tracer"),
            ("--tracer query --bvh-cache d", "--bvh-cache is about the compute tracer"),
            ("--tracer pipeline --traversal wide", "--traversal is about"),
            ("--tracer query --triangle-test watertight", "--triangle-test is about"),
            ("--traversal brute --build fast", "--build has no effect on --traversal brute"),
            ("--traversal brute --bvh-cache d", "--bvh-cache has no effect on --traversal brute"),
            ("--traversal nearest --bvh-cache d", "--bvh-cache has no effect on --traversal nearest"),
            ("--traversal direction --bvh-cache d", "--bvh-cache has no effect on --traversal direction"),
        ] {
            assert!(refused(line).is_some_and(|e| e.starts_with(about)), "{line}: {:?}", refused(line));
        }
        for line in ["", "--tracer pipeline", "--tracer compute --build best --bvh-cache d", "--traversal nearest --build fast"]
        {
            assert_eq!(refused(line), None, "{line}");
        }
        for kernel in ["auto", "wide", "packet"] {
            assert_eq!(refused(&format!("--traversal {kernel} --build best --bvh-cache d")), None);
        }
    }

    #[test]
    fn dump_names_keep_dots() {
        assert_eq!(dump_path("a/b.c".as_ref(), "ao"), PathBuf::from("a/b.c.ao.bin"));
    }
}
