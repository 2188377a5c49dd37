//! Settings of ray tracing: the device, the tracer, and the options of the compute tracer.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::accel::lab::influence::Placement;
use crate::accel::lab::{Builder, HeuristicChoice, RayDistribution};
use crate::error::{Error, Result};
#[cfg(feature = "cli")]
use crate::settings::parse::parse_vector;
use crate::settings::{AppliesTo, choices, settings};
use crate::tracer::{BuildOptions, ComputeOptions, DeviceBuilder, Kernel, LocalOptions, TracerKind, TriangleTest};

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
        /// On the device, by parallel clustering
        Device = "device",
    }
}

impl BuildChoice {
    /// See [`BuildOptions::on_device`].
    pub fn on_device(self) -> Option<usize> {
        (self == BuildChoice::Device).then_some(DeviceBuilder::MIN_LEAVES)
    }

    /// The build preset; `None` chooses by the numbers of primitives and rays.
    pub fn preset(self) -> Option<BuildPreset> {
        match self {
            BuildChoice::Auto | BuildChoice::Device => None,
            BuildChoice::Fast => Some(BuildPreset::Fast),
            BuildChoice::Default => Some(BuildPreset::Default),
            BuildChoice::Best => Some(BuildPreset::Best),
        }
    }
}

choices! {
    /// How a BVH is built: a quality, or rules of the laboratory (docs/reference/bvh.md), of which those of
    /// projected areas and facing planes are for rays of one direction or point.
    pub enum BuildMethod {
        /// Chosen by the number of primitives and rays
        Auto = "auto",
        /// Fastest build
        Fast = "fast",
        /// Balanced
        Default = "default",
        /// Spatial splits: fastest traversal
        Best = "best",
        /// On the device, by parallel clustering
        Device = "device",
        /// Surface area, planes across the longest axis
        SahLongest = "sah-longest",
        /// Surface area, planes across all axes
        Sah = "sah",
        /// Surface area, planes along given rays first
        SahSpfh = "sah-spfh",
        /// Area projected along given rays, planes across the longest axis
        PahLongest = "pah-longest",
        /// Area projected along given rays, planes across all axes
        Pah = "pah",
        /// Area projected along given rays, planes along them first
        PahSpfh = "pah-spfh",
    }
}

impl BuildMethod {
    /// The build preset; `None` for rules of the laboratory, and where the numbers of primitives
    /// and rays choose.
    pub fn preset(self) -> Option<BuildPreset> {
        match self {
            Self::Fast => Some(BuildPreset::Fast),
            Self::Default => Some(BuildPreset::Default),
            Self::Best => Some(BuildPreset::Best),
            _ => None,
        }
    }

    /// The rules of the laboratory; `None` for presets.
    pub fn heuristic(self) -> Option<HeuristicChoice> {
        match self {
            Self::Auto | Self::Fast | Self::Default | Self::Best | Self::Device => None,
            Self::SahLongest => Some(HeuristicChoice::SahLongest),
            Self::Sah => Some(HeuristicChoice::Sah),
            Self::SahSpfh => Some(HeuristicChoice::SahSpfh),
            Self::PahLongest => Some(HeuristicChoice::PahLongest),
            Self::Pah => Some(HeuristicChoice::Pah),
            Self::PahSpfh => Some(HeuristicChoice::PahSpfh),
        }
    }

    /// The builder for rays, with the default preset where it is left open.
    pub fn builder(self, rays: RayDistribution) -> Builder {
        let preset = Builder::Preset(self.preset().unwrap_or_default());
        self.heuristic().map_or(preset, |h| Builder::Heuristic(h.heuristic(rays)))
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
        /// BVH build of the compute tracer [default: auto]
        ///
        /// It is a quality, or the device, or for --traversal nearest and direction a rule for rays that
        /// are known.
        build: Option<BuildMethod>, option(value_enum), applies(AppliesTo::ALL), research;
        /// Direction of the rays that --build sah-spfh and pah... are for
        build_direction: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, conflicts_with = "build_eye", allow_hyphen_values = true), applies(AppliesTo::ALL), research;
        /// Point through which the rays pass that --build sah-spfh and pah... are for
        build_eye: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true), applies(AppliesTo::ALL), research;
        /// Also build trees of influence areas by --build: `scene`, its lights and cameras, or a file
        ///
        /// A ray that starts in an area and agrees with its rays is traced in the area's tree first.
        /// Images are the same.
        build_areas: Option<String>,
            option(value_name = "FILE.json|scene", value_hint = clap::ValueHint::FilePath, conflicts_with_all = ["build_direction", "build_eye"]), applies(AppliesTo::ALL), research;
        /// Cache the compute tracer's BVHs in this folder, and reuse them [env: SKYLIT_BVH_CACHE]
        ///
        /// A BVH is reused for the same geometry.
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

    /// How the BVH is built.
    pub fn build(&self) -> BuildMethod {
        self.build.unwrap_or_default()
    }

    /// Build options of the compute tracer's BVH, for about `rays` rays.
    ///
    /// # Errors
    /// Those of [`Placement::read_list`] for a file of influence areas.
    pub fn build_options(&self, rays: u64) -> Result<BuildOptions> {
        let from_environment = || std::env::var_os("SKYLIT_BVH_CACHE").filter(|v| !v.is_empty()).map(PathBuf::from);
        let heuristic = self.build().heuristic().map(|h| h.heuristic(self.build_rays().unwrap_or_default()));
        let local = match (&self.build_areas, heuristic) {
            (Some(_), Some(heuristic)) => {
                let areas = self.areas_file().map(Placement::read_list).transpose()?;
                let areas = areas.map(|list| list.iter().map(|p| p.area(DVec3::ZERO)).collect());
                Some(LocalOptions { areas, camera: None, heuristic })
            }
            _ => None,
        };
        Ok(BuildOptions {
            preset: self.build().preset(),
            heuristic: heuristic.filter(|_| local.is_none()),
            local,
            on_device: (self.build() == BuildMethod::Device).then_some(DeviceBuilder::MIN_LEAVES),
            rays,
            cache: self.bvh_cache.clone().or_else(from_environment).map(Cache::new),
            streams: Vec::new(),
        })
    }

    /// The file of influence areas that have trees of their own, if they come from one.
    pub fn areas_file(&self) -> Option<&Path> {
        self.build_areas.as_deref().filter(|a| *a != "scene").map(Path::new)
    }

    /// The builder of the trees of a scene's groups and of its top level, for rays relative to
    /// `origin`; the default preset where numbers of primitives and rays choose.
    pub fn builder(&self, origin: DVec3) -> Builder {
        match self.build().builder(self.build_rays().unwrap_or_default()) {
            Builder::Heuristic(_) if self.build_areas.is_some() => Builder::Preset(BuildPreset::default()),
            Builder::Heuristic(h) => Builder::Heuristic(h.for_rays(h.rays.relative_to(origin))),
            preset => preset,
        }
    }

    /// The rays that the BVH is built for, in world space; `None` where none are given.
    pub fn build_rays(&self) -> Option<RayDistribution> {
        self.build_direction.map(RayDistribution::Parallel).or(self.build_eye.map(RayDistribution::Point))
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
            (self.build() != BuildMethod::Auto, "--build"),
            (self.build_direction.is_some(), "--build-direction"),
            (self.build_eye.is_some(), "--build-eye"),
            (self.build_areas.is_some(), "--build-areas"),
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
        self.check_heuristic()?;
        if let (Some(TracerChoice::Pipeline | TracerChoice::Query), Some(option)) =
            (self.tracer, self.compute_only_option())
        {
            return Err(Error::Usage(format!(
                "{option} applies to the compute tracer only: leave it out, or use --tracer compute"
            )));
        }
        let option = match self.traversal {
            Some(Kernel::Brute) if self.build() != BuildMethod::Auto => Some("--build"),
            Some(Kernel::Nearest | Kernel::Direction) if self.build() == BuildMethod::Device => Some("--build device"),
            Some(Kernel::Brute | Kernel::Nearest | Kernel::Direction) if self.bvh_cache.is_some() => {
                Some("--bvh-cache")
            }
            _ => None,
        };
        match (option, self.traversal) {
            (Some(option), Some(kernel)) => Err(Error::Usage(format!(
                "{option} has no effect on --traversal {kernel}, which {}: leave it out, or choose another traversal",
                match kernel {
                    Kernel::Brute => "has no BVH",
                    _ if self.bvh_cache.is_some() => "does not cache its BVH",
                    _ => "has a BVH of binary nodes, which the host builds",
                }
            ))),
            _ => Ok(()),
        }
    }

    /// As [`DeviceSettings::check`], and reads the files that options name: a mistake in one costs
    /// no loading of a scene.
    ///
    /// # Errors
    /// Those of [`DeviceSettings::check`] and of [`Placement::read_list`].
    pub fn check_with_files(&self) -> Result<()> {
        self.check()?;
        self.areas_file().map_or(Ok(()), |file| Placement::read_list(file).map(|_| ()))
    }

    /// Checks the options of builds for known rays.
    fn check_heuristic(&self) -> Result<()> {
        let rays = match (self.build_direction, self.build_eye) {
            (Some(_), _) | (_, Some(_)) if self.build_areas.is_some() => {
                return Err(Error::Usage(
                    "--build-areas says what the rays are: leave out --build-direction and --build-eye".into(),
                ));
            }
            (Some(d), _) if d == DVec3::ZERO => {
                return Err(Error::Usage("--build-direction 0,0,0 is no direction: give another".into()));
            }
            (Some(_), _) => Some("--build-direction"),
            (_, Some(_)) => Some("--build-eye"),
            _ => None,
        };
        let build = self.build();
        match (build.heuristic(), rays) {
            (Some(_), _) if !matches!(self.traversal, Some(Kernel::Nearest | Kernel::Direction)) => Err(Error::Usage(
                format!("--build {build} is for the binary kernels only: add --traversal nearest or direction"),
            )),
            (None, _) if self.build_areas.is_some() => Err(Error::Usage(format!(
                "--build-areas has no effect on --build {build}: leave it out, or use --build pah-spfh"
            ))),
            (Some(_), None) if self.build_areas.is_some() => Ok(()),
            (Some(h), None) if h.needs_rays() => Err(Error::Usage(format!(
                "--build {build} is for rays that are known: add --build-direction X,Y,Z, --build-eye X,Y,Z or \
                 --build-areas scene"
            ))),
            (h, Some(option)) if !h.is_some_and(HeuristicChoice::needs_rays) => Err(Error::Usage(format!(
                "{option} has no effect on --build {build}: leave it out, or use --build pah-spfh"
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
    use crate::settings::parse::parse_args;

    #[test]
    fn options_without_effect_are_refused() {
        let refused = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            parse_args::<DeviceSettings>(&words).unwrap().check().err().map(|e| {
                assert_eq!(e.exit_code(), 64);
                e.to_string()
            })
        };

        // an option that nothing takes
        for (line, about) in [
            ("--tracer pipeline --build best", "--build applies to the compute tracer"),
            ("--tracer query --bvh-cache d", "--bvh-cache applies to the compute tracer"),
            ("--tracer pipeline --traversal wide", "--traversal applies to"),
            ("--tracer query --triangle-test watertight", "--triangle-test applies to"),
            ("--traversal brute --build fast", "--build has no effect on --traversal brute"),
            ("--traversal brute --bvh-cache d", "--bvh-cache has no effect on --traversal brute"),
            ("--traversal nearest --bvh-cache d", "--bvh-cache has no effect on --traversal nearest"),
            ("--build pah", "--build pah is for the binary kernels only"),
            ("--traversal wide --build sah", "--build sah is for the binary kernels only"),
            ("--traversal nearest --build pah", "--build pah is for rays that are known"),
            ("--traversal nearest --build sah --build-eye 1,2,3", "--build-eye has no effect on --build sah"),
            ("--traversal nearest --build-areas scene", "--build-areas has no effect on --build auto"),
            ("--build pah --build-areas scene", "--build pah is for the binary kernels only"),
            ("--tracer query --build-areas scene", "--build-areas has no effect"),
            ("--build-direction 1,2,3", "--build-direction has no effect on --build auto"),
            ("--traversal nearest --build pah --build-direction 0,0,0", "--build-direction 0,0,0 is no direction"),
            ("--traversal direction --bvh-cache d", "--bvh-cache has no effect on --traversal direction"),
            ("--traversal nearest --build device", "--build device has no effect on --traversal nearest"),
            ("--tracer query --build device", "--build applies to the compute tracer"),
        ] {
            assert!(refused(line).is_some_and(|e| e.starts_with(about)), "{line}: {:?}", refused(line));
        }
        for line in [
            "",
            "--tracer pipeline",
            "--tracer compute --build best --bvh-cache d",
            "--traversal nearest --build fast",
            "--traversal nearest --build sah",
            "--traversal direction --build pah-spfh --build-direction 0,-1,0",
            "--traversal nearest --build pah --build-areas scene",
            "--traversal nearest --build sah-longest --build-areas areas.json",
        ] {
            assert_eq!(refused(line), None, "{line}");
        }
        for kernel in ["auto", "wide", "packet"] {
            assert_eq!(refused(&format!("--traversal {kernel} --build best --bvh-cache d")), None);
        }
    }
}
