//! Streams compiled for a tracer.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::{ComputePipeline, Device, HitShaders, RayTracingPipeline, Recorder, Specialization};
use crate::scene::features::SceneFeatures;

/// What a stream asks of its rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Whether something is in the way.
    Any,
    /// The nearest hit.
    Closest,
}

/// A stream's SPIR-V for each tracer.
pub struct StreamShaders {
    /// Pass and mode.
    pub name: &'static str,
    mode: Mode,
    generate: &'static [u8],
    deliver: &'static [u8],
    reference: &'static [u8],
    brute: &'static [u8],
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

/// Rays that the compute tracer's buffers hold between the steps of a launch.
pub(super) const LAUNCH_RAYS: u32 = 1 << 19;

enum Pipeline {
    /// One compute shader over all rays.
    Single {
        pipeline: ComputePipeline,
        rays_per_group: u32,
    },
    /// Generate, trace, deliver.
    Steps {
        generate: ComputePipeline,
        trace: Arc<ComputePipeline>,
        deliver: ComputePipeline,
        rays_per_group: u32,
    },
    RayTracing(RayTracingPipeline),
}

/// A stream, ready to run.
pub struct Stream(Pipeline);

impl StreamShaders {
    /// What the stream asks of its rays.
    pub(super) fn mode(&self) -> Mode {
        self.mode
    }
}

impl Stream {
    /// For the compute tracer's fast kernel, which streams share.
    pub(super) fn steps(
        device: &Arc<Device>,
        shaders: &StreamShaders,
        s: &Specialization,
        trace: Arc<ComputePipeline>,
        rays_per_lane: u32,
    ) -> Result<Self> {
        Ok(Self(Pipeline::Steps {
            generate: ComputePipeline::new(device, shaders.name, shaders.generate, s)?,
            trace,
            deliver: ComputePipeline::new(device, shaders.name, shaders.deliver, s)?,
            rays_per_group: LANES * rays_per_lane,
        }))
    }

    /// For the compute tracer's readable reference.
    pub(super) fn reference(
        device: &Arc<Device>,
        shaders: &StreamShaders,
        s: &Specialization,
        rays_per_lane: u32,
    ) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, shaders.name, shaders.reference, s)?;
        Ok(Self(Pipeline::Single { pipeline, rays_per_group: LANES * rays_per_lane }))
    }

    /// For the compute tracer without a hierarchy.
    pub(super) fn brute(device: &Arc<Device>, shaders: &StreamShaders, s: &Specialization) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, shaders.name, shaders.brute, s)?;
        Ok(Self(Pipeline::Single { pipeline, rays_per_group: LANES }))
    }

    pub(super) fn query(device: &Arc<Device>, shaders: &StreamShaders, s: &Specialization) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, shaders.name, shaders.query, s)?;
        Ok(Self(Pipeline::Single { pipeline, rays_per_group: LANES }))
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
            Pipeline::Single { pipeline, rays_per_group } => {
                recorder.dispatch(pipeline, push, push.count.div_ceil(*rays_per_group))
            }
            Pipeline::Steps { generate, trace, deliver, rays_per_group } => {
                for first in (0..push.count).step_by(LAUNCH_RAYS as usize) {
                    let push = Push { first: push.first + first, count: LAUNCH_RAYS.min(push.count - first), ..*push };
                    // the steps hand rays and hits on in memory, and so does one launch to the next
                    recorder.barrier();
                    recorder.dispatch(generate, &push, push.count.div_ceil(LANES));
                    recorder.barrier();
                    recorder.dispatch(trace, &push, push.count.div_ceil(*rays_per_group));
                    recorder.barrier();
                    recorder.dispatch(deliver, &push, push.count.div_ceil(LANES));
                }
            }
            Pipeline::RayTracing(pipeline) => recorder.trace_rays(pipeline, push, push.count),
        }
    }
}
