//! Settings of where rays are traced, and how: the device, the tracer on it, and how the compute tracer works.

use std::path::PathBuf;

use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::error::{Error, Result};
use crate::settings::{AppliesTo, choices, settings};
use crate::tracer::{BuildOptions, ComputeOptions, Kernel, TracerKind, TriangleTest};

choices! {
    /// Which tracer to use.
    pub enum TracerChoice {
        /// The fastest on the device
        Auto = "auto",
        /// VK_KHR_ray_tracing_pipeline
        Pipeline = "pipeline",
        /// VK_KHR_ray_query
        Query = "query",
        /// Compute shaders over a software BVH: any device
        Compute = "compute",
    }
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

choices! {
    /// How much time to spend on a hierarchy.
    pub enum BuildChoice {
        /// Chosen by the number of primitives and rays
        Auto = "auto",
        /// Fastest build
        Fast = "fast",
        /// Balanced
        Default = "default",
        /// Spatial splits: fastest traversal
        Best = "best",
    }
}

impl BuildChoice {
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

settings! {
    /// What it runs on.
    "Device"
    pub struct DeviceSettings {
        /// How rays are traced [default: auto]
        tracer: Option<TracerChoice>, option(value_enum), applies(AppliesTo::ALL);
        /// Traversal kernel of the compute tracer [default: auto]
        traversal: Option<Kernel>, option(value_enum), applies(AppliesTo::ALL);
        /// Ray-triangle intersection test of the compute tracer [default: watertight]
        triangle_test: Option<TriangleTest>, option(value_enum), applies(AppliesTo::ALL);
        /// BVH build quality of the compute tracer [default: auto]
        build: Option<BuildChoice>, option(value_enum), applies(AppliesTo::ALL);
        /// Cache the compute tracer's BVHs in this folder, and reuse them for the same geometry
        /// [env: SKYLIT_BVH_CACHE]
        bvh_cache: Option<PathBuf>, option(value_name = "DIR", value_hint = clap::ValueHint::DirPath), applies(AppliesTo::ALL);
        /// Vulkan device, by index or part of its name (`skylit doctor` lists them)
        device: Option<String>, option(value_name = "INDEX|NAME"), applies(AppliesTo::ALL);
        /// Enable the Vulkan validation layer; any message fails the run
        validation: bool, option(), applies(AppliesTo::ALL);
    }
}

impl DeviceSettings {
    /// How to open the device.
    pub fn options(&self) -> crate::gpu::Options {
        crate::gpu::Options { device: self.device.clone(), validation: self.validation, ..Default::default() }
    }

    /// The quality of hierarchies.
    pub fn build(&self) -> BuildChoice {
        self.build.unwrap_or_default()
    }

    /// How the compute tracer's hierarchy is built, when about so many rays will be traced.
    pub fn build_options(&self, rays: u64) -> BuildOptions {
        let from_environment = || std::env::var_os("SKYLIT_BVH_CACHE").filter(|v| !v.is_empty()).map(PathBuf::from);
        BuildOptions {
            preset: self.build().preset(),
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
            (self.build() != BuildChoice::Auto, "--build"),
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
        if let (Some(TracerChoice::Pipeline | TracerChoice::Query), Some(option)) = (self.tracer, self.about_compute()) {
            return Err(Error::Usage(format!("{option} is about the compute tracer: leave it out, or say --tracer compute")));
        }
        let option = match self.traversal {
            Some(Kernel::Brute) if self.build() != BuildChoice::Auto => Some("--build"),
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
    /// Those of [`DeviceSettings::check`].
    pub fn choose(&self, info: &crate::gpu::DeviceInfo) -> Result<(TracerKind, String, ComputeOptions)> {
        self.check()?;
        let (kind, why) = match (self.tracer.unwrap_or_default(), self.about_compute()) {
            (TracerChoice::Auto, Some(option)) => (TracerKind::Compute, format!("{option} is about this tracer alone")),
            (choice, _) => choice.on(info),
        };
        let options = ComputeOptions {
            kernel: self.traversal.unwrap_or_default(),
            triangle_test: self.triangle_test.unwrap_or_default(),
        };
        Ok((kind, why, options))
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;

    #[test]
    fn options_without_effect_are_refused() {
        #[derive(clap::Parser)]
        struct Alone {
            #[command(flatten)]
            device: DeviceSettings,
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
}
