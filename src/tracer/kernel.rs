//! Which of the compute tracer's kernels runs, and how it tests triangles.

use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::influence::InfluenceArea;
use crate::accel::lab::{Builder, Heuristic};
use crate::gpu::DeviceInfo;
use crate::scene::Camera;
use crate::settings::choices;
use crate::shaders::StreamShaders;

choices! {
    /// Traversal kernel of the compute tracer. All give the same hits; docs/design/tracers.md compares their speed.
    pub enum Kernel {
        /// seven-wide nodes; packets for coherent rays, else each ray by itself
        Auto = "auto",
        /// seven-wide nodes, each ray by itself
        Wide = "wide",
        /// seven-wide nodes, the rays of a subgroup together
        Packet = "packet",
        /// binary nodes, the nearest child first
        Nearest = "nearest",
        /// binary nodes, children in the order of the ray's direction on the split axis
        Direction = "direction",
        /// every primitive of every instance, no hierarchy
        Brute = "brute",
    }
}

impl Kernel {
    /// Maximum number of intersection tests per ray for [`Kernel::Brute`] (see
    /// [`Kernel::brute_tests`]). Mesa before 23 leaves a loop after 65,535 iterations, and even a
    /// small launch should not occupy a device for long.
    pub const MAX_BRUTE_TESTS: usize = 40_000;

    /// Number of tests that [`Kernel::Brute`] does for each ray: the instances, and the primitives
    /// of each.
    pub fn brute_tests(flat: &FlatScene) -> usize {
        flat.instances.iter().map(|p| flat.groups[p.group].primitive_count + 1).sum()
    }

    /// Whether it traverses the BVH of wide nodes.
    pub fn is_wide(self) -> bool {
        matches!(self, Self::Auto | Self::Wide | Self::Packet)
    }

    /// The kernel for coherent streams on a device. A packet's loop has many more iterations than a
    /// single ray's, without a bound: on drivers that end long loops early, packets run only when
    /// requested.
    pub fn for_coherent(self, info: &DeviceInfo) -> Kernel {
        match self {
            Kernel::Auto if info.packets() && !info.cuts_long_loops() => Kernel::Packet,
            Kernel::Packet if info.packets() => Kernel::Packet,
            Kernel::Auto | Kernel::Packet => Kernel::Wide,
            other => other,
        }
    }
}

choices! {
    /// The compute tracer's test of a ray against a triangle.
    pub enum TriangleTest {
        /// Watertight (Woop, Benthin, Wald 2013): no ray slips between triangles that share an edge
        Watertight = "watertight",
        /// Moeller-Trumbore (1997), for benchmarks: not watertight
        MollerTrumbore = "moller-trumbore",
    }
}

/// Options of the compute tracer; the hardware tracers have none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ComputeOptions {
    /// The kernel.
    pub kernel: Kernel,
    /// Triangle test of the kernel.
    pub triangle_test: TriangleTest,
}

/// Trees of influence areas: places from which rays of a known distribution start (Falcone 2024).
/// Hits are the same without them.
#[derive(Clone, Debug)]
pub struct LocalOptions {
    /// The areas, in world space; `None` for those of the scene's lights and cameras.
    pub areas: Option<Vec<InfluenceArea>>,
    /// The camera of the image, which may be none of the scene's.
    pub camera: Option<Camera>,
    /// Rules of the trees; their rays are those of each area.
    pub heuristic: Heuristic,
}

/// Build options of the compute tracer's BVH; drivers build those of the hardware tracers.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// Build quality; `None` chooses by the numbers of primitives and rays ([`BuildPreset::auto`]).
    pub preset: Option<BuildPreset>,
    /// Rules of the laboratory in place of a preset, for the binary kernels only. Its rays are in
    /// world space.
    pub heuristic: Option<Heuristic>,
    /// Trees of influence areas besides that of the scene, for the binary kernels only.
    pub local: Option<LocalOptions>,
    /// Build the trees of the wide kernels over at least so many leaves on the device; `None`
    /// builds all of them on the host.
    pub on_device: Option<usize>,
    /// Approximate number of rays that will be traced.
    pub rays: u64,
    /// Cache of built hierarchies, used for those of the wide kernel only; `None` caches nothing.
    pub cache: Option<Cache>,
    /// Streams that will be requested with [`super::Tracer::stream`]; for large scenes they are
    /// compiled while the BVH is built.
    pub streams: Vec<&'static StreamShaders>,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            preset: Some(BuildPreset::Default),
            heuristic: None,
            local: None,
            on_device: None,
            rays: 0,
            cache: None,
            streams: Vec::new(),
        }
    }
}

impl BuildOptions {
    /// Takes the warnings of the cache, one line each.
    pub fn take_warnings(&self) -> Vec<String> {
        self.cache.as_ref().map(Cache::take_warnings).unwrap_or_default()
    }

    /// The preset for a number of primitives.
    pub fn preset(&self, primitives: usize) -> BuildPreset {
        self.preset.unwrap_or_else(|| BuildPreset::auto(primitives, self.rays))
    }

    /// The builder of the binary kernels' trees for a number of primitives. The rays of a heuristic
    /// are relative to the origin of `flat`.
    pub fn builder(&self, flat: &FlatScene, primitives: usize) -> Builder {
        let relative = |h: Heuristic| Builder::Heuristic(h.for_rays(h.rays.relative_to(flat.origin)));
        self.heuristic.map_or_else(|| Builder::Preset(self.preset(primitives)), relative)
    }
}

impl From<Kernel> for ComputeOptions {
    fn from(kernel: Kernel) -> Self {
        Self { kernel, ..Default::default() }
    }
}
