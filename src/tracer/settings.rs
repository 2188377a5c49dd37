//! Settings of ray tracing: the device, the tracer, and the options of the compute tracer.

use std::path::PathBuf;

use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::error::{Error, Result};
use crate::settings::{AppliesTo, choices, settings};
use crate::tracer::{BuildOptions, ComputeOptions, Kernel, TracerKind, TriangleTest};

choices! {
    /// Which tracer to use.
    pub enum TracerChoice {
        /// The one that suits the device: compute on CPUs, else pipeline, query or compute, the first that is available
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
    /// The tracer on a device, and the reason for it.
    pub fn on(self, info: &crate::gpu::DeviceInfo) -> (TracerKind, String) {
        let requested = |kind| (kind, "requested".to_owned());
        match self {
            Self::Auto => TracerKind::auto(info),
            Self::Pipeline => requested(TracerKind::Pipeline),
            Self::Query => requested(TracerKind::Query),
            Self::Compute => requested(TracerKind::Compute),
        }
    }
}

choices! {
    /// BVH build quality.
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
    /// The build preset; `None` chooses by the numbers of primitives and rays.
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
    /// Settings of the device and the tracer.
    "Device"
    pub struct DeviceSettings {
        /// How rays are traced [default: auto]
        tracer: Option<TracerChoice>, option(value_enum), applies(AppliesTo::ALL);
        /// Traversal kernel of the compute tracer [default: auto]
        traversal: Option<Kernel>, option(value_enum), applies(AppliesTo::ALL), research;
        /// Ray-triangle intersection test of the compute tracer [default: watertight]
        triangle_test: Option<TriangleTest>, option(value_enum), applies(AppliesTo::ALL), research;
        /// BVH build quality of the compute tracer [default: auto]
        build: Option<BuildChoice>, option(value_enum), applies(AppliesTo::ALL), research;
        /// Cache the compute tracer's BVHs in this folder, and reuse them for the same geometry
        /// [env: SKYLIT_BVH_CACHE]
        bvh_cache: Option<PathBuf>, option(value_name = "DIR", value_hint = clap::ValueHint::DirPath), applies(AppliesTo::ALL);
        /// Vulkan device, by index or part of its name (`skylit doctor` lists them)
        device: Option<String>, option(value_name = "INDEX|NAME"), applies(AppliesTo::ALL), basic;
        /// Enable the Vulkan validation layer; any message fails the run
        validation: bool, option(), applies(AppliesTo::ALL);
    }
}

impl DeviceSettings {
    /// Options to open the device with.
    pub fn options(&self) -> crate::gpu::Options {
        crate::gpu::Options { device: self.device.clone(), validation: self.validation, ..Default::default() }
    }

    /// BVH build quality.
    pub fn build(&self) -> BuildChoice {
        self.build.unwrap_or_default()
    }

    /// Build options of the compute tracer's BVH, for about `rays` rays.
    pub fn build_options(&self, rays: u64) -> BuildOptions {
        let from_environment = || std::env::var_os("SKYLIT_BVH_CACHE").filter(|v| !v.is_empty()).map(PathBuf::from);
        BuildOptions {
            preset: self.build().preset(),
            rays,
            cache: self.bvh_cache.clone().or_else(from_environment).map(Cache::new),
            streams: Vec::new(),
        }
    }

    /// Returns true if the compute tracer is requested.
    pub fn is_compute(&self) -> bool {
        self.tracer == Some(TracerChoice::Compute)
    }

    /// The first option given that applies to the compute tracer only.
    pub fn compute_only_option(&self) -> Option<&'static str> {
        let given = [
            (self.traversal.is_some(), "--traversal"),
            (self.triangle_test.is_some(), "--triangle-test"),
            (self.build() != BuildChoice::Auto, "--build"),
            (self.bvh_cache.is_some(), "--bvh-cache"),
        ];
        given.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// Checks the combination of options: none may be given that would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`] for an option of the compute tracer with another tracer, and for a build or
    /// cache option with a traversal that has no BVH or does not cache it.
    pub fn check(&self) -> Result<()> {
        if let (Some(TracerChoice::Pipeline | TracerChoice::Query), Some(option)) =
            (self.tracer, self.compute_only_option())
        {
            return Err(Error::Usage(format!(
                "{option} applies to the compute tracer only: leave it out, or use --tracer compute"
            )));
        }
        let option = match self.traversal {
            Some(Kernel::Brute) if self.build() != BuildChoice::Auto => Some("--build"),
            Some(Kernel::Brute | Kernel::Nearest | Kernel::Direction) if self.bvh_cache.is_some() => {
                Some("--bvh-cache")
            }
            _ => None,
        };
        match (option, self.traversal) {
            (Some(option), Some(kernel)) => Err(Error::Usage(format!(
                "{option} has no effect on --traversal {kernel}, which {}: leave it out, or choose another traversal",
                if kernel == Kernel::Brute { "has no BVH" } else { "does not cache its BVH" }
            ))),
            _ => Ok(()),
        }
    }

    /// The tracer on a device, the reason for it, and the options of the compute tracer. An option
    /// that applies to the compute tracer only chooses it unless `--tracer` is given.
    ///
    /// # Errors
    /// Those of [`DeviceSettings::check`].
    pub fn choose(&self, info: &crate::gpu::DeviceInfo) -> Result<(TracerKind, String, ComputeOptions)> {
        self.check()?;
        let (kind, why) = match (self.tracer.unwrap_or_default(), self.compute_only_option()) {
            (TracerChoice::Auto, Some(option)) => {
                (TracerKind::Compute, format!("{option} applies to this tracer only"))
            }
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
            ("--tracer pipeline --build best", "--build applies to the compute tracer"),
            ("--tracer query --bvh-cache d", "--bvh-cache applies to the compute tracer"),
            ("--tracer pipeline --traversal wide", "--traversal applies to"),
            ("--tracer query --triangle-test watertight", "--triangle-test applies to"),
            ("--traversal brute --build fast", "--build has no effect on --traversal brute"),
            ("--traversal brute --bvh-cache d", "--bvh-cache has no effect on --traversal brute"),
            ("--traversal nearest --bvh-cache d", "--bvh-cache has no effect on --traversal nearest"),
            ("--traversal direction --bvh-cache d", "--bvh-cache has no effect on --traversal direction"),
        ] {
            assert!(refused(line).is_some_and(|e| e.starts_with(about)), "{line}: {:?}", refused(line));
        }
        for line in
            ["", "--tracer pipeline", "--tracer compute --build best --bvh-cache d", "--traversal nearest --build fast"]
        {
            assert_eq!(refused(line), None, "{line}");
        }
        for kernel in ["auto", "wide", "packet"] {
            assert_eq!(refused(&format!("--traversal {kernel} --build best --bvh-cache d")), None);
        }
    }
}
