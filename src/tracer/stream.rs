//! Streams compiled for a tracer.

use std::sync::Arc;

use crate::accel::features::SceneFeatures;
use crate::error::{Error, Result};
use crate::gpu::{
    Buffer, ComputePipeline, Device, DeviceInfo, HitShaders, Memory, RayTracingPipeline, Recorder, Specialization,
};
use crate::interface::constants;
use crate::interface::records::hierarchy::{LaunchHit, RESUMED, UNFINISHED};
pub use crate::interface::records::ray::Push;
use crate::ray::Ray;
use crate::shaders::{self, LANES, Mode, PACKET_RAYS, RUN, Rays, SPREAD, StreamShaders, Variant};

/// Number of rays that a launch may have on every device.
pub const LAUNCH_RAYS: u32 = 1 << 19;

/// Memory of a GPU in bytes from which launches are larger: rays and states of paths are about 250
/// bytes each.
const MEMORY_OF_LARGE_LAUNCHES: u64 = 6 << 30;

/// Maximum number of rays in a launch of films and frames on a device; the compute tracer's ray and
/// hit buffers have room for [`with_uncovered`] as many. Between the steps of a launch a GPU is
/// idle for a tenth of a millisecond, longer than it takes for half a million rays.
pub fn launch_rays(info: &DeviceInfo) -> u32 {
    if info.is_cpu() || info.limits.device_memory < MEMORY_OF_LARGE_LAUNCHES { LAUNCH_RAYS } else { 4 * LAUNCH_RAYS }
}

/// All paths of surfaces in a frame over those that uncovered pixels have besides, in the same
/// launch: what a frame costs stays the same where much is uncovered.
pub const UNCOVERED_SHARE: u32 = 8;

/// Maximum number of rays in a launch with which a frame ends: of `rays`, and of uncovered pixels.
pub fn with_uncovered(rays: u32) -> u32 {
    rays.saturating_add(rays / UNCOVERED_SHARE)
}

#[derive(Clone)]
enum Pipeline {
    /// One compute shader over all rays.
    Single(Arc<ComputePipeline>),
    /// The compute tracer's packet kernel: one shader over all rays.
    Packets(Arc<ComputePipeline>),
    /// Generate, trace, deliver.
    Steps {
        // `None`: the rays are in a ray buffer already
        generate: Option<Arc<ComputePipeline>>,
        trace: Arc<ComputePipeline>,
        deliver: Arc<ComputePipeline>,
        rays_per_group: u32,
        memory: LaunchMemory,
        // size of a hit record in bytes
        record: u64,
    },
    RayTracing(Arc<RayTracingPipeline>),
    /// One compute shader over all rays, whose hit primitives are known from rasterization.
    Rasterized(Arc<ComputePipeline>),
    /// One compute shader over all rays, whose hits another pass has found.
    Known(Arc<ComputePipeline>),
}

/// Ray and hit buffers of a launch, between its steps.
#[derive(Clone)]
pub(super) struct LaunchMemory {
    /// How many rays it is for.
    pub capacity: u32,
    pub rays: Arc<Buffer>,
    pub hits: Arc<Buffer>,
    /// A u32 per work-group: number of rays that its lanes have fetched.
    pub counters: Arc<Buffer>,
    /// Where drivers end loops before some ray may be done.
    pub suspended: Option<SuspendedRays>,
}

impl LaunchMemory {
    /// Memory for the largest launch of a device.
    pub fn new(device: &Arc<Device>, suspended: Option<SuspendedRays>) -> Result<Self> {
        let capacity = with_uncovered(launch_rays(&device.info));
        let buffer = |name, bytes| Buffer::new(device, name, bytes * u64::from(capacity), Memory::Device).map(Arc::new);
        Ok(Self {
            capacity,
            rays: buffer("launch rays", size_of::<Ray>() as u64)?,
            hits: buffer("launch hits", size_of::<LaunchHit>() as u64)?,
            counters: buffer("launch counters", 4)?,
            suspended,
        })
    }
}

/// Rays whose traversal is not done when the driver ends a loop (shaders/trace/suspend.glsl).
#[derive(Clone)]
pub(super) struct SuspendedRays {
    /// Their number, the work-groups that resume them, and they.
    pub memory: Arc<Buffer>,
    /// How often they are resumed.
    pub resumptions: u32,
}

/// A stream, ready to run. Clones share what was compiled.
#[derive(Clone)]
pub struct Stream {
    pipeline: Pipeline,
    shaders: &'static StreamShaders,
}

/// Specialization constants of a scene: code for features that it does not use is compiled out.
pub(crate) fn scene_specialization(features: SceneFeatures) -> Specialization {
    let s = Specialization::default()
        .set(constants::HAS_ALPHA, features.alpha)
        .set(constants::HAS_SPHERES, features.spheres)
        .set(constants::SINGLE_LEVEL, features.single_level)
        .set(constants::HAS_COVERAGE, features.stochastic_alpha)
        .set(constants::HAS_DEEP_TEXELS, features.deep_texels)
        .set(constants::HAS_MANY_TEXCOORDS, features.many_texcoords);
    match features.shading {
        Some(shading) => s
            .set_all(shading.bsdfs.constants())
            .set_all(shading.materials.constants())
            .set_all(shading.textures.constants()),
        None => s,
    }
}

/// Numbers of work-groups along x, y and z for at least `parts` parts, in runs of `run`
/// (shaders/trace/spread.glsl).
pub(super) fn spread(parts: u32, run: u32) -> [u32; 3] {
    [run, parts.div_ceil(run * SPREAD), SPREAD]
}

/// Whether a device has the 64-bit integers and subgroup ballots that some variants need.
pub(super) fn has_ballots(info: &DeviceInfo) -> bool {
    info.int64 && info.limits.subgroup_ballot
}

/// The variants of a device that generate rays into memory, and deliver hits.
fn step_variants(info: &DeviceInfo) -> [Variant; 2] {
    if has_ballots(info) { [Variant::Generate64, Variant::Deliver64] } else { [Variant::Generate, Variant::Deliver] }
}

/// Compiles one of a stream's shaders.
fn compile(
    device: &Arc<Device>,
    shaders: &'static StreamShaders,
    variant: Variant,
    s: &Specialization,
) -> Result<Arc<ComputePipeline>> {
    let shader = shaders
        .variant(variant)
        .ok_or_else(|| Error::Usage(format!("'{}' is not made for {variant:?}", shaders.name())))?;
    ComputePipeline::new(device, shaders.name(), &shader, s).map(Arc::new)
}

impl Stream {
    /// The shaders from which it was compiled.
    pub(super) fn shaders(&self) -> &'static StreamShaders {
        self.shaders
    }

    /// A stream for a kernel of the compute tracer, which streams share: `trace`.
    pub(super) fn steps(
        device: &Arc<Device>,
        shaders: &'static StreamShaders,
        s: &Specialization,
        trace: Arc<ComputePipeline>,
        rays_per_lane: u32,
        memory: LaunchMemory,
    ) -> Result<Self> {
        let [generate, deliver] = step_variants(&device.info);
        let pipeline = Pipeline::Steps {
            generate: match shaders.rays {
                Rays::Queue => None,
                _ => Some(compile(device, shaders, generate, s)?),
            },
            trace,
            deliver: compile(device, shaders, deliver, s)?,
            rays_per_group: LANES * rays_per_lane,
            memory,
            record: if shaders.mode == Mode::Any { 4 } else { size_of::<LaunchHit>() as u64 },
        };
        Ok(Self { pipeline, shaders })
    }

    /// A stream for the compute tracer's packet kernel.
    pub(super) fn packets(pipeline: ComputePipeline, shaders: &'static StreamShaders) -> Self {
        Self { pipeline: Pipeline::Packets(Arc::new(pipeline)), shaders }
    }

    /// Whether its shader reads hits that another pass has found.
    pub(super) fn knows_hits(&self) -> bool {
        matches!(self.pipeline, Pipeline::Known(_))
    }

    /// Whether the packet kernel traces it.
    pub(super) fn traces_packets(&self) -> bool {
        matches!(self.pipeline, Pipeline::Packets(_))
    }

    pub(super) fn query(device: &Arc<Device>, shaders: &'static StreamShaders, s: &Specialization) -> Result<Self> {
        Ok(Self { pipeline: Pipeline::Single(compile(device, shaders, Variant::Query, s)?), shaders })
    }

    pub(super) fn pipeline(
        device: &Arc<Device>,
        stream: &'static StreamShaders,
        features: SceneFeatures,
        s: &Specialization,
    ) -> Result<Self> {
        let shared = HitShaders {
            miss: &shaders::MISS,
            triangle_closest: &shaders::TRIANGLE_CLOSEST,
            triangle_any: features.alpha.then_some(&shaders::TRIANGLE_ANY),
            sphere: features.spheres.then_some([&shaders::SPHERE_CLOSEST, &shaders::SPHERE_INTERSECTION]),
        };
        let raygen = stream
            .variant(Variant::Raygen)
            .ok_or_else(|| Error::Usage(format!("'{}' has no raygen shader", stream.name())))?;
        let pipeline = RayTracingPipeline::new(device, stream.name(), &raygen, &shared, s)?;
        Ok(Self { pipeline: Pipeline::RayTracing(Arc::new(pipeline)), shaders: stream })
    }

    /// A stream for camera rays whose pixels were rasterized. [`Push::rays`] is then the address of
    /// the rasterized ids ([`crate::raster`]).
    pub(super) fn rasterized(
        device: &Arc<Device>,
        shaders: &'static StreamShaders,
        s: &Specialization,
    ) -> Result<Self> {
        if shaders.variant(Variant::Visibility).is_none() {
            return Err(Error::Usage(format!(
                "the rays of '{}' are not camera rays that can be rasterized",
                shaders.name()
            )));
        }
        let pipeline = compile(device, shaders, Variant::Visibility, s)?;
        Ok(Self { pipeline: Pipeline::Rasterized(pipeline), shaders })
    }

    /// A stream whose hits another pass has found: the shader knows where they are.
    pub(super) fn known(device: &Arc<Device>, shaders: &'static StreamShaders, s: &Specialization) -> Result<Self> {
        debug_assert!(shaders.rays == Rays::CameraOrKnown, "'{}' finds no hits", shaders.name());
        let [_, deliver] = step_variants(&device.info);
        let s = s.clone().set(constants::HITS_ARE_KNOWN, true);
        Ok(Self { pipeline: Pipeline::Known(compile(device, shaders, deliver, &s)?), shaders })
    }

    /// Records the tracing of rays `push.first .. push.first + push.count`, timed under the names
    /// of the stream's shaders. `push` must hold the scene address of the tracer that made the
    /// stream, and the address of parameters of the stream's pass.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        if push.count == 0 {
            return;
        }
        let in_memory = self.shaders.rays == Rays::Queue || matches!(self.pipeline, Pipeline::Rasterized(_));
        debug_assert_eq!(in_memory, push.rays != 0, "{}: where are its rays?", self.shaders.name());

        // a kernel does all, or steps hand rays and hits on in memory
        let pass = self.shaders.pass;
        match &self.pipeline {
            Pipeline::Packets(pipeline) => {
                let groups = spread(push.count.div_ceil(LANES * PACKET_RAYS), 1);
                recorder.timed(pass, |r| r.dispatch_3d(pipeline, push, groups));
            }
            Pipeline::Steps { generate, trace, deliver, rays_per_group, memory, record } => {
                // at most as many rays a launch as the memory holds
                let most = memory.capacity;
                debug_assert!(
                    in_memory || push.count <= most,
                    "{}: results would overwrite each other",
                    self.shaders.name()
                );
                let [generating, tracing, delivering] = self.shaders.steps();
                for first in (0..push.count).step_by(most as usize) {
                    let mut push = Push { first: push.first + first, count: most.min(push.count - first), ..*push };

                    // the steps hand rays and hits on in memory, and so does one launch to the next
                    recorder.barrier();
                    let groups = spread(push.count.div_ceil(*rays_per_group), 1);
                    recorder.fill(&memory.counters, 4 * groups.iter().map(|&n| u64::from(n)).product::<u64>(), 0);
                    if let Some(suspended) = &memory.suspended {
                        // none, in no work-group
                        recorder.fill(&suspended.memory, 8, 0);
                    }

                    // rays: made here, or there already, and then their hits are empty at first
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

                    // hits: rays that a driver's limit on loops has suspended are resumed
                    recorder.timed(tracing, |r| {
                        r.dispatch_3d(trace, &push, groups);
                        if let Some(suspended) = &memory.suspended {
                            let push = Push { first: RESUMED, ..push };
                            for _ in 0..suspended.resumptions {
                                r.barrier();
                                r.dispatch_indirect(trace, &push, &suspended.memory, 4);
                            }
                        }
                    });
                    recorder.barrier();

                    // results
                    recorder
                        .timed(delivering, |r| r.dispatch_3d(deliver, &push, spread(push.count.div_ceil(LANES), RUN)));
                }
            }
            Pipeline::Single(pipeline) | Pipeline::Known(pipeline) => {
                recorder.timed(pass, |r| r.dispatch_3d(pipeline, push, spread(push.count.div_ceil(LANES), RUN)));
            }
            Pipeline::Rasterized(pipeline) => {
                recorder.timed(pass, |r| r.dispatch(pipeline, push, push.count.div_ceil(LANES)))
            }
            Pipeline::RayTracing(pipeline) => {
                let rays = push.count.next_multiple_of(LANES * RUN * SPREAD);
                recorder.timed(pass, |r| r.trace_rays(pipeline, push, rays));
            }
        }
    }
}
