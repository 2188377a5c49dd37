//! Ambient occlusion images: the passes `primary`, `occlusion` and `resolve`, several samples of each pixel at a time.
//!
//! `primary` traces camera rays; what they met, it turns into occlusion rays, in a queue; `occlusion` traces that queue and says
//! what each sample adds; `resolve` adds the samples to the film, pixel by pixel and in their order. So an occlusion ray that does
//! not exist costs nothing, neighbouring rays belong to one pixel, and sums do not depend on launch sizes.

mod attenuation;

use crate::shaders::{self, StreamShaders};
use std::sync::Arc;
use std::time::Duration;

pub use attenuation::Attenuation;

use crate::error::Result;
use crate::film::Control;
use crate::film::Film;
use crate::film::accumulate::{Estimator, Plan, accumulate, most_rays};
use crate::film::block::BlockParams;
use crate::film::camera::CameraRecord;
use crate::film::convergence::TileCount;
use crate::film::cover::Cover;
use crate::film::schedule::FilmOptions;
use crate::film::state::FilmState;
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Timing};
use crate::ray::Ray;
use crate::tracer::queue::RayQueue;

use crate::tracer::{Push, Stream, Tracer};

/// What a sample that met nothing leaves; no accessibility is negative.
const MET_NOTHING: f32 = -1.0;

/// The axis of the hemisphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Hemisphere {
    /// The geometric normal, on the viewer's side (pbrt-v4's AOIntegrator).
    #[default]
    Geometric,
    /// The interpolated shading normal.
    Shading,
}

/// What to render.
#[derive(Clone, Debug)]
pub struct AoOptions {
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel: one camera ray and one occlusion ray each.
    pub spp: u32,
    /// Of the sampler.
    pub seed: u32,
    /// World units beyond which nothing occludes; infinite for no limit.
    pub radius: f64,
    /// c: a hit at distance d counts c^-d; 1 counts every hit alike.
    pub falloff: f64,
    /// Axis of the hemisphere.
    pub hemisphere: Hemisphere,
    /// Stop after this time with what there is.
    pub time_limit: Option<Duration>,
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// Which tiles of the image show anything; without it all are traced.
    pub cover: Option<Arc<Cover>>,
    /// What the film starts from, and where it stops on its way. Rays are kept only of a film that starts empty.
    pub film: FilmOptions,
}

impl Default for AoOptions {
    fn default() -> Self {
        Self {
            size: [1280, 720],
            spp: 16,
            seed: 0,
            radius: f64::INFINITY,
            falloff: 1.0,
            hemisphere: Hemisphere::Geometric,
            time_limit: None,
            keep_rays: false,
            cover: None,
            film: FilmOptions::default(),
        }
    }
}

impl AoOptions {
    /// How far hits occlude, and how much.
    pub fn attenuation(&self) -> Attenuation {
        Attenuation { radius: self.radius, falloff: self.falloff }
    }
}

/// An image and how it came about.
#[derive(Clone, Debug, Default)]
pub struct AoResult {
    /// The image.
    pub film: Film,
    /// Its sums, where they are to be kept.
    pub state: Option<FilmState>,
    /// Tiles that know enough, where there is a target.
    pub converged: Option<TileCount>,
    /// Samples that every pixel got.
    pub spp: u32,
    /// Samples that any pixel got at most.
    pub most_spp: u32,
    /// Stopped before all samples were taken.
    pub stopped_early: bool,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Camera rays not traced because nothing is in their tile of the image.
    pub skipped_primary_rays: u64,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays not traced because there is no surface that they could start from.
    pub skipped_rays: u64,
    /// Device seconds of each step of each pass, `"PASS STEP"`; of a pass that is one shader, `"PASS"`.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Longest launch, device seconds.
    pub longest_launch: f64,
    /// Seconds of the trace loop, compiling included.
    pub trace_seconds: f64,
    /// Camera rays of the first sample, when asked for.
    pub kept_primary: Vec<Ray>,
    /// Occlusion rays of the first sample, when asked for.
    pub kept_occlusion: Vec<Ray>,
}

/// What all launches use.
struct Occlusion {
    primary: Stream,
    occlusion: Stream,
    resolve: ComputePipeline,
    queue: RayQueue,
    samples: Buffer,
    params: Buffer,
    dumps: Option<[Buffer; 2]>,
    kept: [Vec<Ray>; 2],
}

/// The streams that [`render`] traces.
pub fn streams(options: &AoOptions) -> [&'static StreamShaders; 2] {
    [
        &shaders::PRIMARY_CLOSEST,
        if options.attenuation().is_binary() { &shaders::OCCLUSION_ANY } else { &shaders::OCCLUSION_CLOSEST },
    ]
}

/// Renders ambient occlusion; how it stops, [`accumulate`](crate::film::accumulate) says.
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn render(tracer: &Tracer, camera: &CameraRecord, options: &AoOptions, control: &mut dyn Control) -> Result<AoResult> {
    let device = tracer.device();
    let most = most_rays(options.size, options.spp);
    let [primary, occlusion] = streams(options);
    let mut estimator = Occlusion {
        primary: tracer.stream(primary)?,
        occlusion: tracer.stream(occlusion)?,
        resolve: shaders::RESOLVE.pipeline(device)?,
        queue: RayQueue::new(device, most)?,
        samples: Buffer::new(device, "samples", size_of::<f32>() as u64 * most as u64, Memory::Device)?,
        params: Buffer::new(device, "block parameters", size_of::<BlockParams>() as u64, Memory::Upload)?,
        dumps: match options.keep_rays {
            true => Some([ray_buffer(device, most)?, ray_buffer(device, most)?]),
            false => None,
        },
        kept: Default::default(),
    };
    let plan = Plan {
        size: options.size,
        spp: options.spp,
        seed: options.seed,
        time_limit: options.time_limit,
        cover: options.cover.as_deref(),
        film: &options.film,
    };
    let params = BlockParams {
        hemisphere: (options.hemisphere == Hemisphere::Shading) as u32,
        falloff_log2: options.attenuation().falloff_log2() as f32,
        radius: options.attenuation().reach() as f32,
        samples: estimator.samples.address(),
        queue: estimator.queue.record(),
        ..Default::default()
    };
    let image = accumulate(tracer, camera, &plan, &params, &mut estimator, control)?;
    let [kept_primary, kept_occlusion] = estimator.kept;
    let occlusion_rays = image.covered;
    let skipped_rays = image.primary_rays + image.skipped_primary_rays - occlusion_rays;
    Ok(AoResult {
        film: image.film,
        state: image.state,
        converged: image.converged,
        spp: image.spp,
        most_spp: image.most_spp,
        stopped_early: image.stopped_early,
        primary_rays: image.primary_rays,
        skipped_primary_rays: image.skipped_primary_rays,
        occlusion_rays,
        skipped_rays,
        device_seconds: image.device_seconds,
        longest_launch: image.longest_launch,
        trace_seconds: image.trace_seconds,
        kept_primary,
        kept_occlusion,
    })
}

fn ray_buffer(device: &Arc<Device>, rays: u32) -> Result<Buffer> {
    Buffer::new(device, "ray dump", size_of::<Ray>() as u64 * rays as u64, Memory::Readback)
}

impl Estimator for Occlusion {
    const CHANNELS: usize = 1;

    fn keeps_first(&self) -> bool {
        self.dumps.is_some()
    }

    fn begin(&mut self, mut params: BlockParams, keep: bool) -> Result<u64> {
        if let Some(dumps) = self.dumps.as_ref().filter(|_| keep) {
            [params.ray_dump, params.occlusion_dump] = [dumps[0].address(), dumps[1].address()];
        }
        self.params.write(0, bytemuck::bytes_of(&params))?;
        Ok(self.params.address())
    }

    fn launch(&mut self, commands: &mut Commands, launches: &[Push], keep: bool) -> Result<Vec<Timing>> {
        let (queue, samples) = (&self.queue, &self.samples);
        let timings = commands.run(|r| {
            for push in launches {
                queue.clear(r);
                r.fill(samples, size_of::<f32>() as u64 * push.count as u64, MET_NOTHING.to_bits());
                r.barrier();
                self.primary.record(r, push);
                r.barrier();
                self.occlusion.record(r, &queue.push(*push, push.count));
                r.barrier();
                let groups = (push.count >> push.sample_bits).div_ceil(shaders::LANES);
                r.timed("resolve", |r| r.dispatch(&self.resolve, push, groups));
                // the next launch reuses the queue and the samples
                r.barrier();
            }
        })?;
        if let (Some(dumps), [push]) = (self.dumps.as_ref().filter(|_| keep), launches) {
            for (dump, kept) in dumps.iter().zip(&mut self.kept) {
                take_rays(dump, push.count, kept)?;
            }
        }
        Ok(timings)
    }
}

/// Appends the rays of a dump that were traced.
fn take_rays(from: &Buffer, count: u32, to: &mut Vec<Ray>) -> Result<()> {
    let size = size_of::<Ray>() as u64;
    from.read_with(0, size * count as u64, size, |_, bytes| {
        to.extend(bytemuck::pod_collect_to_vec::<u8, Ray>(bytes).into_iter().filter(|r| r.tmax > r.tmin));
    })
}
