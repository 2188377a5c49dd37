//! Path tracing: the truth that ambient occlusion stands in for. The streams `path_camera`, `path_bounce` and `path_shadow` and the pass
//! `path_resolve`, several samples of each pixel at a time.
//!
//! A wavefront (Laine, Karras, Aila 2013): `path_camera` traces camera rays and shades what they meet, which leaves rays to lights in one
//! queue and rays of the next bounce in another; `path_shadow` traces the first, `path_bounce` the second, and so on until a queue is
//! empty. Every path writes to places of its own only, so images do not depend on the order in which rays arrive.

mod environment;
mod features;
pub mod kinds;
mod light_tree;
mod lights;
mod media;
mod params;
mod report;
pub mod settings;

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::accumulate::{Accumulated, Estimator, Plan, accumulate, most_rays};
use crate::film::block::BlockParams;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands, ComputePipeline, Memory, Specialization, Timing};
use crate::interface::{LightKind, LightKinds, MaterialFeature, PathFeature, PathFeatures};
pub use crate::interface::{PixelFilter, View};
use crate::scene::Environment;
use crate::shaders::{self, StreamShaders};
use crate::tracer::queue::RayQueue;
use crate::tracer::{Push, Stream, Tracer};
use environment::DeviceEnvironment;
use lights::Lights;
use media::Bodies;
use params::{CONE_BYTES, INVALID, MEDIA_BYTES, PathParams, QUAD_BYTES, SKY_PDF_BYTES, STATE_BYTES, STRAIGHT_BYTES};
pub use settings::{Lens, MOST_DEPTH, PathOptions, Strategy, TextureFilter};

/// Bounces of a submission; then the host asks how many paths are left.
const BOUNCES: u32 = 4;
/// Surfaces that a path goes straight through at most: more of them end it.
const MAX_STRAIGHT: u32 = 4096;
/// An image and how it came about.
#[derive(Clone, Debug, Default)]
pub struct PathResult {
    /// The image, linear RGB radiance, and the work of its camera rays.
    pub image: Accumulated,
    /// Rays of all bounces but the first.
    pub bounce_rays: u64,
    /// Rays to lights.
    pub shadow_rays: u64,
    /// Bounces of the longest path.
    pub longest_path: u32,
    /// Lights that light samples are drawn from.
    pub lights: u32,
    /// They are so many that a tree chooses among them.
    pub light_tree: bool,
    /// What of the shaders was compiled.
    pub features: PathFeatures,
    /// Kinds of lights that light samples were compiled for.
    pub light_kinds: LightKinds,
}

/// The streams that [`render`] traces and that nothing but the scene's geometry is needed for.
pub fn streams() -> [&'static StreamShaders; 2] {
    [&shaders::PATH_BOUNCE_CLOSEST, &shaders::PATH_SHADOW_ANY]
}

/// Renders. The tracer must have been made of `flat` with [`crate::tracer::Needs::shading`].
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
    PathIntegrator::new(tracer, flat, options)?.render(tracer, camera, options.spp, options.seed, control)
}

/// Renders one scene again and again: lights, environment, queues and pipelines are made once.
pub struct PathIntegrator {
    paths: Paths,
    options: PathOptions,
}

impl PathIntegrator {
    /// For images of `options.spp` paths a pixel at most. The tracer must have been made of `flat` with
    /// [`crate::tracer::Needs::shading`].
    ///
    /// # Errors
    /// Those of the device; [`Error::Usage`] for a tracer that was made for less.
    pub fn new(tracer: &Tracer, flat: &FlatScene, options: &PathOptions) -> Result<Self> {
        Ok(Self { paths: Paths::new(tracer, flat, options)?, options: options.clone() })
    }

    /// Lights that light samples are drawn from.
    pub fn lights(&self) -> u32 {
        self.paths.lights
    }

    /// Renders `spp` paths a pixel. `tracer` must be the one that it was made with.
    ///
    /// # Errors
    /// Those of the device; [`Error::Usage`] for more paths than it was made for; [`crate::Error::Interrupted`] when `control` says so.
    pub fn render(
        &mut self,
        tracer: &Tracer,
        camera: &CameraRecord,
        spp: u32,
        seed: u32,
        control: &mut dyn Control,
    ) -> Result<PathResult> {
        let Self { paths, options } = self;
        paths.place_camera(camera)?;
        if spp > options.spp {
            return Err(Error::Usage(format!("{spp} paths a pixel: the integrator was made for {}", options.spp)));
        }
        let plan = Plan {
            size: options.size,
            spp,
            seed,
            time_limit: options.time_limit,
            cover: options.cover.as_deref(),
            film: &options.film,
        };
        paths.traced = Traced::default();
        let image = accumulate(tracer, camera, &plan, &BlockParams::default(), paths, control)?;
        let Traced { bounce_rays, shadow_rays, longest_path } = paths.traced;
        Ok(PathResult {
            image,
            bounce_rays,
            shadow_rays,
            longest_path,
            lights: paths.lights,
            light_tree: paths.light_tree,
            features: paths.features,
            light_kinds: paths.light_kinds,
        })
    }
}

/// What an image took.
#[derive(Clone, Copy, Default)]
struct Traced {
    bounce_rays: u64,
    shadow_rays: u64,
    longest_path: u32,
}

/// What rays to lights need where thin walls let them through.
struct Walls {
    stream: Stream,
    /// Rays that have come through one wall more; they go back and forth between this queue and that of rays to lights.
    later: RayQueue,
    contributions: Buffer,
    count: Buffer,
}

struct Paths {
    camera: Stream,
    bounce: Stream,
    shadow: Stream,
    resolve: ComputePipeline,
    /// Of bounces: what one is traced from, the other is filled with.
    queues: [RayQueue; 2],
    shadow_queue: RayQueue,
    /// Parameters that fill either queue; then those of rays that come through walls, out of either queue of rays to lights.
    block_params: Vec<Buffer>,
    path_params: Vec<Buffer>,
    records: Vec<PathParams>,
    walls: Option<Walls>,
    /// What paths may be inside of, where it matters.
    bodies: Option<Bodies>,
    /// How many rays each bounce and its light samples traced.
    counts: Buffer,
    max_depth: u32,
    samples_lights: bool,
    traced: Traced,
    lights: u32,
    light_tree: bool,
    features: PathFeatures,
    light_kinds: LightKinds,
    _buffers: Vec<Buffer>,
    _environment: DeviceEnvironment,
}

impl Paths {
    fn new(tracer: &Tracer, flat: &FlatScene, options: &PathOptions) -> Result<Self> {
        let device = tracer.device();
        // a tracer that was made for less would make a wrong image, and say nothing
        let Some(shading) = tracer.features().shading else {
            return Err(Error::Usage("paths need a tracer that was made with Needs::shading".into()));
        };
        if shading.materials.contains(MaterialFeature::White) && options.white_sky.is_none() {
            return Err(Error::Usage(
                "a tracer that was made with Needs::white knows no materials: paths under other skies need them".into(),
            ));
        }
        let cones = options.texture_filter == TextureFilter::RayCone && options.white_sky.is_none();
        if cones && !shading.materials.contains(MaterialFeature::RayCones) {
            return Err(Error::Usage("ray cones need a tracer that was made with Needs::mip_levels".into()));
        }
        let most = most_rays(options.size, options.spp);
        let white = Environment::Uniform(glam::Vec3::ONE);
        let around = match options.view {
            // it shows surfaces, whatever shines on them
            Some(_) => &Environment::Black,
            None if options.white_sky.is_some() => &white,
            None => &flat.scene.environment,
        };
        let environment = DeviceEnvironment::new(device, around, options.strategy == Strategy::Mis)?;
        let lights = match options.white_sky {
            _ if options.view.is_some() => Lights::default(),
            Some(_) => Lights::sky_only(),
            None => Lights::new(flat, environment.mean),
        };
        let (features, light_kinds) = features::features(options, flat, &lights, environment.map.texels != 0, cones);
        let [has_media, has_clear_walls] = [PathFeature::Media, PathFeature::ClearWalls].map(|f| features.contains(f));
        let stores_sky_pdfs = features.contains(PathFeature::LightSamples)
            && lights.environment.is_some()
            && (environment.map.texels == 0 || light_kinds.contains(LightKind::Portal));
        let constants = Specialization::default().set_all(features.constants()).set_all(light_kinds.constants());
        let quads = |name: &str| Buffer::new(device, name, QUAD_BYTES * most as u64, Memory::Device);
        let queues = [RayQueue::new(device, most)?, RayQueue::new(device, most)?];
        let shadow_queue = RayQueue::new(device, most)?;
        let (radiance, contributions) = (quads("radiance of paths")?, quads("what lights bring")?);
        let states = || Buffer::new(device, "paths", STATE_BYTES * most as u64, Memory::Device);
        let mut buffers = Vec::new();
        let mut keep = |buffer: Buffer| {
            let address = buffer.address();
            buffers.push(buffer);
            address
        };
        let base = PathParams {
            map: environment.map,
            environment: environment.factor.to_array(),
            light_count: lights.choices(),
            light_first: lights.first,
            light_tree: match lights.tree.is_empty() {
                true => 0,
                false => keep(Buffer::from_slice(device, "tree of lights", &lights.tree)?),
            },
            lights: if lights.records.is_empty() { 0 } else { keep(Buffer::from_slice(device, "lights", &lights.records)?) },
            light_of: match lights.light_of.is_empty() {
                true => 0,
                false => keep(Buffer::from_slice(device, "lights of instances", &lights.light_of)?),
            },
            light_starts: match lights.starts.is_empty() {
                true => 0,
                false => keep(Buffer::from_slice(device, "distribution of lights", &lights.starts)?),
            },
            first_disk: lights.directional.start,
            disk_count: lights.directional.end - lights.directional.start,
            radiance: keep(radiance),
            contributions: keep(contributions),
            shadow: shadow_queue.record(),
            environment_light: lights.environment.unwrap_or(INVALID),
            cones: match cones {
                true => keep(Buffer::new(device, "cones of paths", CONE_BYTES * most as u64, Memory::Device)?),
                false => 0,
            },
            media: match has_media {
                true => keep(Buffer::new(device, "volumes around paths", MEDIA_BYTES * most as u64, Memory::Device)?),
                false => 0,
            },
            straight: match has_clear_walls {
                true => keep(Buffer::new(device, "straight lengths of paths", STRAIGHT_BYTES * most as u64, Memory::Device)?),
                false => 0,
            },
            sky_pdfs: match stores_sky_pdfs {
                true => keep(Buffer::new(device, "densities of the sky", SKY_PDF_BYTES * most as u64, Memory::Device)?),
                false => 0,
            },
            camera_media: [INVALID; 4],
            ..options.params()
        };
        let states = [keep(states()?), keep(states()?)];
        let samples_lights = options.strategy.samples_lights() && !lights.records.is_empty() && options.view.is_none();
        let walls = match has_clear_walls && samples_lights {
            true => Some(Walls {
                stream: tracer.specialized(&shaders::PATH_SHADOW_WALLS_CLOSEST, &constants)?,
                later: RayQueue::new(device, most)?,
                contributions: quads("what lights bring through walls")?,
                count: Buffer::new(device, "number of rays behind walls", 4, Memory::Readback)?,
            }),
            false => None,
        };
        // those with number k fill queue k, and read what belongs to the other
        let of_bounces = |k: usize| {
            let (next, tags) = (queues[k].record(), queues[k ^ 1].record().tags);
            PathParams { next, tags, states: states[k ^ 1], next_states: states[k], ..base }
        };
        let mut records = vec![of_bounces(0), of_bounces(1)];
        // rays to lights go from one queue to the other at each wall
        if let Some(w) = &walls {
            let (later, later_contributions) = (w.later.record(), w.contributions.address());
            records.push(PathParams { later, later_contributions, ..base });
            let (shadow, contributions) = (later, later_contributions);
            let (later, later_contributions) = (base.shadow, base.contributions);
            records.push(PathParams { shadow, contributions, later, later_contributions, ..base });
        }
        let path_params = records
            .iter()
            .map(|record| Buffer::from_slice(device, "parameters of paths", &[*record]))
            .collect::<Result<Vec<_>>>()?;
        let block_params = records
            .iter()
            .map(|_| Buffer::new(device, "block parameters", size_of::<BlockParams>() as u64, Memory::Upload))
            .collect::<Result<Vec<_>>>()?;
        Ok(Self {
            camera: tracer.specialized(&shaders::PATH_CAMERA_CLOSEST, &constants)?,
            bounce: tracer.specialized(&shaders::PATH_BOUNCE_CLOSEST, &constants)?,
            shadow: tracer.stream(&shaders::PATH_SHADOW_ANY)?,
            resolve: shaders::PATH_RESOLVE.pipeline(device)?,
            queues,
            shadow_queue,
            block_params,
            path_params,
            records,
            walls,
            bodies: has_media.then(|| Bodies::new(flat)),
            counts: Buffer::new(device, "numbers of rays", 4 * 2 * u64::from(BOUNCES + 1), Memory::Readback)?,
            max_depth: options.bounces(),
            samples_lights,
            traced: Traced::default(),
            lights: if options.strategy.samples_lights() { lights.count() } else { 0 },
            light_tree: !lights.tree.is_empty(),
            features,
            light_kinds,
            _buffers: buffers,
            _environment: environment,
        })
    }

    /// Says which volumes the camera is in. Parallel rays and those through a lens count as starting where the camera is.
    fn place_camera(&mut self, camera: &CameraRecord) -> Result<()> {
        let Some(bodies) = &self.bodies else { return Ok(()) };
        let eye = glam::DVec3::from_array([0, 1, 2].map(|row| f64::from(camera.camera_to_world[row][3])));
        let camera_media = bodies.around(eye);
        for (record, buffer) in self.records.iter_mut().zip(&mut self.path_params) {
            record.camera_media = camera_media;
            buffer.write(0, bytemuck::bytes_of(record))?;
        }
        Ok(())
    }

    /// Traces the rays to lights that a vertex left; notes how many in place `slot`.
    fn record_shadow(&self, r: &mut crate::gpu::Recorder, push: Push, most: u32, slot: u32) {
        if !self.samples_lights {
            return;
        }
        r.barrier();
        match &self.walls {
            None => self.shadow.record(r, &self.shadow_queue.push(push, most)),
            Some(walls) => {
                walls.later.clear(r);
                r.barrier();
                let push = Push { pass: self.block_params[2].address(), ..push };
                walls.stream.record(r, &self.shadow_queue.push(push, most));
                r.barrier();
                r.copy(walls.later.count(), 0, &walls.count, 0, 4);
            }
        }
        r.barrier();
        r.copy(self.shadow_queue.count(), 0, &self.counts, 8 * u64::from(slot) + 4, 4);
    }

    /// Traces rays to lights that have come through a wall, wall after wall, until none is left.
    fn trace_behind_walls(&mut self, commands: &mut Commands, push: Push) -> Result<Vec<Timing>> {
        let mut timings = Vec::new();
        let Some(walls) = self.walls.as_ref().filter(|_| self.samples_lights) else { return Ok(timings) };
        let queues = [&self.shadow_queue, &walls.later];
        // those that vertices left went from the first queue to the second
        let mut from = 1;
        loop {
            let left: u32 = bytemuck::pod_read_unaligned(&walls.count.read(0, 4)?);
            if left == 0 {
                return Ok(timings);
            }
            self.traced.shadow_rays += u64::from(left);
            let push = Push { pass: self.block_params[2 + from].address(), ..push };
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

    /// All bounces of a launch, `BOUNCES` to a submission; behind walls that let light through, one.
    fn launch_one(&mut self, commands: &mut Commands, push: Push) -> Result<Vec<Timing>> {
        let passes = [0, 1].map(|k| self.block_params[k].address());
        let push = |fills: usize| Push { pass: passes[fills], ..push };
        // what a path goes straight through is no bounce, but it takes a launch
        let straight = self.bodies.is_some() || self.features.contains(PathFeature::ClearWalls);
        let max_launches = if straight { self.max_depth.saturating_add(MAX_STRAIGHT) } else { self.max_depth };
        let (mut timings, mut depth, mut left, mut started) = (Vec::new(), 0, push(0).count, false);
        // vertex `depth` fills queue `depth % 2`
        loop {
            // rays behind walls are traced before the next vertices leave others
            let bounces = if self.walls.is_some() { u32::from(started) } else { BOUNCES };
            let (begin, last) = (depth, depth + bounces);
            timings.extend(commands.run(|r| {
                r.fill(&self.counts, self.counts.size(), 0);
                if !started {
                    self.queues[0].clear(r);
                    self.shadow_queue.clear(r);
                    r.barrier();
                    self.camera.record(r, &push(0));
                    self.record_shadow(r, push(0), left, BOUNCES);
                }
                while depth < last.min(max_launches) {
                    depth += 1;
                    let (fills, traced) = (depth as usize % 2, (depth as usize + 1) % 2);
                    r.barrier();
                    self.queues[fills].clear(r);
                    self.shadow_queue.clear(r);
                    r.barrier();
                    self.bounce.record(r, &self.queues[traced].push(push(fills), left));
                    r.copy(self.queues[traced].count(), 0, &self.counts, 8 * u64::from((depth - 1) % BOUNCES), 4);
                    self.record_shadow(r, push(fills), left, (depth - 1) % BOUNCES);
                }
                r.barrier();
                // what is left for the next submission
                r.copy(self.queues[depth as usize % 2].count(), 0, &self.counts, 8 * u64::from(BOUNCES), 4);
            })?);
            started = true;
            timings.extend(self.trace_behind_walls(commands, push(0))?);
            let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.counts.read(0, self.counts.size())?);
            for k in begin..depth {
                let rays = counts[2 * ((k % BOUNCES) as usize)];
                self.traced.bounce_rays += u64::from(rays);
                if rays > 0 {
                    self.traced.longest_path = self.traced.longest_path.max(k + 1);
                }
            }
            self.traced.shadow_rays += counts.iter().skip(1).step_by(2).map(|&n| u64::from(n)).sum::<u64>();
            left = counts[2 * BOUNCES as usize];
            if left == 0 || depth >= max_launches {
                break;
            }
        }
        let groups = (push(0).count >> push(0).sample_bits).div_ceil(shaders::LANES);
        timings.extend(commands.run(|r| r.timed("path_resolve", |r| r.dispatch(&self.resolve, &push(0), groups)))?);
        Ok(timings)
    }
}

impl Estimator for Paths {
    const CHANNELS: usize = 3;

    fn begin(&mut self, params: BlockParams, _: bool) -> Result<u64> {
        for (buffer, path) in self.block_params.iter_mut().zip(&self.path_params) {
            buffer.write(0, bytemuck::bytes_of(&BlockParams { path: path.address(), ..params }))?;
        }
        Ok(self.block_params[0].address())
    }

    fn launch(&mut self, commands: &mut Commands, launches: &[Push], _: bool) -> Result<Vec<Timing>> {
        let mut timings = Vec::new();
        for push in launches {
            timings.extend(self.launch_one(commands, *push)?);
        }
        Ok(timings)
    }
}
