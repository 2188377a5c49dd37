//! The compute tracer's large pipelines, compiled while its BVH is built: a driver takes a tenth of
//! a second for each, and half a second without a cached result.

use std::sync::{Arc, Mutex, PoisonError};

use super::kernel::{ComputeOptions, Kernel, TriangleTest};
use super::lane_budget::{USUAL_STACK, lane_budget};
use super::stream;
use crate::accel::features::SceneFeatures;
use crate::error::Result;
use crate::gpu::{ComputePipeline, Device, DeviceInfo, Specialization};
use crate::interface::constants;
use crate::shaders::{Shader, StreamShaders, Traversal, Variant, kernel};

/// Minimum number of primitives for compiling ahead: the BVH of a smaller scene is built sooner
/// than a pipeline is compiled.
const MIN_PRIMITIVES: usize = 100_000;

/// A shader and its specialization.
#[derive(Clone)]
pub(super) struct PipelineSpec {
    pub name: &'static str,
    pub shader: Shader,
    pub specialization: Specialization,
    /// It traces packets and needs full subgroups.
    pub packets: bool,
}

/// Compiled pipelines that no stream has taken yet.
#[derive(Default)]
pub(super) struct PrecompiledPipelines {
    pipelines: Mutex<Vec<(PipelineSpec, ComputePipeline)>>,
}

impl PrecompiledPipelines {
    /// The pipelines that the streams of a scene are expected to need. One that differs from its
    /// expectation is compiled when it is first used; an error in compiling ahead is ignored, since
    /// it occurs again then.
    pub fn expected(
        info: &DeviceInfo,
        features: SceneFeatures,
        options: ComputeOptions,
        streams: &[&'static StreamShaders],
        primitives: usize,
    ) -> Vec<PipelineSpec> {
        let fast = options.kernel.is_wide();
        if !fast || primitives < MIN_PRIMITIVES {
            return Vec::new();
        }
        let s = specialization(info, features, options, USUAL_STACK);
        let mut out: Vec<PipelineSpec> = Vec::new();
        for shaders in streams {
            let spec = large(info, options.kernel, shaders, &s);
            // streams share the kernel that traces rays one by one
            if !out.iter().any(|r| r.is(&spec)) {
                out.push(spec);
            }
        }
        out
    }

    /// Compiles pipelines; those that fail are left out.
    pub fn compile(device: &Arc<Device>, specs: Vec<PipelineSpec>) -> Self {
        let compiled = specs.into_iter().filter_map(|r| r.compile(device).ok().map(|p| (r, p)));
        Self { pipelines: Mutex::new(compiled.collect()) }
    }

    /// Takes the pipeline, compiling it now if that was not done ahead.
    pub fn take(&self, device: &Arc<Device>, spec: &PipelineSpec) -> Result<ComputePipeline> {
        let compiled = {
            let mut all = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
            all.iter().position(|(r, _)| r.is(spec)).map(|k| all.swap_remove(k).1)
        };
        compiled.map_or_else(|| spec.compile(device), Ok)
    }
}

impl PipelineSpec {
    fn compile(&self, device: &Arc<Device>) -> Result<ComputePipeline> {
        let make = if self.packets { ComputePipeline::with_full_subgroups } else { ComputePipeline::new };
        make(device, self.name, &self.shader, &self.specialization)
    }

    fn is(&self, other: &PipelineSpec) -> bool {
        self.shader == other.shader && self.specialization == other.specialization
    }
}

/// Specialization of the compute tracer's shaders for a device, a scene and options.
pub(super) fn specialization(
    info: &DeviceInfo,
    features: SceneFeatures,
    options: ComputeOptions,
    stack: u32,
) -> Specialization {
    let (rays_per_lane, max_iterations) = lane_budget(info);
    stream::scene_specialization(features)
        .set(constants::STACK_SIZE, stack)
        .set(constants::RAYS_PER_LANE, rays_per_lane)
        .set(constants::BY_DIRECTION, options.kernel == Kernel::Direction)
        .set(constants::WATERTIGHT, options.triangle_test == TriangleTest::Watertight)
        .set(constants::SUBGROUP_SIZE, info.limits.subgroup_size)
        .set(constants::MAX_ITERATIONS, max_iterations)
}

/// Whether the stream is traced in packets.
pub(super) fn in_packets(info: &DeviceInfo, kernel: Kernel, shaders: &StreamShaders) -> bool {
    let wanted = kernel == Kernel::Packet || shaders.rays.are_coherent();
    shaders.variant(Variant::Packet).is_some() && wanted && kernel.for_coherent(info) == Kernel::Packet
}

/// The pipeline of the compute tracer that traces the stream.
pub(super) fn large(
    info: &DeviceInfo,
    chosen: Kernel,
    shaders: &'static StreamShaders,
    s: &Specialization,
) -> PipelineSpec {
    let packet = shaders.variant(Variant::Packet).filter(|_| in_packets(info, chosen, shaders));
    let own = |traversal| kernel(traversal, shaders.mode, stream::has_ballots(info));
    let (name, shader) = match (packet, chosen) {
        (Some(shader), _) => (shaders.name(), shader),
        (None, Kernel::Auto | Kernel::Wide | Kernel::Packet) => ("wide kernel", own(Traversal::Wide)),
        (None, Kernel::Nearest | Kernel::Direction) => ("binary kernel", own(Traversal::Binary)),
        (None, Kernel::Brute) => ("brute kernel", own(Traversal::Brute)),
    };
    PipelineSpec { name, shader, specialization: s.clone(), packets: packet.is_some() }
}
