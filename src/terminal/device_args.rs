//! Options that most commands share: the device, the tracer on it, and how results are shown.

use std::path::PathBuf;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum, ValueHint};

use super::console::Console;
use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::error::{Error, Result};
use crate::tracer::{BuildOptions, ComputeOptions, Kernel, TracerKind, TriangleTest};

/// Which tracer to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TracerChoice {
    /// The fastest on the device
    Auto,
    /// VK_KHR_ray_tracing_pipeline
    Pipeline,
    /// VK_KHR_ray_query
    Query,
    /// Compute shaders over a software BVH: any device
    Compute,
}

impl TracerChoice {
    /// The tracer, and why, on a device.
    pub fn on(self, info: &crate::gpu::DeviceInfo) -> (TracerKind, String) {
        let asked = |kind| (kind, "asked for with --tracer".to_owned());
        match self {
            Self::Auto => TracerKind::auto(info),
            Self::Pipeline => asked(TracerKind::Pipeline),
            Self::Query => asked(TracerKind::Query),
            Self::Compute => asked(TracerKind::Compute),
        }
    }
}

impl ValueEnum for Kernel {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()).help(self.describe()))
    }
}

/// The compute tracer's test of a ray against a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TriangleTestChoice {
    /// No ray slips between triangles that share an edge
    Watertight,
    /// Moeller-Trumbore, for benchmarks: not watertight
    MollerTrumbore,
}

impl From<TriangleTestChoice> for TriangleTest {
    fn from(t: TriangleTestChoice) -> Self {
        match t {
            TriangleTestChoice::Watertight => TriangleTest::Watertight,
            TriangleTestChoice::MollerTrumbore => TriangleTest::MollerTrumbore,
        }
    }
}

/// How results are shown.
#[derive(Clone, Copy, Debug, Args)]
pub struct Verbosity {
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

impl Verbosity {
    /// Where to say things.
    pub fn console(&self) -> Console {
        Console { json: self.json, quiet: self.quiet }
    }
}

/// How much time to spend on a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BuildChoice {
    /// Chosen by the number of primitives and rays
    Auto,
    /// Fastest build
    Fast,
    /// Balanced
    Default,
    /// Spatial splits: fastest traversal
    Best,
}

impl BuildChoice {
    /// As on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default()
    }

    /// `None`: what suits the scene and the rays.
    pub fn preset(self) -> Option<BuildPreset> {
        match self {
            BuildChoice::Auto => None,
            BuildChoice::Fast => Some(BuildPreset::Fast),
            BuildChoice::Default => Some(BuildPreset::Default),
            BuildChoice::Best => Some(BuildPreset::Best),
        }
    }
}

/// What it runs on.
#[derive(Clone, Debug, Args)]
pub struct DeviceArgs {
    /// How rays are traced
    #[arg(long, value_enum, default_value = "auto")]
    pub tracer: TracerChoice,
    /// Traversal kernel of the compute tracer [default: auto]
    #[arg(long, value_enum)]
    pub traversal: Option<Kernel>,
    /// Ray-triangle intersection test of the compute tracer [default: watertight]
    #[arg(long, value_enum)]
    pub triangle_test: Option<TriangleTestChoice>,
    /// BVH build quality of the compute tracer
    #[arg(long, value_enum, default_value = "auto")]
    pub build: BuildChoice,
    /// Cache the compute tracer's BVHs in this folder, and reuse them for the same geometry
    /// [env: SKYLIT_BVH_CACHE]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub bvh_cache: Option<PathBuf>,
    /// Vulkan device, by index or part of its name (`skylit doctor` lists them)
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Enable the Vulkan validation layer; any message fails the run
    #[arg(long)]
    pub validation: bool,
}

impl DeviceArgs {
    /// How to open the device.
    pub fn options(&self) -> crate::gpu::Options {
        crate::gpu::Options { device: self.device.clone(), validation: self.validation, ..Default::default() }
    }

    /// How the compute tracer's hierarchy is built, when about so many rays will be traced.
    pub fn build_options(&self, rays: u64) -> BuildOptions {
        let from_environment = || std::env::var_os("SKYLIT_BVH_CACHE").filter(|v| !v.is_empty()).map(PathBuf::from);
        BuildOptions {
            preset: self.build.preset(),
            rays,
            cache: self.bvh_cache.clone().or_else(from_environment).map(Cache::new),
            streams: Vec::new(),
        }
    }

    /// The first option given that is about the compute tracer alone.
    fn about_compute(&self) -> Option<&'static str> {
        let given = [
            (self.traversal.is_some(), "--traversal"),
            (self.triangle_test.is_some(), "--triangle-test"),
            (self.build != BuildChoice::Auto, "--build"),
            (self.bvh_cache.is_some(), "--bvh-cache"),
        ];
        given.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// Checks what concerns more than one option: none may be given that would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`] when an option of the compute tracer meets another tracer, or one of its hierarchy a traversal that has
    /// none or keeps none.
    pub fn check(&self) -> Result<()> {
        if let (TracerChoice::Pipeline | TracerChoice::Query, Some(option)) = (self.tracer, self.about_compute()) {
            return Err(Error::Usage(format!("{option} is about the compute tracer: leave it out, or say --tracer compute")));
        }
        let option = match self.traversal {
            Some(Kernel::Brute) if self.build != BuildChoice::Auto => Some("--build"),
            Some(Kernel::Brute | Kernel::Nearest | Kernel::Direction) if self.bvh_cache.is_some() => Some("--bvh-cache"),
            _ => None,
        };
        match (option, self.traversal) {
            (Some(option), Some(kernel)) => Err(Error::Usage(format!(
                "{option} has no effect on --traversal {kernel}, which {}: leave it out, or choose another traversal",
                if kernel == Kernel::Brute { "has no hierarchy" } else { "keeps none" }
            ))),
            _ => Ok(()),
        }
    }

    /// The tracer on a device, why this one, and how the compute tracer works. What concerns the compute tracer alone chooses it
    /// where `--tracer` leaves the choice.
    ///
    /// # Errors
    /// Those of [`DeviceArgs::check`].
    pub fn choose(&self, info: &crate::gpu::DeviceInfo) -> Result<(TracerKind, String, ComputeOptions)> {
        self.check()?;
        let (kind, why) = match (self.tracer, self.about_compute()) {
            (TracerChoice::Auto, Some(option)) => (TracerKind::Compute, format!("{option} is about this tracer alone")),
            (choice, _) => choice.on(info),
        };
        let options = ComputeOptions {
            kernel: self.traversal.unwrap_or_default(),
            triangle_test: self.triangle_test.map(TriangleTest::from).unwrap_or_default(),
        };
        Ok((kind, why, options))
    }
}
