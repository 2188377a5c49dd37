//! The compute tracer's large pipelines, compiled while its hierarchy is built: a driver takes a tenth of a second for them, and half
//! a second where it has not met them before.

use std::sync::{Arc, Mutex, PoisonError};

use super::compute::{self, lane_budget};
use super::kernel::{ComputeOptions, Kernel, TriangleTest};
use super::stream;
use crate::accel::features::SceneFeatures;
use crate::error::Result;
use crate::gpu::{ComputePipeline, Device, DeviceInfo, Specialization};
use crate::interface::constants;
use crate::shaders::{Rays, Shader, StreamShaders, Variant, wide_kernel};

/// Scenes of fewer primitives are built before a pipeline is compiled.
const WORTHWHILE: usize = 100_000;

/// A shader and what it is specialised to.
#[derive(Clone)]
pub(super) struct PipelineSpec {
    pub name: &'static str,
    pub shader: &'static Shader,
    pub specialization: Specialization,
    /// Its lanes work together.
    pub packets: bool,
}

/// What was compiled and not yet asked for.
#[derive(Default)]
pub(super) struct PrecompiledPipelines {
    pipelines: Mutex<Vec<(PipelineSpec, ComputePipeline)>>,
}

impl PrecompiledPipelines {
    /// What the streams' recipes for a scene are taken to be. A recipe that turns out another is compiled when it is asked for, and an
    /// error is found again then.
    pub fn recipes(
        info: &DeviceInfo,
        features: SceneFeatures,
        options: ComputeOptions,
        streams: &[&'static StreamShaders],
        primitives: usize,
    ) -> Vec<PipelineSpec> {
        let fast = matches!(options.kernel, Kernel::Auto | Kernel::Wide | Kernel::Packet);
        if !fast || primitives < WORTHWHILE {
            return Vec::new();
        }
        let s = specialization(info, features, options, compute::USUAL_STACK);
        let mut out: Vec<PipelineSpec> = Vec::new();
        for shaders in streams {
            let recipe = large(info, options.kernel, shaders, &s);
            // streams share the kernel that traces rays one by one
            if !out.iter().any(|r| r.is(&recipe)) {
                out.push(recipe);
            }
        }
        out
    }

    /// Compiles them.
    pub fn compile(device: &Arc<Device>, recipes: Vec<PipelineSpec>) -> Self {
        let compiled = recipes.into_iter().filter_map(|r| r.compile(device).ok().map(|p| (r, p)));
        Self { pipelines: Mutex::new(compiled.collect()) }
    }

    /// The pipeline, compiled now unless it is there.
    pub fn take(&self, device: &Arc<Device>, recipe: &PipelineSpec) -> Result<ComputePipeline> {
        let there = {
            let mut all = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
            all.iter().position(|(r, _)| r.is(recipe)).map(|k| all.swap_remove(k).1)
        };
        there.map_or_else(|| recipe.compile(device), Ok)
    }
}

impl PipelineSpec {
    fn compile(&self, device: &Arc<Device>) -> Result<ComputePipeline> {
        let make = if self.packets { ComputePipeline::with_full_subgroups } else { ComputePipeline::new };
        make(device, self.name, self.shader, &self.specialization)
    }

    fn is(&self, other: &PipelineSpec) -> bool {
        std::ptr::eq(self.shader, other.shader) && self.specialization == other.specialization
    }
}

/// What scenes, devices and options make of the compute tracer's shaders.
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

/// Is the stream traced in packets?
pub(super) fn in_packets(info: &DeviceInfo, kernel: Kernel, shaders: &StreamShaders) -> bool {
    let wanted = kernel == Kernel::Packet || shaders.rays == Rays::Camera;
    shaders.variant(Variant::Packet).is_some() && wanted && kernel.for_coherent(info) == Kernel::Packet
}

/// The shader of the fast kernels that traces the stream.
pub(super) fn large(info: &DeviceInfo, kernel: Kernel, shaders: &'static StreamShaders, s: &Specialization) -> PipelineSpec {
    let packet = shaders.variant(Variant::Packet).filter(|_| in_packets(info, kernel, shaders));
    let (name, shader) = match packet {
        Some(shader) => (shaders.name, shader),
        None => ("wide kernel", wide_kernel(shaders.mode, info.int64)),
    };
    PipelineSpec { name, shader, specialization: s.clone(), packets: packet.is_some() }
}
