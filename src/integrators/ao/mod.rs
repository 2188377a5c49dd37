//! Ambient occlusion images: the passes `primary`, `occlusion` and `resolve`, several samples of each pixel at a time.
//!
//! `primary` traces camera rays; what they met, it turns into occlusion rays, in a queue; `occlusion` traces that queue and says
//! what each sample adds; `resolve` adds the samples to the film, pixel by pixel and in their order. So an occlusion ray that does
//! not exist costs nothing, neighbouring rays belong to one pixel, and sums do not depend on launch sizes.

mod attenuation;
use crate::settings::choices;
mod report;
pub mod settings;

use crate::shaders::{self, StreamShaders};
use std::sync::Arc;
use std::time::Duration;

pub use attenuation::Attenuation;

use super::{Integrator, IntegratorSettings, PictureOptions, Rendered, Shot};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::Control;
use crate::film::accumulate::{Accumulated, Estimator, Plan, accumulate, max_rays};
use crate::film::block::BlockParams;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Timing};
use crate::output::Image;
use crate::ray::Ray;
use crate::scene::Scene;
use crate::tracer::queue::RayQueue;

use crate::tracer::{Needs, Push, Stream, Tracer};

/// What a sample that met nothing leaves; no accessibility is negative.
const MET_NOTHING: f32 = -1.0;

choices! {
    /// The axis of the hemisphere that occlusion rays fill.
    pub enum Hemisphere {
        /// Geometric normal, on the viewer's side (as pbrt-v4's AOIntegrator)
        Geometric = "geometric",
        /// Shading normal (interpolated)
        Shading = "shading",
    }
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
    pub tile_mask: Option<Arc<TileMask>>,
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
            tile_mask: None,
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

/// Ambient occlusion: the fraction of the cosine-weighted hemisphere over a point that is open.
pub struct AmbientOcclusion;

impl AmbientOcclusion {
    fn options(shot: &Shot) -> AoOptions {
        let ao = &shot.settings.ao;
        AoOptions {
            size: shot.size,
            spp: shot.spp,
            seed: shot.seed,
            radius: ao.radius(),
            falloff: ao.ao_falloff.unwrap_or(1.0),
            hemisphere: ao.hemisphere(),
            time_limit: shot.time_limit,
            keep_rays: shot.keep_rays,
            tile_mask: None,
            film: shot.film.clone(),
        }
    }
}

impl Integrator for AmbientOcclusion {
    fn name(&self) -> &'static str {
        "ao"
    }

    fn help(&self) -> &'static str {
        "Ambient occlusion"
    }

    fn channels(&self) -> &'static [&'static str] {
        &["Y"]
    }

    fn quantity(&self) -> &'static str {
        "ambient visibility"
    }

    fn flatten<'s>(&self, scene: &'s Scene) -> Result<FlatScene<'s>> {
        Ok(FlatScene::new(scene))
    }

    fn needs(&self, settings: &IntegratorSettings) -> Needs {
        Needs { normals: settings.ao.hemisphere() == Hemisphere::Shading, ..Default::default() }
    }

    fn streams(&self, settings: &IntegratorSettings) -> Vec<&'static StreamShaders> {
        let falloff = settings.ao.ao_falloff.unwrap_or(1.0);
        streams(&AoOptions { falloff, ..Default::default() }).to_vec()
    }

    /// A camera ray and an occlusion ray.
    fn rays_per_sample(&self) -> u64 {
        2
    }

    /// A dump of rays is a set to compare with: all of them.
    fn skips_empty_tiles(&self, shot: &Shot) -> bool {
        !shot.keep_rays
    }

    fn sees_environment(&self) -> bool {
        false
    }

    fn identity(&self, shot: &Shot) -> Vec<(&'static str, Option<String>)> {
        // no `..`: a new option has to be put where it belongs
        let AoOptions {
            size: _,
            spp: _,
            time_limit: _,
            keep_rays: _,
            tile_mask: _,
            film: _,
            seed: _,
            radius,
            falloff,
            hemisphere,
        } = Self::options(shot);
        vec![
            ("ao.radius", Some(radius.to_string())),
            ("ao.falloff", Some(falloff.to_string())),
            ("ao.normal", Some(hemisphere.to_string())),
        ]
    }

    fn render(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        shot: &Shot,
        tile_mask: Option<Arc<TileMask>>,
        control: &mut dyn Control,
    ) -> Result<Rendered> {
        let options = AoOptions { tile_mask, ..Self::options(shot) };
        let result = render(tracer, &shot.camera_record(flat), &options, control)?;
        let report = report::report(&options, &result);
        Ok(Rendered { image: result.image, report, kept_rays: [result.kept_primary, result.kept_occlusion] })
    }

    fn picture(&self, image: &Image, _: &PictureOptions) -> Image {
        image.clone()
    }
}

/// An image and how it came about.
#[derive(Clone, Debug, Default)]
pub struct AoResult {
    /// The image and the work of its camera rays.
    pub image: Accumulated,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays not traced because there is no surface that they could start from.
    pub skipped_rays: u64,
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
    let most = max_rays(options.size, options.spp);
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
        tile_mask: options.tile_mask.as_deref(),
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
    Ok(AoResult { image, occlusion_rays, skipped_rays, kept_primary, kept_occlusion })
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
