//! Streams compiled for a tracer.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::{ComputePipeline, Device, HitShaders, RayTracingPipeline, Recorder, Specialization};
use crate::scene::features::SceneFeatures;

/// A stream's SPIR-V for each tracer.
pub struct StreamShaders {
    /// Pass and mode.
    pub name: &'static str,
    compute32: &'static [u8],
    compute64: &'static [u8],
    query: &'static [u8],
    raygen: &'static [u8],
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// The push constants of every stream; `Push` in shaders/common/types.glsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Push {
    /// [`super::Tracer::scene_address`].
    pub scene: u64,
    /// Address of the pass's parameters.
    pub pass: u64,
    /// Index of the first ray.
    pub first: u32,
    /// Rays to trace.
    pub count: u32,
    /// Which sample of each pixel.
    pub sample_index: u32,
    /// Zero.
    pub reserved: u32,
}

enum Pipeline {
    Compute { pipeline: ComputePipeline, rays_per_group: u32 },
    RayTracing(RayTracingPipeline),
}

/// A stream, ready to run.
pub struct Stream(Pipeline);

impl Stream {
    pub(super) fn compute(
        device: &Arc<Device>,
        shaders: &StreamShaders,
        s: &Specialization,
        rays_per_lane: u32,
    ) -> Result<Self> {
        let spirv = if device.info.int64 { shaders.compute64 } else { shaders.compute32 };
        let pipeline = ComputePipeline::new(device, shaders.name, spirv, s)?;
        Ok(Self(Pipeline::Compute { pipeline, rays_per_group: LANES * rays_per_lane }))
    }

    pub(super) fn query(device: &Arc<Device>, shaders: &StreamShaders, s: &Specialization) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, shaders.name, shaders.query, s)?;
        Ok(Self(Pipeline::Compute { pipeline, rays_per_group: LANES }))
    }

    pub(super) fn pipeline(
        device: &Arc<Device>,
        shaders: &StreamShaders,
        s: &Specialization,
        features: SceneFeatures,
    ) -> Result<Self> {
        let shared = HitShaders {
            miss: MISS,
            triangle_closest: TRIANGLE_CLOSEST,
            triangle_any: features.alpha.then_some(TRIANGLE_ANY),
            sphere: features.spheres.then_some([SPHERE_CLOSEST, SPHERE_INTERSECTION]),
        };
        Ok(Self(Pipeline::RayTracing(RayTracingPipeline::new(device, shaders.name, shaders.raygen, &shared, s)?)))
    }

    /// Records the tracing of rays `push.first .. push.first + push.count`. The addresses in `push` must be those of the
    /// tracer that made the stream and of parameters of the stream's pass.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        match &self.0 {
            Pipeline::Compute { pipeline, rays_per_group } => {
                recorder.dispatch(pipeline, push, push.count.div_ceil(*rays_per_group))
            }
            Pipeline::RayTracing(pipeline) => recorder.trace_rays(pipeline, push, push.count),
        }
    }
}
