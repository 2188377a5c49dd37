//! The interface between passes and tracers: a pass describes a stream of rays, a tracer traces it.
//! Nothing outside this folder knows which tracer is used.
//!
//! A pass's shader defines `ray(i)` and `closest(i, hit)` or `any(i, occluded)`; the build compiles
//! it once per tracer ([`stream`]). A [`Tracer`] holds a scene in device memory ([`gpu_scene`]) and
//! its acceleration structures: a software BVH (`compute`) or those of
//! VK_KHR_acceleration_structure (`hardware`).

mod albedo;
mod attributes;
mod boxes;
mod brute;
mod compute;
pub mod device_builder;
mod dynamic;
mod dynamic_trees;
pub mod entry_points;
pub mod gpu_scene;
mod group_buffers;
mod hardware;
mod hierarchy;
mod kernel;
mod kind;
mod lane_budget;
mod local_trees;
mod mipmap;
mod needs;
mod precompiled;
mod previous_frame;
pub mod queue;
pub mod raster_instance;
mod reference;
pub mod settings;
pub(crate) mod shading;
pub mod stream;
mod textures;
mod tracing_pass;
pub mod transform;
mod upload;
pub mod visits;
mod wide;

use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

pub use device_builder::{DeviceBuildStats, DeviceBuilder};
pub use dynamic::{Changes, MeshChange, MovedBounds, UpdateStats};
pub use gpu_scene::MaterialChange;
pub use kernel::{BuildOptions, ComputeOptions, Kernel, LocalOptions, TriangleTest};
pub use kind::{TracerKind, TracerNeeds};
pub use needs::Needs;
pub use raster_instance::RasterInstance;
pub use settings::{BuildChoice, BuildMethod, DeviceSettings, TracerChoice};
pub use stream::{Push, Stream};
pub use tracing_pass::TracingPass;
#[cfg(feature = "probes")]
pub use wide::probes as hierarchy_probes;

use crate::accel::features::SceneFeatures;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::gpu::{ComputePipeline, Device, Specialization};
use crate::interface::constants;
use crate::shaders::{self, ComputeShader, Mode, Rays, StreamShaders};
use crate::stage;
use gpu_scene::GpuScene;
use hierarchy::Hierarchy;
use lane_budget::lane_budget;
use precompiled::{PipelineSpec, PrecompiledPipelines};

/// Time and memory that building a tracer took.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct BuildStats {
    /// Seconds to build the BVH or the acceleration structures.
    pub build_seconds: f64,
    /// Seconds to write the scene into device memory.
    pub upload_seconds: f64,
    /// Size of the acceleration structures in bytes: BVH nodes and primitives, or the driver's
    /// structures.
    pub structure_bytes: u64,
    /// Size of the rest of the scene in bytes: vertices, indices, attributes, textures, records.
    pub scene_bytes: u64,
    /// Size of mip levels 1 and up in bytes, included in `scene_bytes`; 0 without
    /// [`Needs::mip_levels`].
    pub mip_bytes: u64,
    /// Largest number of mip levels of a texture, level 0 included; 0 without
    /// [`Needs::mip_levels`].
    pub mip_levels: u32,
    /// Number of triangles and spheres in the structures (each BLAS counted once).
    pub primitives: u64,
    /// Capacity of the compute tracer's traversal stack, in entries; 0 for the hardware tracers.
    pub stack_entries: u32,
    /// Influence areas that have trees of their own; 0 for all but the binary kernels.
    pub areas: u32,
    /// Primitives in the trees of influence areas: one may be in several.
    pub area_primitives: u64,
    /// Cost of the BVH by the surface area heuristic; `None` for the hardware tracers and for
    /// scenes of several trees.
    pub sah_cost: Option<f64>,
    /// BVHs that the device has built.
    pub on_device: DeviceBuildStats,
}

impl BuildStats {
    /// Size of the acceleration structures in bytes per primitive.
    pub fn bytes_per_primitive(&self) -> f64 {
        self.structure_bytes as f64 / self.primitives.max(1) as f64
    }
}

enum Structure {
    Compute(Box<Hierarchy>),
    /// The scene root holds the address of its top level.
    Hardware {
        levels: Box<hardware::Structures>,
    },
}

/// A scene in device memory, with its acceleration structures and compiled streams.
pub struct Tracer {
    kind: TracerKind,
    device: Arc<Device>,
    scene: GpuScene,
    structure: Structure,
    triangle_test: TriangleTest,
    features: SceneFeatures,
    stats: BuildStats,
    /// `None` for a static scene.
    dynamic: Option<Box<dynamic::Dynamic>>,
    // by mode
    kernels: [OnceLock<Arc<ComputePipeline>>; 2],
    // of [`entry_points`]
    entry_pass: OnceLock<ComputePipeline>,
    prepared: PrecompiledPipelines,
    // compiled streams, so that rendering twice compiles once
    streams: Mutex<Vec<(Specialization, Stream)>>,
}

impl Tracer {
    /// Uploads a scene and builds the acceleration structures of `kind`. A scene that was flattened
    /// with [`crate::scene::Motion`] can be updated ([`Tracer::update`]).
    ///
    /// # Errors
    /// [`Error::Device`] when the device lacks what the tracer needs, naming it;
    /// [`Error::OutOfMemory`]; [`Error::Scene`] when the scene has more primitives than the
    /// tracer's indices reach.
    pub fn new(device: &Arc<Device>, kind: TracerKind, flat: &FlatScene, needs: Needs) -> Result<Self> {
        Self::with_options(device, kind, flat, needs, ComputeOptions::default())
    }

    /// As [`Tracer::new`], with options of the compute tracer: a [`Kernel`] or [`ComputeOptions`].
    /// The hardware tracers ignore them.
    pub fn with_options(
        device: &Arc<Device>,
        kind: TracerKind,
        flat: &FlatScene,
        needs: Needs,
        options: impl Into<ComputeOptions>,
    ) -> Result<Self> {
        Self::with_build(device, kind, flat, needs, options.into(), &BuildOptions::default())
    }

    /// As [`Tracer::with_options`], with build options of the compute tracer's BVH.
    pub fn with_build(
        device: &Arc<Device>,
        kind: TracerKind,
        flat: &FlatScene,
        needs: Needs,
        options: ComputeOptions,
        build: &BuildOptions,
    ) -> Result<Self> {
        if !kind.is_supported_by(&device.info) {
            let missing = kind.needs(&device.info).missing.join(", ");
            return Err(Error::Device(format!(
                "tracer '{kind}' needs {missing}, which '{}' ({}) lacks; use --tracer auto, or see `skylit doctor`",
                device.info.name, device.info.driver
            )));
        }

        // what the scene uses decides which kernels are compiled
        let shading = needs.shading.then(|| shading::features(flat, needs));
        let features = SceneFeatures { shading, ..SceneFeatures::from_flat(flat) };
        let mut stats = BuildStats { primitives: flat.primitive_count() as u64, ..Default::default() };
        let min_leaves = build.on_device.filter(|_| kind == TracerKind::Compute && options.kernel.is_wide());
        let builder = min_leaves.map(|n| DeviceBuilder::new(device, n)).transpose()?;

        // the BVH first: its build needs the most host memory, which is freed before the scene's
        // buffers are filled
        let start = Instant::now();
        let (hierarchy, prepared) = match kind {
            TracerKind::Compute => {
                let specs = PrecompiledPipelines::expected(
                    &device.info,
                    features,
                    options,
                    &build.streams,
                    flat.primitive_count(),
                );
                let is_needed = !specs.is_empty();
                std::thread::scope(|scope| {
                    let compile = || PrecompiledPipelines::compile(device, specs);
                    // without a further thread they are compiled when they are needed
                    let start_thread = || std::thread::Builder::new().spawn_scoped(scope, compile).ok();
                    let prepared = if is_needed { start_thread() } else { None };
                    let trees = compute::Trees::build(flat, options.kernel, build, builder.as_ref());
                    // compiling pipelines is not counted as building
                    stats.build_seconds = start.elapsed().as_secs_f64();
                    let prepared = prepared.map(|p| p.join().unwrap_or_else(|e| std::panic::resume_unwind(e)));
                    trees.map(|t| (Some(t), prepared.unwrap_or_default()))
                })?
            }
            _ => (None, PrecompiledPipelines::default()),
        };
        let start = Instant::now();

        // then the scene's buffers, and the structure in device memory
        let _stage = stage::begin("uploading the scene");
        let mut scene = GpuScene::new(device, flat, needs)?;
        let structure = match hierarchy {
            Some(trees) => {
                stats.sah_cost = trees.sah_cost();
                stats.on_device = builder.as_ref().map(DeviceBuilder::take_stats).unwrap_or_default();
                let mut h = trees.upload(device, flat)?;
                h.builder = builder.filter(|_| h.dynamic.is_some());
                scene.set_hierarchy(&h)?;
                stats.stack_entries = h.stack_entries;
                stats.structure_bytes = h.bytes();
                (stats.areas, stats.area_primitives) = h.areas.as_ref().map_or((0, 0), |a| (a.count, a.primitives));
                Structure::Compute(Box::new(h))
            }
            None => {
                let upload = start.elapsed();
                let start = Instant::now();
                let s = hardware::Structures::build(device, flat, &scene)?;
                scene.set_top_level(s.address())?;
                stats.build_seconds = start.elapsed().as_secs_f64();
                stats.upload_seconds = upload.as_secs_f64();
                stats.structure_bytes = s.bytes();
                Structure::Hardware { levels: Box::new(s) }
            }
        };

        // the hardware tracers build on the device, so that they measured both already
        if kind == TracerKind::Compute {
            stats.upload_seconds = start.elapsed().as_secs_f64();
        }
        stats.scene_bytes = scene.bytes();
        (stats.mip_levels, stats.mip_bytes) = (scene.mips().levels, scene.mips().bytes);
        Ok(Self {
            kind,
            device: device.clone(),
            scene,
            structure,
            triangle_test: options.triangle_test,
            features,
            stats,
            dynamic: dynamic::Dynamic::new(flat).map(Box::new),
            kernels: Default::default(),
            entry_pass: OnceLock::new(),
            streams: Default::default(),
            prepared,
        })
    }

    /// Which tracer this is.
    pub fn kind(&self) -> TracerKind {
        self.kind
    }

    /// Options of the compute tracer; `None` for the others.
    pub fn compute_options(&self) -> Option<ComputeOptions> {
        match &self.structure {
            Structure::Compute(h) => Some(ComputeOptions { kernel: h.kernel, triangle_test: self.triangle_test }),
            Structure::Hardware { .. } => None,
        }
    }

    /// The device that holds the scene.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Features of shaders that the scene requires.
    pub fn features(&self) -> SceneFeatures {
        self.features
    }

    /// Whether the scene can be updated ([`Tracer::update`]).
    pub fn is_dynamic(&self) -> bool {
        self.dynamic.is_some()
    }

    /// Time and memory that building it took.
    pub fn stats(&self) -> BuildStats {
        self.stats
    }

    /// Address of the scene's root: [`Push::scene`].
    pub fn scene_address(&self) -> u64 {
        self.scene.root_address()
    }

    /// Checks that every ray was traced to its end. Call it after streams have run and before their
    /// results are used.
    ///
    /// # Errors
    /// [`Error::Vulkan`] when the driver ended a traversal loop early; the results alone do not
    /// show it.
    pub fn check_finished(&self) -> Result<()> {
        match &self.structure {
            Structure::Compute(h) => h.check_finished(),
            Structure::Hardware { .. } => Ok(()),
        }
    }

    /// A stream for this tracer and scene, compiled on first use.
    ///
    /// # Errors
    /// Those of the device.
    pub fn stream(&self, shaders: &'static StreamShaders) -> Result<Stream> {
        self.specialized(shaders, &Specialization::default())
    }

    /// As [`Tracer::stream`], with specialization constants of its pass.
    ///
    /// # Errors
    /// Those of the device.
    pub fn specialized(&self, shaders: &'static StreamShaders, constants: &Specialization) -> Result<Stream> {
        self.kept(shaders, constants, false, || self.compile(shaders, constants))
    }

    /// As [`Tracer::specialized`], for rays that another pass has traced: the shader reads the hits
    /// ([`crate::shaders::Rays::CameraOrKnown`]).
    ///
    /// # Errors
    /// Those of the device.
    pub fn with_known_hits(&self, shaders: &'static StreamShaders, constants: &Specialization) -> Result<Stream> {
        let all = || stream::scene_specialization(self.features).and(constants);
        self.kept(shaders, constants, true, || Stream::known(&self.device, shaders, &all()))
    }

    /// A stream that was made before, or is made now.
    fn kept(
        &self,
        shaders: &'static StreamShaders,
        constants: &Specialization,
        knows_hits: bool,
        make: impl FnOnce() -> Result<Stream>,
    ) -> Result<Stream> {
        let all = || self.streams.lock().unwrap_or_else(PoisonError::into_inner);
        let is = |(of, stream): &&(Specialization, Stream)| {
            of == constants && std::ptr::eq(stream.shaders(), shaders) && stream.knows_hits() == knows_hits
        };
        if let Some((_, stream)) = all().iter().find(is) {
            return Ok(stream.clone());
        }
        let stream = make()?;
        all().push((constants.clone(), stream.clone()));
        Ok(stream)
    }

    fn compile(&self, shaders: &'static StreamShaders, constants: &Specialization) -> Result<Stream> {
        let constants = &match shaders.rays {
            Rays::Queue => constants.clone().set(constants::RAYS_ARE_QUEUED, true),
            _ => constants.clone(),
        };
        let scene = || stream::scene_specialization(self.features).and(constants);
        match &self.structure {
            Structure::Compute(h) => {
                let (info, options) =
                    (&self.device.info, ComputeOptions { kernel: h.kernel, triangle_test: self.triangle_test });
                let s = precompiled::specialization(info, self.features, options, h.stack_constant());
                let s = if h.areas.is_some() { s.set(constants::HAS_AREAS, true) } else { s };
                let all = s.clone().and(constants);
                if precompiled::in_packets(info, h.kernel, shaders) {
                    let spec = precompiled::large(info, h.kernel, shaders, &all);
                    return Ok(Stream::packets(self.prepared.take(&self.device, &spec)?, shaders));
                }
                // it does not depend on the pass, so streams share it
                let kernel = self.kernel(shaders.mode, &precompiled::large(info, h.kernel, shaders, &s))?;
                let rays_per_lane = if h.kernel == Kernel::Brute { 1 } else { lane_budget(info).0 };
                Stream::steps(&self.device, shaders, &all, kernel, rays_per_lane, h.launch.clone())
            }
            Structure::Hardware { .. } if self.kind == TracerKind::Query => {
                Stream::query(&self.device, shaders, &scene())
            }
            Structure::Hardware { .. } => Stream::pipeline(&self.device, shaders, self.features, &scene()),
        }
    }

    /// Compiles a compute pass that traverses the compute tracer's BVH with the code of the `wide`
    /// kernel and counts visited nodes (`COUNT_VISITS` in shaders/trace/wide.glsl). `user` is the
    /// option that needs it, for error messages.
    ///
    /// # Errors
    /// [`Error::Usage`] for tracers and traversals that cannot count, and those of the device.
    pub fn counting_kernel(&self, shader: &ComputeShader, user: &str) -> Result<ComputePipeline> {
        let options = self.compute_options().ok_or_else(|| {
            Error::Usage(format!(
                "{user} needs the compute tracer, and '{}' cannot count: add --tracer compute",
                self.kind
            ))
        })?;
        match &self.structure {
            Structure::Compute(h) if h.kernel.is_wide() => {
                let s = precompiled::specialization(&self.device.info, self.features, options, h.stack_constant());
                shader.specialized(&self.device, &s)
            }
            _ => Err(Error::Usage(format!("{user} needs a BVH of wide nodes: add --traversal {}", Kernel::Wide))),
        }
    }

    /// Compiles a stream of camera rays whose hits come from rasterized pixels ([`crate::raster`]):
    /// nothing is traced.
    pub fn rasterized_stream(&self, shaders: &'static StreamShaders) -> Result<Stream> {
        Stream::rasterized(&self.device, shaders, &stream::scene_specialization(self.features))
    }

    /// The TLAS instances for rasterization, as they are since the last [`Tracer::update`].
    pub fn raster_instances(&self) -> impl Iterator<Item = RasterInstance<'_>> {
        self.scene.raster_instances()
    }

    /// The pass that finds entry points, compiled once for all images.
    fn entry_pass(&self) -> Result<ComputePipeline> {
        if let Some(pass) = self.entry_pass.get() {
            return Ok(pass.clone());
        }
        let pass = shaders::ENTRY_POINTS.pipeline(&self.device)?;
        Ok(self.entry_pass.get_or_init(|| pass).clone())
    }

    /// The kernel that traces rays in memory, compiled once for all streams of a mode.
    fn kernel(&self, mode: Mode, spec: &PipelineSpec) -> Result<Arc<ComputePipeline>> {
        let slot = &self.kernels[mode as usize];
        if let Some(kernel) = slot.get() {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(self.prepared.take(&self.device, spec)?);
        Ok(slot.get_or_init(|| kernel).clone())
    }
}
