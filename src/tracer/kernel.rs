//! Which of the compute tracer's kernels runs, and how it tests triangles.

use crate::accel::BuildPreset;
use crate::accel::cache::Cache;
use crate::accel::flatten::FlatScene;
use crate::gpu::DeviceInfo;
use crate::settings::choices;
use crate::shaders::StreamShaders;

choices! {
    /// How the compute tracer finds what a ray meets. All give the same hits; docs/traversal.md compares their speed.
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
    /// Primitives, each instance's counted, and instances that [`Kernel::Brute`] takes at most together. Mesa before 23 leaves
    /// a loop after 65,535 turns; and a launch of the fewest rays should not stall a device for long.
    pub const MAX_BRUTE_TESTS: usize = 40_000;

    /// What [`Kernel::Brute`] goes through for each ray of a scene: primitives, each instance's counted, and instances.
    pub fn brute_tests(flat: &FlatScene) -> usize {
        flat.instances.iter().map(|p| flat.groups[p.group].primitive_count + 1).sum()
    }

    /// What traces coherent streams on a device. A packet has many more turns than a ray and no bound on them: where drivers cut
    /// loops it has to be asked for.
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

/// How the compute tracer works; the other tracers have no such choice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ComputeOptions {
    /// The kernel.
    pub kernel: Kernel,
    /// Its triangle test.
    pub triangle_test: TriangleTest,
}

/// How the compute tracer's hierarchy is built; drivers build those of the other tracers.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// How much time to spend; `None`: what suits the numbers of primitives and of rays ([`BuildPreset::auto`]).
    pub preset: Option<BuildPreset>,
    /// Rays that will be traced, about.
    pub rays: u64,
    /// Where built hierarchies are kept, if anywhere. Only those of the wide kernel are.
    pub cache: Option<Cache>,
    /// Streams that [`super::Tracer::stream`] will be asked for: large scenes' are compiled beside the build.
    pub streams: Vec<&'static StreamShaders>,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { preset: Some(BuildPreset::Default), rays: 0, cache: None, streams: Vec::new() }
    }
}

impl BuildOptions {
    /// What went wrong with the cache: one line each.
    pub fn take_warnings(&self) -> Vec<String> {
        self.cache.as_ref().map(Cache::take_warnings).unwrap_or_default()
    }

    /// The preset for a number of primitives.
    pub fn preset(&self, primitives: usize) -> BuildPreset {
        self.preset.unwrap_or_else(|| BuildPreset::auto(primitives, self.rays))
    }
}

impl From<Kernel> for ComputeOptions {
    fn from(kernel: Kernel) -> Self {
        Self { kernel, ..Default::default() }
    }
}
