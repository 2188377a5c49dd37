//! Streams compiled for a tracer.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::compute::HIT_BYTES;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, ComputePipeline, Device, HitShaders, RayTracingPipeline, Recorder, Specialization};
use crate::ray::Ray;
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
    /// Pass: what its time is listed under where a stream is one shader.
    pub pass: &'static str,
    /// What the time of each step is listed under where a stream is three.
    pub steps: [&'static str; 3],
    // its rays are in memory: there is no first step
    queue: bool,
    // its neighbouring rays take nearly the same way
    coherent: bool,
    mode: Mode,
    generate: &'static [u8],
    generate_64: &'static [u8],
    deliver: &'static [u8],
    deliver_64: &'static [u8],
    packet: &'static [u8],
    reference: &'static [u8],
    brute: &'static [u8],
    query: &'static [u8],
    raygen: &'static [u8],
    // empty: its rays are not the camera's
    visibility: &'static [u8],
}

/// A compute shader's SPIR-V.
pub struct ComputeShader {
    name: &'static str,
    plain: &'static [u8],
    // for devices with 64-bit integers
    int64: &'static [u8],
}

impl ComputeShader {
    /// Compiles it for a device.
    pub fn pipeline(&self, device: &Arc<Device>) -> Result<ComputePipeline> {
        self.specialized(device, &Specialization::default())
    }

    /// Compiles it for a device, with constants that differ from what the shader says.
    pub fn specialized(&self, device: &Arc<Device>, constants: &Specialization) -> Result<ComputePipeline> {
        let spirv = if device.info.int64 { self.int64 } else { self.plain };
        ComputePipeline::new(device, self.name, spirv, constants)
    }
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
    /// Address of ray number `first` of a queue ([`super::queue`]), 32 bytes each; 0 for streams that make their own rays. Where those
    /// were drawn: of what was drawn ([`crate::render::raster`]).
    pub rays: u64,
    /// Address of a `u32`: how many rays the queue holds; 0 when `count` says it.
    pub queued: u64,
    /// Index of the first ray.
    pub first: u32,
    /// Rays to trace; of a queue: at most.
    pub count: u32,
    /// The first sample of each pixel.
    pub sample_index: u32,
    /// 2^`sample_bits` samples of each pixel are taken; their rays follow each other.
    pub sample_bits: u32,
}

/// Rays that the compute tracer's buffers hold between the steps of a launch.
pub const LAUNCH_RAYS: u32 = 1 << 19;
/// Rays of each lane of a packet: `PACKET_RAYS` of build.rs.
const PACKET_RAYS: u32 = 2;
/// Stands where a result will be: `UNFINISHED` of shaders/trace/launch.glsl.
const UNFINISHED: u32 = 0x7fc0_dead;

#[derive(Clone)]
enum Pipeline {
    /// One compute shader over all rays.
    Single {
        pipeline: Arc<ComputePipeline>,
        rays_per_group: u32,
    },
    /// Generate, trace, deliver.
    Steps {
        // none: the rays are in memory
        generate: Option<Arc<ComputePipeline>>,
        trace: Arc<ComputePipeline>,
        deliver: Arc<ComputePipeline>,
        rays_per_group: u32,
        memory: LaunchMemory,
        // bytes of a result
        record: u64,
    },
    RayTracing(Arc<RayTracingPipeline>),
    /// One compute shader over all rays, whose hits are known but for where.
    Drawn(Arc<ComputePipeline>),
}

/// Where a launch's rays and results are between its steps.
#[derive(Clone)]
pub(super) struct LaunchMemory {
    pub rays: Arc<Buffer>,
    pub hits: Arc<Buffer>,
    /// A u32 per work-group: rays that its lanes have taken.
    pub counters: Arc<Buffer>,
}

/// A stream, ready to run. Clones share what was compiled.
#[derive(Clone)]
pub struct Stream {
    pipeline: Pipeline,
    shaders: &'static StreamShaders,
}

/// What a scene does not need is not compiled.
pub(crate) fn scene_specialization(features: SceneFeatures) -> Specialization {
    let s = Specialization::default()
        .set(0, features.alpha as u32)
        .set(1, features.spheres as u32)
        .set(2, features.single_level as u32)
        .set(10, features.coverage as u32)
        .set(12, features.deep_texels as u32);
    match features.shading {
        Some(bits) => s.set(9, bits),
        None => s,
    }
}

/// The fast kernel that traces rays one by one.
pub(super) fn wide_kernel(mode: Mode, int64: bool) -> &'static [u8] {
    match (mode, int64) {
        (Mode::Any, true) => WIDE_ANY_64,
        (Mode::Any, false) => WIDE_ANY_32,
        (Mode::Closest, true) => WIDE_CLOSEST_64,
        (Mode::Closest, false) => WIDE_CLOSEST_32,
    }
}

impl std::fmt::Debug for StreamShaders {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl StreamShaders {
    /// What the stream asks of its rays.
    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    /// Do neighbouring rays take nearly the same way through a scene?
    pub(super) fn is_coherent(&self) -> bool {
        self.coherent
    }

    /// What traces it in packets.
    pub(super) fn packet(&self) -> &'static [u8] {
        self.packet
    }

    /// Can it be traced in packets? What comes from a queue is in no order.
    pub(super) fn has_packets(&self) -> bool {
        !self.packet.is_empty()
    }
}

/// Work-groups along x, y and z that take at least `parts` parts, in runs of `run` (shaders/trace/spread.glsl).
fn spread(parts: u32, run: u32) -> [u32; 3] {
    [run, parts.div_ceil(run * SPREAD), SPREAD]
}

/// One of a stream's shaders.
fn compile(
    device: &Arc<Device>,
    shaders: &StreamShaders,
    spirv: &'static [u8],
    s: &Specialization,
) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::new(device, shaders.name, spirv, s).map(Arc::new)
}

impl Stream {
    /// What it was compiled from.
    pub(super) fn shaders(&self) -> &'static StreamShaders {
        self.shaders
    }

    /// For the compute tracer's fast kernel, which streams share.
    pub(super) fn steps(
        device: &Arc<Device>,
        shaders: &'static StreamShaders,
        s: &Specialization,
        trace: Arc<ComputePipeline>,
        rays_per_lane: u32,
        memory: LaunchMemory,
    ) -> Result<Self> {
        let int64 = device.info.int64;
        let ballot = int64 && device.info.limits.subgroup_ballot;
        let generate = if ballot { shaders.generate_64 } else { shaders.generate };
        let deliver = if ballot { shaders.deliver_64 } else { shaders.deliver };
        let pipeline = Pipeline::Steps {
            generate: match shaders.queue {
                true => None,
                false => Some(compile(device, shaders, generate, s)?),
            },
            trace,
            deliver: compile(device, shaders, deliver, s)?,
            rays_per_group: LANES * rays_per_lane,
            memory,
            record: if shaders.mode == Mode::Any { 4 } else { HIT_BYTES },
        };
        Ok(Self { pipeline, shaders })
    }

    /// For the compute tracer's packets.
    pub(super) fn packets(pipeline: ComputePipeline, shaders: &'static StreamShaders) -> Self {
        Self { pipeline: Pipeline::Single { pipeline: Arc::new(pipeline), rays_per_group: LANES * PACKET_RAYS }, shaders }
    }

    /// For the compute tracer's readable reference.
    pub(super) fn reference(
        device: &Arc<Device>,
        shaders: &'static StreamShaders,
        s: &Specialization,
        rays_per_lane: u32,
    ) -> Result<Self> {
        let pipeline = compile(device, shaders, shaders.reference, s)?;
        Ok(Self { pipeline: Pipeline::Single { pipeline, rays_per_group: LANES * rays_per_lane }, shaders })
    }

    /// For the compute tracer without a hierarchy.
    pub(super) fn brute(device: &Arc<Device>, shaders: &'static StreamShaders, s: &Specialization) -> Result<Self> {
        let pipeline = compile(device, shaders, shaders.brute, s)?;
        Ok(Self { pipeline: Pipeline::Single { pipeline, rays_per_group: LANES }, shaders })
    }

    pub(super) fn query(device: &Arc<Device>, shaders: &'static StreamShaders, s: &Specialization) -> Result<Self> {
        let pipeline = compile(device, shaders, shaders.query, s)?;
        Ok(Self { pipeline: Pipeline::Single { pipeline, rays_per_group: LANES }, shaders })
    }

    pub(super) fn pipeline(
        device: &Arc<Device>,
        shaders: &'static StreamShaders,
        features: SceneFeatures,
        s: &Specialization,
    ) -> Result<Self> {
        let shared = HitShaders {
            miss: MISS,
            triangle_closest: TRIANGLE_CLOSEST,
            triangle_any: features.alpha.then_some(TRIANGLE_ANY),
            sphere: features.spheres.then_some([SPHERE_CLOSEST, SPHERE_INTERSECTION]),
        };
        let pipeline = RayTracingPipeline::new(device, shaders.name, shaders.raygen, &shared, s)?;
        Ok(Self { pipeline: Pipeline::RayTracing(Arc::new(pipeline)), shaders })
    }

    /// For rays whose pixels have been drawn. [`Push::rays`] is then the address of what was drawn ([`crate::render::raster`]).
    pub(super) fn drawn(device: &Arc<Device>, shaders: &'static StreamShaders, s: &Specialization) -> Result<Self> {
        if shaders.visibility.is_empty() {
            return Err(Error::Usage(format!("the rays of '{}' are not the camera's: they cannot be drawn", shaders.name)));
        }
        let pipeline = compile(device, shaders, shaders.visibility, s)?;
        Ok(Self { pipeline: Pipeline::Drawn(pipeline), shaders })
    }

    /// Records the tracing of rays `push.first .. push.first + push.count`, timed under the names of the stream's shaders. The
    /// addresses in `push` must be those of the tracer that made the stream and of parameters of the stream's pass.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        if push.count == 0 {
            return;
        }
        let in_memory = self.shaders.queue || matches!(self.pipeline, Pipeline::Drawn(_));
        debug_assert_eq!(in_memory, push.rays != 0, "{}: where are its rays?", self.shaders.name);
        debug_assert!(in_memory || push.count <= LAUNCH_RAYS, "{}: results would overwrite each other", self.shaders.name);
        let pass = self.shaders.pass;
        match &self.pipeline {
            Pipeline::Single { pipeline, rays_per_group } => {
                let run = if *rays_per_group == LANES { RUN } else { 1 };
                recorder.timed(pass, |r| r.dispatch_3d(pipeline, push, spread(push.count.div_ceil(*rays_per_group), run)));
            }
            Pipeline::Steps { generate, trace, deliver, rays_per_group, memory, record } => {
                let [generating, tracing, delivering] = self.shaders.steps;
                for first in (0..push.count).step_by(LAUNCH_RAYS as usize) {
                    let mut push = Push { first: push.first + first, count: LAUNCH_RAYS.min(push.count - first), ..*push };
                    // the steps hand rays and hits on in memory, and so does one launch to the next
                    recorder.barrier();
                    let groups = spread(push.count.div_ceil(*rays_per_group), 1);
                    recorder.fill(&memory.counters, 4 * groups.iter().map(|&n| u64::from(n)).product::<u64>(), 0);
                    match generate {
                        Some(generate) => {
                            push.rays = memory.rays.address();
                            recorder.timed(generating, |r| r.dispatch(generate, &push, push.count.div_ceil(LANES)));
                        }
                        None => {
                            push.rays += first as u64 * size_of::<Ray>() as u64;
                            recorder.fill(&memory.hits, record * push.count as u64, UNFINISHED);
                        }
                    }
                    recorder.barrier();
                    recorder.timed(tracing, |r| r.dispatch_3d(trace, &push, groups));
                    recorder.barrier();
                    recorder.timed(delivering, |r| r.dispatch_3d(deliver, &push, spread(push.count.div_ceil(LANES), RUN)));
                }
            }
            Pipeline::Drawn(pipeline) => recorder.timed(pass, |r| r.dispatch(pipeline, push, push.count.div_ceil(LANES))),
            Pipeline::RayTracing(pipeline) => {
                let rays = push.count.next_multiple_of(LANES * RUN * SPREAD);
                recorder.timed(pass, |r| r.trace_rays(pipeline, push, rays));
            }
        }
    }
}
