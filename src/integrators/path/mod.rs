//! Path tracing: the ground truth that ambient occlusion approximates. The streams `path_camera`,
//! `path_bounce` and `path_shadow` and the pass `path_resolve`, several samples of a pixel at a
//! time.
//!
//! A wavefront (Laine, Karras, Aila 2013): `path_camera` traces camera rays and shades their hits,
//! which appends shadow rays to one queue and rays of the next bounce to another; `path_shadow`
//! traces the first, `path_bounce` the second, until a queue is empty. Every path writes to its own
//! memory only, so images do not depend on the order in which rays are processed.

pub mod ambient;
mod ambient_light;
mod blur;
mod buffers;
mod environment;
mod features;
pub mod kinds;
mod light_sources;
mod light_tree;
mod lights;
mod media;
mod megakernel;
mod params;
pub mod points;
mod report;
pub mod settings;
pub mod signal;

use std::sync::Arc;

use glam::DMat3;

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::accumulate::{Accumulated, Estimator, MAX_SAMPLE_BITS, accumulate, max_rays};
use crate::film::block::{BlockParams, PassParams};
use crate::film::camera::CameraRecord;
use crate::film::{Control, SampleSettings};
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Recorder, Specialization, Timing};
use crate::interface::records::film::FilmParams;
use crate::interface::{LightKinds, MaterialFeature, PathFeature, PathFeatures};
pub use crate::interface::{PixelFilter, View};
use crate::scene::Scene;
use crate::shaders::{self, StreamShaders};
use crate::tracer::queue::RayQueue;
use crate::tracer::stream::launch_rays;
use crate::tracer::{Push, Stream, Tracer, TracingPass};
use buffers::{AMBIENT_COUNT, COUNTS, DISTANT_COUNT, FirstSurfaceRays, PathBuffers};
use environment::DeviceEnvironment;
use light_sources::LightSources;
use lights::LightBuilder;
use lights::device::DeviceLights;
use media::ClosedVolumes;
pub use megakernel::Schedule;
use params::{LaunchParams, PathFrameParams, PathParams, QUAD_BYTES};
pub use settings::{Lens, MAX_DEPTH, PathKernel, PathOptions, Strategy, TextureFilter};

/// Minimum number of bounces per submission, after which the host reads how many paths are left.
const MIN_BOUNCES: u32 = 4;
/// Maximum number of bounces per submission.
const MAX_BOUNCES: u32 = 32;
/// Launches beyond those of the bounces, for surfaces that paths pass straight through and for
/// scatterings in volumes. A path counts them in 16 bits (`PathRecord::depth_passes`).
const MAX_STRAIGHT: u32 = 4096;

/// An image and statistics of its rays.
#[derive(Clone, Debug, Default)]
pub struct PathResult {
    /// The image, linear RGB radiance, and statistics of its camera rays.
    pub image: Accumulated,
    /// Rays of all bounces but camera rays.
    pub bounce_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Occlusion rays of ambient light.
    pub ambient_rays: u64,
    /// Number of bounces of the longest path.
    pub longest_path: u32,
    /// Number of lights that are sampled, the environment and each portal included.
    pub lights: u32,
    /// A light tree chooses among them.
    pub light_tree: bool,
    /// Features that the shaders were compiled with.
    pub features: PathFeatures,
    /// Kinds of lights that light sampling was compiled for.
    pub light_kinds: LightKinds,
    /// How paths were traced, and why.
    pub schedule: Schedule,
}

/// The streams that [`render`] traces and that depend on nothing but the scene's geometry.
pub fn streams() -> [&'static StreamShaders; 2] {
    [&shaders::PATH_BOUNCE_CLOSEST, &shaders::PATH_SHADOW_ANY]
}

/// Renders. The tracer must have been built from `flat` with [`crate::tracer::Needs::shading`].
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn render(
    tracer: &Tracer,
    flat: &FlatScene,
    camera: &CameraRecord,
    options: &PathOptions,
    control: &mut dyn Control,
) -> Result<PathResult> {
    PathIntegrator::new(tracer, flat, options)?.render(
        tracer,
        camera,
        options.samples.spp,
        options.samples.seed,
        control,
    )
}

/// Renders one scene repeatedly: lights, environment, queues and pipelines are created once.
pub struct PathIntegrator {
    paths: PathEstimator,
    options: PathOptions,
}

impl PathIntegrator {
    /// Creates it for images of at most `options.samples.spp` paths per pixel. The tracer must have
    /// been built from `flat` with [`crate::tracer::Needs::shading`].
    ///
    /// # Errors
    /// Those of the device; [`Error::Usage`] for a tracer without the data that paths need.
    pub fn new(tracer: &Tracer, flat: &FlatScene, options: &PathOptions) -> Result<Self> {
        let capacity =
            max_rays(launch_rays(&tracer.device().info), options.samples.size, options.samples.spp, MAX_SAMPLE_BITS);
        Ok(Self { paths: PathEstimator::new(tracer, flat, options, capacity, false)?, options: options.clone() })
    }

    /// Number of lights that are sampled, the environment and each portal included.
    pub fn lights(&self) -> u32 {
        self.paths.light_count()
    }

    /// Turns the environment map: `to_map` is the rotation from world directions to the map's.
    ///
    /// # Errors
    /// Those of the device.
    pub fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        self.paths.turn_environment(to_map)
    }

    /// Moves lights, and emissive surfaces, to where they are in `scene`, which is that of the
    /// tracer in another pose.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] where lights were switched, which needs other shaders.
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<()> {
        self.paths.move_lights(tracer.device(), scene).map(drop)
    }

    /// Renders `spp` paths per pixel. `tracer` must be the one of [`PathIntegrator::new`].
    ///
    /// # Errors
    /// Those of the device; [`Error::Usage`] for more paths than `options.samples.spp`;
    /// [`crate::Error::Interrupted`] when `control` says so.
    pub fn render(
        &mut self,
        tracer: &Tracer,
        camera: &CameraRecord,
        spp: u32,
        seed: u32,
        control: &mut dyn Control,
    ) -> Result<PathResult> {
        let Self { paths, options } = self;
        paths.find_camera_media(camera)?;
        if spp > options.samples.spp {
            return Err(Error::Usage(format!(
                "{spp} paths per pixel: the integrator was created for at most {}",
                options.samples.spp
            )));
        }
        let samples = SampleSettings { spp, seed, ..options.samples.clone() };
        paths.traced = PathCounts::default();
        let image = accumulate(tracer, camera, &samples, paths, control)?;
        let PathCounts { bounce_rays, shadow_rays, ambient_rays, longest_path } = paths.traced;
        Ok(PathResult {
            image,
            bounce_rays,
            shadow_rays,
            ambient_rays,
            longest_path,
            lights: paths.light_count(),
            light_tree: paths.features.contains(PathFeature::LightTree),
            features: paths.features,
            light_kinds: paths.light_kinds,
            schedule: paths.schedule,
        })
    }
}

/// Statistics of an image's rays.
#[derive(Clone, Copy, Default)]
struct PathCounts {
    bounce_rays: u64,
    shadow_rays: u64,
    ambient_rays: u64,
    longest_path: u32,
}

/// Resources of shadow rays that pass straight through thin walls.
struct TransmittedShadowRays {
    stream: Stream,
    /// Shadow rays behind one more wall; rays alternate between this queue and that of shadow rays.
    later: RayQueue,
    contributions: Buffer,
    count: Buffer,
}

/// The passes that trace the paths of all launches.
enum TracedBy {
    Wavefront(Arc<Wavefront>),
    Megakernel(TracingPass),
}

/// Streams of the steps of paths.
struct Wavefront {
    camera: Stream,
    /// As `camera`, for hits of another pass; `None` where each path has a camera ray of its own.
    known: Option<Stream>,
    bounce: Stream,
    shadow: Stream,
}

struct PathEstimator {
    traced_by: TracedBy,
    resolve: ComputePipeline,
    schedule: Schedule,
    /// The launches that follow begin at known hits ([`PathFrameParams::known_hits`]).
    begins_at_known: bool,
    buffers: PathBuffers,
    /// Parameters for filling either queue of bounces; then those for tracing either queue of
    /// shadow rays behind walls; then those of rays of first surfaces.
    params: Vec<PassParams<LaunchParams>>,
    records: Vec<LaunchParams>,
    /// Parameters of `path_resolve`.
    film: Buffer,
    walls: Option<TransmittedShadowRays>,
    /// Rays of first surfaces, each kind on its own.
    of_first_surface: Vec<FirstSurfaceRays>,
    /// The volumes that paths may be in, if they must be tracked.
    volumes: Option<ClosedVolumes>,
    /// Numbers of rays traced at each bounce, and of its shadow rays.
    counts: Buffer,
    max_depth: u32,
    traces_shadows: bool,
    traced: PathCounts,
    /// Bounces of the longest path of the launch before.
    bounces_before: u32,
    lights: DeviceLights,
    /// Makes the lights again where they move; `None` where they do not depend on the scene.
    light_builder: Option<LightBuilder>,
    features: PathFeatures,
    light_kinds: LightKinds,
    _environment: DeviceEnvironment,
}

impl TransmittedShadowRays {
    /// For launches of at most `most` paths.
    fn new(tracer: &Tracer, constants: &Specialization, most: u32) -> Result<Self> {
        let device = tracer.device();
        let bytes = QUAD_BYTES * u64::from(most);
        Ok(Self {
            stream: tracer.specialized(&shaders::PATH_SHADOW_WALLS_CLOSEST, constants)?,
            later: RayQueue::new(device, most)?,
            contributions: Buffer::new(device, "transmitted shadow ray contributions", bytes, Memory::Device)?,
            count: Buffer::new(device, "number of transmitted shadow rays", 4, Memory::Readback)?,
        })
    }
}

impl TracedBy {
    /// Compiles it. `has_known_hits`: paths may begin at camera rays that another pass traced.
    fn new(tracer: &Tracer, constants: &Specialization, has_known_hits: bool, schedule: Schedule) -> Result<Self> {
        if let Schedule::Megakernel(_) = schedule {
            return tracer.tracing_pass("path_megakernel", &shaders::PATH_MEGAKERNEL, constants).map(Self::Megakernel);
        }
        let known = || tracer.with_known_hits(&shaders::PATH_CAMERA_CLOSEST, constants);
        Ok(Self::Wavefront(Arc::new(Wavefront {
            camera: tracer.specialized(&shaders::PATH_CAMERA_CLOSEST, constants)?,
            known: has_known_hits.then(known).transpose()?,
            bounce: tracer.specialized(&shaders::PATH_BOUNCE_CLOSEST, constants)?,
            shadow: tracer.stream(&shaders::PATH_SHADOW_ANY)?,
        })))
    }

    /// The streams of the wavefront.
    fn wavefront(&self) -> Result<&Arc<Wavefront>> {
        match self {
            Self::Wavefront(wavefront) => Ok(wavefront),
            Self::Megakernel(_) => Err(Error::Usage("paths of the megakernel have no steps".into())),
        }
    }
}

/// Checks that the tracer has the data that paths of these options need: without it the image would
/// be wrong without any error. Returns true if textures are filtered by ray cones.
fn check_tracer(tracer: &Tracer, options: &PathOptions) -> Result<bool> {
    let Some(shading) = tracer.features().shading else {
        return Err(Error::Usage("path tracing needs a tracer that was built with Needs::shading".into()));
    };
    if shading.materials.contains(MaterialFeature::White) && options.white_sky.is_none() {
        return Err(Error::Usage(
            "a tracer that was built with Needs::white has no materials, which paths need without a white sky".into(),
        ));
    }
    let cones = options.texture_filter == TextureFilter::RayCone && options.white_sky.is_none();
    if cones && !shading.materials.contains(MaterialFeature::RayCones) {
        return Err(Error::Usage("ray cones need a tracer that was built with Needs::mip_levels".into()));
    }
    Ok(cones)
}

/// Uploads the parameters of launches; those of their block are yet to be written.
fn upload_params(device: &Arc<Device>, records: &[LaunchParams]) -> Result<Vec<PassParams<LaunchParams>>> {
    let upload = |record| {
        let mut params = PassParams::new(device, "parameters of paths")?;
        params.write_own(record)?;
        Ok(params)
    };
    records.iter().map(upload).collect()
}

impl PathEstimator {
    /// For launches of up to `most` paths. `has_signal`: diffuse radiance is kept apart.
    fn new(tracer: &Tracer, flat: &FlatScene, options: &PathOptions, most: u32, has_signal: bool) -> Result<Self> {
        let device = tracer.device();
        let cones = check_tracer(tracer, options)?;

        // Lights, and the features that shaders need for them.
        let sources = LightSources::new(device, flat, options)?;
        let (mut features, light_kinds) = sources.features(flat, options, cones);
        features.insert_if(has_signal, PathFeature::Signal);
        let schedule = Schedule::choose(options.kernel, tracer, features)?;
        let few = tracer.few_leaves().unwrap_or_default();
        let stores_sky_pdfs = sources.needs_sky_pdfs(features, light_kinds);
        let LightSources { environment, lights, builder } = sources;
        let lights = DeviceLights::new(device, lights)?;
        let samples_lights = features.contains(PathFeature::LightSamples) && options.view.is_none();
        // what is behind a catcher comes with its shadow rays, which there are without lights, too
        let traces_shadows = samples_lights || options.catches();

        // Buffers.
        let counts = Buffer::new(device, "ray counts", 4 * u64::from(COUNTS * (MAX_BOUNCES + 1)), Memory::Readback)?;
        let base = PathParams {
            counts: counts.address(),
            few: few.leaves,
            few_count: few.count,
            few_flat: few.flat,
            max_rays: max_rays_of_path(features, options.bounces()),
            map: environment.map,
            environment: environment.factor.to_array(),
            ..lights.params(options.params())
        };
        let (mut buffers, base) = PathBuffers::new(device, most, features, stores_sky_pdfs, base)?;
        let constants = Specialization::default().set_all(features.constants()).set_all(light_kinds.constants());
        let transmits = traces_shadows && features.contains(PathFeature::ClearWalls);
        let walls = transmits.then(|| TransmittedShadowRays::new(tracer, &constants, most)).transpose()?;
        let behind_walls = walls.as_ref().map(|w| (w.later.record(), w.contributions.address()));
        let (records, of_first_surface) = buffers.launch_params(behind_walls, base);
        let launch = |path| LaunchParams { path, of_frame: PathFrameParams::default() };
        let records: Vec<_> = records.into_iter().map(launch).collect();

        // Pipelines.
        let shares_camera_rays = !tracer.features().stochastic_alpha && !features.contains(PathFeature::Lens);
        let has_known_hits = has_signal && shares_camera_rays || options.begins_at_points;
        let traced_by = TracedBy::new(tracer, &constants, has_known_hits, schedule)?;

        Ok(Self {
            traced_by,
            resolve: shaders::PATH_RESOLVE.pipeline(device)?,
            schedule,
            begins_at_known: options.begins_at_points,
            buffers,
            params: upload_params(device, &records)?,
            records,
            film: Buffer::new(device, "parameters of the film", size_of::<FilmParams>() as u64, Memory::Upload)?,
            walls,
            of_first_surface,
            volumes: features.contains(PathFeature::Media).then(|| ClosedVolumes::new(flat)),
            counts,
            max_depth: options.bounces(),
            traces_shadows,
            traced: PathCounts::default(),
            bounces_before: 0,
            lights,
            light_builder: builder,
            features,
            light_kinds,
            _environment: environment,
        })
    }

    /// Sets the volumes in which camera rays start, by the middle of the near clipping plane.
    fn find_camera_media(&mut self, camera: &CameraRecord) -> Result<()> {
        let Some(volumes) = &self.volumes else { return Ok(()) };
        let near = camera.clip[0];
        let start = camera.camera_to_world.map(|row| f64::from(row[3] - near * row[2]));
        let camera_media = volumes.containing(glam::DVec3::from_array(start));
        self.change_records(|record| record.path.camera_media = camera_media)
    }

    /// From now on Russian roulette may end paths after so many bounces.
    fn begin_roulette_after(&mut self, bounces: u32) -> Result<()> {
        if self.records[0].path.options.rr_depth == bounces {
            return Ok(());
        }
        self.change_records(|record| record.path.options.rr_depth = bounces)
    }

    /// Writes the parameters of a block.
    fn write_block(&mut self, block: &BlockParams) -> Result<()> {
        self.params.iter_mut().try_for_each(|params| params.write_block(block))
    }

    /// Turns the environment map.
    fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        let rows = environment::rows(to_map);
        self.change_records(|record| record.path.map.to_map = rows)
    }

    /// Number of lights that light sampling chooses from.
    fn light_count(&self) -> u32 {
        if self.features.contains(PathFeature::LightSamples) { self.lights.count() } else { 0 }
    }

    /// Moves the lights to where they are in `scene`; returns true if they have moved.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] for lights that need other shaders.
    fn move_lights(&mut self, device: &Arc<Device>, scene: &Scene) -> Result<bool> {
        let Some(builder) = &mut self.light_builder else { return Ok(false) };
        let lights = builder.lights(scene);
        if self.lights.are(&lights) {
            return Ok(false);
        }
        self.lights.check_fits(&lights, self.features, self.light_kinds)?;
        let lights = DeviceLights::new(device, lights)?;
        self.change_records(|record| record.path = lights.params(record.path))?;
        self.lights = lights;
        Ok(true)
    }

    fn change_records(&mut self, change: impl Fn(&mut LaunchParams)) -> Result<()> {
        for (record, params) in self.records.iter_mut().zip(&mut self.params) {
            change(record);
            params.write_own(record)?;
        }
        Ok(())
    }

    /// Records the shadow rays that a vertex generated; their number is read back from `slot`.
    fn record_shadow(&self, wavefront: &Wavefront, r: &mut Recorder, push: Push, most: u32, slot: u32) {
        if !self.traces_shadows {
            return;
        }
        r.barrier();
        match &self.walls {
            None => wavefront.shadow.record(r, &self.buffers.shadow_queue.push(push, most)),
            Some(walls) => {
                walls.later.clear(r);
                r.barrier();
                let push = Push { pass: self.params[2].address(), ..push };
                walls.stream.record(r, &self.buffers.shadow_queue.push(push, most));
                r.barrier();
                r.copy(walls.later.count(), 0, &walls.count, 0, 4);
            }
        }
        r.barrier();
        r.copy(self.buffers.shadow_queue.count(), 0, &self.counts, 4 * u64::from(COUNTS * slot + 1), 4);
    }

    /// Records the rays of first surfaces of a vertex; their number is read back from `slot`.
    fn record_first_surface(&self, wavefront: &Wavefront, r: &mut Recorder, push: Push, most: u32, slot: u32) {
        for FirstSurfaceRays { queue, params, count } in &self.of_first_surface {
            r.barrier();
            let push = Push { pass: self.params[*params].address(), ..push };
            wavefront.shadow.record(r, &queue.push(push, most));
            r.barrier();
            r.copy(queue.count(), 0, &self.counts, 4 * u64::from(COUNTS * slot + count), 4);
        }
    }

    /// Empties the queues of the rays that a vertex leaves for lights.
    fn clear_light_queues(&self, r: &mut Recorder) {
        self.buffers.shadow_queue.clear(r);
        self.of_first_surface.iter().for_each(|rays| rays.queue.clear(r));
    }

    /// Traces shadow rays that have passed a thin wall, wall after wall, until none is left.
    fn trace_behind_walls(&mut self, commands: &mut Commands, push: Push) -> Result<Vec<Timing>> {
        let mut timings = Vec::new();
        let Some(walls) = self.walls.as_ref().filter(|_| self.traces_shadows) else { return Ok(timings) };
        let queues = [&self.buffers.shadow_queue, &walls.later];
        // the shadow rays of vertices went from the first queue to the second
        let mut from = 1;
        loop {
            let left: u32 = bytemuck::pod_read_unaligned(&walls.count.read(0, 4)?);
            if left == 0 {
                return Ok(timings);
            }
            self.traced.shadow_rays += u64::from(left);
            let push = Push { pass: self.params[2 + from].address(), ..push };
            timings.extend(commands.run(|r| {
                queues[from ^ 1].clear(r);
                r.barrier();
                walls.stream.record(r, &queues[from].push(push, left));
                r.barrier();
                r.copy(queues[from ^ 1].count(), 0, &walls.count, 0, 4);
            })?);
            from ^= 1;
        }
    }

    /// Traces the paths of a launch, and adds them to the film.
    fn trace_to_film(&mut self, commands: &mut Commands, push: Push) -> Result<Vec<Timing>> {
        match &self.traced_by {
            TracedBy::Megakernel(_) => self.trace_at_once(commands, push),
            TracedBy::Wavefront(_) => self.trace(commands, push, |paths, r| paths.record_resolve(r, push)),
        }
    }

    /// Records how the paths of a launch are added to the film.
    fn record_resolve(&self, r: &mut Recorder, push: Push) {
        let push = Push { pass: self.film.address(), ..push };
        let groups = (push.count >> push.sample_bits).div_ceil(shaders::LANES);
        r.timed("path_resolve", |r| r.dispatch(&self.resolve, &push, groups));
    }

    /// Traces all bounces of a launch, several per submission ([`bounces_of_submission`]); with
    /// thin walls that transmit, one. Then records `finish`, which reads the paths.
    fn trace(
        &mut self,
        commands: &mut Commands,
        push: Push,
        finish: impl Fn(&Self, &mut Recorder),
    ) -> Result<Vec<Timing>> {
        let wavefront = self.traced_by.wavefront()?.clone();
        let passes = [0, 1].map(|k| self.params[k].address());
        let push = |fills: usize| Push { pass: passes[fills], ..push };
        let (straight, max_launches) =
            (passes_straight(self.features), max_rays_of_path(self.features, self.max_depth));
        let (mut timings, mut depth, mut left, mut started) = (Vec::new(), 0, push(0).count, false);
        let mut longest = 0;

        // Submissions of several bounces each; vertex `depth` fills queue `depth % 2`.
        loop {
            // rays behind walls are traced before the next vertices append others
            let before = self.bounces_before.saturating_sub(depth);
            let bounces = match self.walls {
                Some(_) => u32::from(started),
                None => bounces_of_submission(push(0).count, left, before),
            };
            let (begin, last) = (depth, (depth + bounces).min(max_launches));
            // known before the host reads anything
            let finishes = last == max_launches && self.walls.is_none();
            timings.extend(commands.run(|r| {
                r.fill(&self.counts, self.counts.size(), 0);
                if !started {
                    self.buffers.queues[0].clear(r);
                    self.clear_light_queues(r);
                    r.barrier();
                    let known = wavefront.known.as_ref().filter(|_| self.begins_at_known);
                    known.unwrap_or(&wavefront.camera).record(r, &push(0));
                    self.record_shadow(&wavefront, r, push(0), left, MAX_BOUNCES);
                    self.record_first_surface(&wavefront, r, push(0), left, MAX_BOUNCES);
                }
                while depth < last {
                    let slot = depth - begin;
                    depth += 1;
                    let (fills, traced) = (depth as usize % 2, (depth as usize + 1) % 2);
                    r.barrier();
                    self.buffers.queues[fills].clear(r);
                    self.clear_light_queues(r);
                    r.barrier();
                    wavefront.bounce.record(r, &self.buffers.queues[traced].push(push(fills), left));
                    r.copy(self.buffers.queues[traced].count(), 0, &self.counts, 4 * u64::from(COUNTS * slot), 4);
                    self.record_shadow(&wavefront, r, push(fills), left, slot);
                    // surfaces behind those that paths pass straight through are first ones, too
                    if straight {
                        self.record_first_surface(&wavefront, r, push(fills), left, slot);
                    }
                }

                // Number of rays that are left for the next submission.
                r.barrier();
                let left = self.buffers.queues[depth as usize % 2].count();
                r.copy(left, 0, &self.counts, 4 * u64::from(COUNTS * MAX_BOUNCES), 4);
                if finishes {
                    finish(self, r);
                }
            })?);
            started = true;
            timings.extend(self.trace_behind_walls(commands, push(0))?);

            // Count the rays, and finish when none is left.
            let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.counts.read(0, self.counts.size())?);
            for k in begin..depth {
                let rays = counts[(COUNTS * (k - begin)) as usize];
                if rays > 0 {
                    longest = k + 1;
                }
                self.traced.bounce_rays += u64::from(rays);
            }
            let sum =
                |first: usize| counts.iter().skip(first).step_by(COUNTS as usize).map(|&n| u64::from(n)).sum::<u64>();
            self.traced.shadow_rays += sum(1) + sum(DISTANT_COUNT as usize);
            self.traced.ambient_rays += sum(AMBIENT_COUNT as usize);
            left = counts[(COUNTS * MAX_BOUNCES) as usize];
            if left == 0 || depth >= max_launches {
                if !finishes {
                    timings.extend(commands.run(|r| finish(self, r))?);
                }
                self.bounces_before = longest;
                self.traced.longest_path = self.traced.longest_path.max(longest);
                return Ok(timings);
            }
        }
    }
}

/// Whether paths pass straight through surfaces: such a passage is no bounce, but needs a ray.
fn passes_straight(features: PathFeatures) -> bool {
    features.contains(PathFeature::Media) || features.contains(PathFeature::ClearWalls)
}

/// Maximum number of rays of a path, without the camera ray.
fn max_rays_of_path(features: PathFeatures, max_depth: u32) -> u32 {
    if passes_straight(features) { max_depth.saturating_add(MAX_STRAIGHT) } else { max_depth }
}

/// Number of bounces in the next submission of a launch of `all` paths of which `left` are left,
/// where the launch before took `before` more bounces. A launch is as large as the paths left at
/// its recording, and a submission costs some tenths of a millisecond on a GPU: the fewer are left,
/// the more bounces. A few paths of millions go on for tens of bounces.
fn bounces_of_submission(all: u32, left: u32, before: u32) -> u32 {
    let fit = u64::from(MIN_BOUNCES) * u64::from(all) / u64::from(left.max(1));
    fit.min(before.into()).clamp(MIN_BOUNCES.into(), MAX_BOUNCES.into()) as u32
}

impl Estimator for PathEstimator {
    const CHANNELS: usize = 3;

    fn steps(&self) -> u32 {
        if let TracedBy::Megakernel(_) = self.traced_by { megakernel::STEPS } else { 1 }
    }

    fn begin(&mut self, block: &BlockParams, film: u64, _: bool) -> Result<u64> {
        self.write_block(block)?;
        let PathParams { radiance, occludes_all, .. } = self.records[0].path;
        let film = FilmParams { film, samples: radiance, occludes_all, ..Default::default() };
        self.film.write(0, bytemuck::bytes_of(&film))?;
        Ok(self.params[0].address())
    }

    fn launch(&mut self, commands: &mut Commands, launches: &[Push], _: bool) -> Result<Vec<Timing>> {
        let mut timings = Vec::new();
        for push in launches {
            timings.extend(self.trace_to_film(commands, *push)?);
        }
        Ok(timings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submissions_grow_as_paths_end() {
        let all = 1 << 21;
        // of the first launch nothing is known
        assert_eq!(bounces_of_submission(all, all, 0), MIN_BOUNCES);
        assert_eq!(bounces_of_submission(all, 100, 0), MIN_BOUNCES);
        // as many groups of threads as at first, and no more bounces than there were before
        assert_eq!(bounces_of_submission(all, all / 3, 23), 12);
        assert_eq!(bounces_of_submission(all, all / 50, 11), 11);
        assert_eq!(bounces_of_submission(all, 0, 1000), MAX_BOUNCES);
    }
}
