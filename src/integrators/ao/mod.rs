//! Ambient occlusion stills: the passes `primary`, `occlusion` and `resolve`, several samples of
//! each pixel at a time.
//!
//! `primary` traces camera rays and appends an occlusion ray to a queue for each hit; `occlusion`
//! traces the queue and writes the value of each sample; `resolve` adds the samples to the film,
//! pixel by pixel and in order. So camera rays that miss cost nothing more, neighbouring occlusion
//! rays belong to one pixel, and sums do not depend on launch sizes.

mod hemisphere;
mod occlusion;
mod rays;
mod report;
pub mod settings;

use std::sync::Arc;

pub use hemisphere::Hemisphere;
pub use occlusion::Occlusion;
pub use rays::AoRays;

use super::{Integrator, IntegratorSettings, PictureOptions, RenderJob, Rendered};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::accumulate::{Accumulated, Estimator, accumulate, max_rays};
use crate::film::block::{BlockParams, PassParams};
use crate::film::camera::CameraRecord;
use crate::film::{Control, SampleSettings};
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Timing};
use crate::interface::records::ao::AoParams;
use crate::interface::records::film::FilmParams;
use crate::output::Image;
use crate::ray::Ray;
use crate::scene::Ground;
use crate::settings::Capability;
use crate::shaders::{self, StreamShaders};
use crate::tracer::stream::launch_rays;
use crate::tracer::{Needs, Push, Tracer};

/// Samples per pixel from which on they share camera rays.
const MIN_SHARING_SPP: u32 = 64;

/// Value of a sample whose camera ray missed; ambient visibility is never negative.
const NO_HIT: f32 = -1.0;

/// Options of an ambient occlusion image.
#[derive(Clone, Debug)]
pub struct AoOptions {
    /// Settings of samples, of one occlusion ray each.
    pub samples: SampleSettings,
    /// Which hits occlude.
    pub occlusion: Occlusion,
    /// Consecutive samples of a pixel that share a camera ray: a power of two.
    pub rays: u32,
    /// The material of a ground that catches shadows: it shows what the scene occludes, and no
    /// surface ([`crate::scene::Scene::catcher`]).
    pub catcher: Option<u32>,
}

impl Default for AoOptions {
    fn default() -> Self {
        Self { samples: SampleSettings::default(), occlusion: Occlusion::default(), rays: 1, catcher: None }
    }
}

impl AoOptions {
    /// The same options with changed settings of samples.
    pub fn with_samples(mut self, change: impl FnOnce(&mut SampleSettings)) -> Self {
        change(&mut self.samples);
        self
    }
}

/// Samples of a pixel that share a camera ray where settings do not say it. With two, images of 64
/// samples have less error where there is something to occlude, and silhouettes one per cent more;
/// of 16 samples they would have six. A film that can be resumed has as many, however many samples
/// it will get.
fn default_rays(samples: &SampleSettings) -> u32 {
    if samples.spp >= MIN_SHARING_SPP && !samples.film.keep_state { 2 } else { 1 }
}

/// Ambient occlusion: the unoccluded fraction of the cosine-weighted hemisphere over a point.
pub struct AmbientOcclusion;

impl AmbientOcclusion {
    fn options(job: &RenderJob) -> AoOptions {
        let ao = &job.settings.ao;
        AoOptions {
            samples: job.samples.clone(),
            occlusion: ao.occlusion(),
            rays: ao.ao_rays.unwrap_or_else(|| default_rays(&job.samples)),
            catcher: job.scene.catcher(),
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

    fn capabilities(&self) -> &'static [Capability] {
        &[
            Capability::AmbientOcclusion,
            Capability::AmbientVisibility,
            Capability::RealTimeFrames,
            Capability::Denoising,
            Capability::KeptRays,
        ]
    }

    fn channels(&self) -> &'static [&'static str] {
        &["Y"]
    }

    fn quantity(&self) -> &'static str {
        "ambient visibility"
    }

    fn blend(&self) -> Blend {
        Blend::Masked
    }

    fn needs(&self, settings: &IntegratorSettings) -> Needs {
        Needs { normals: settings.ao.occlusion().is_about_shading_normals(), ..Default::default() }
    }

    fn streams(&self, settings: &IntegratorSettings) -> Vec<&'static StreamShaders> {
        rays::streams(settings.ao.occlusion()).to_vec()
    }

    /// A camera ray and an occlusion ray.
    fn rays_per_sample(&self) -> u64 {
        2
    }

    /// Not if rays are kept, which must be those of all pixels, or if pixels see beyond their area.
    fn skips_empty_tiles(&self, job: &RenderJob) -> bool {
        !job.samples.keep_rays && job.samples.pixel_filter.is_within_pixel()
    }

    fn sees_environment(&self) -> bool {
        false
    }

    fn identity(&self, job: &RenderJob) -> Vec<(&'static str, Option<String>)> {
        // without `..`, so that a new option must be added here
        let AoOptions { samples, occlusion, rays, catcher } = Self::options(job);
        let SampleSettings {
            size: _,
            spp: _,
            seed: _,
            pixel_filter,
            time_limit: _,
            keep_rays: _,
            tile_mask: _,
            film: _,
        } = samples;
        let mut identity = Vec::from(occlusion.metadata().map(|(key, text)| (key, Some(text))));
        // none of an image whose samples have a camera ray each, as images had before there was a
        // choice
        identity.push(("ao.rays", (rays > 1).then(|| rays.to_string())));
        identity.push(("ground", catcher.map(|_| Ground::Catcher.to_string())));
        identity.push(("pixel_filter", Some(pixel_filter.to_string())));
        identity
    }

    fn render(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        job: &RenderJob,
        control: &mut dyn Control,
    ) -> Result<Rendered> {
        let options = Self::options(job);
        let result = render(tracer, &job.camera_record(flat), &options, control)?;
        let report = report::report(&options, &result);
        Ok(Rendered { image: result.image, report, kept_rays: [result.kept_primary, result.kept_occlusion] })
    }

    fn picture(&self, image: &Image, _: &PictureOptions) -> Image {
        image.clone()
    }
}

/// An image and statistics of its rays.
#[derive(Clone, Debug, Default)]
pub struct AoResult {
    /// The image and statistics of its camera rays.
    pub image: Accumulated,
    /// Camera rays traced: fewer than [`Accumulated::primary_rays`], which counts the samples, if
    /// samples share them.
    pub camera_rays: u64,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays not traced because their camera ray missed.
    pub skipped_rays: u64,
    /// Camera rays started below the root of the hierarchy in launches of enough samples.
    pub has_entry_points: bool,
    /// Camera rays of the first sample, if [`SampleSettings::keep_rays`] is set.
    pub kept_primary: Vec<Ray>,
    /// Occlusion rays of the first sample, if [`SampleSettings::keep_rays`] is set.
    pub kept_occlusion: Vec<Ray>,
}

/// Streams and buffers of all launches.
struct AoEstimator {
    rays: AoRays,
    has_entry_points: bool,
    resolve: ComputePipeline,
    params: PassParams<AoParams>,
    own: AoParams,
    film: Buffer,
    dumps: Option<[Buffer; 2]>,
    kept: [Vec<Ray>; 2],
    // samples and camera rays of all launches, padding included
    launched: [u64; 2],
}

/// Renders ambient occlusion. [`accumulate`](crate::film::accumulate) says when it stops.
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn render(
    tracer: &Tracer,
    camera: &CameraRecord,
    options: &AoOptions,
    control: &mut dyn Control,
) -> Result<AoResult> {
    let device = tracer.device();
    let samples = &options.samples;
    let most = max_rays(launch_rays(&device.info), samples.size, samples.spp, AoEstimator::SAMPLE_BITS);
    let sample_bits = samples.spp.max(1).ilog2().min(AoEstimator::SAMPLE_BITS);
    let camera_shift = options.rays.max(1).ilog2();
    let rays = AoRays::new(tracer, options.occlusion, most, sample_bits, camera_shift, options.catcher)?;
    let mut estimator = AoEstimator {
        own: rays.params(options.occlusion.record(), camera),
        has_entry_points: rays.has_entry_points(camera),
        rays,
        resolve: shaders::RESOLVE.pipeline(device)?,
        params: PassParams::new(device, "parameters of ambient occlusion")?,
        film: Buffer::new(device, "parameters of the film", size_of::<FilmParams>() as u64, Memory::Upload)?,
        dumps: if samples.keep_rays { Some([ray_buffer(device, most)?, ray_buffer(device, most)?]) } else { None },
        kept: Default::default(),
        launched: [0; 2],
    };
    let image = accumulate(tracer, camera, samples, &mut estimator, control)?;
    let has_entry_points = estimator.has_entry_points;
    let [kept_primary, kept_occlusion] = estimator.kept;
    let [launched_samples, launched_camera_rays] = estimator.launched;
    let camera_share = launched_camera_rays as f64 / launched_samples.max(1) as f64;
    let camera_rays = (image.primary_rays as f64 * camera_share).round() as u64;
    let occlusion_rays = image.covered;
    let skipped_rays = image.primary_rays + image.skipped_primary_rays - occlusion_rays;
    Ok(AoResult { image, camera_rays, occlusion_rays, skipped_rays, has_entry_points, kept_primary, kept_occlusion })
}

fn ray_buffer(device: &Arc<Device>, rays: u32) -> Result<Buffer> {
    Buffer::new(device, "ray dump", size_of::<Ray>() as u64 * rays as u64, Memory::Readback)
}

impl Estimator for AoEstimator {
    const CHANNELS: usize = 1;
    // packets of camera rays are of one pixel then
    const SAMPLE_BITS: u32 = 6;

    fn keeps_first(&self) -> bool {
        self.dumps.is_some()
    }

    fn begin(&mut self, block: &BlockParams, film: u64, keep: bool) -> Result<u64> {
        let mut own = self.own;
        if let Some(dumps) = self.dumps.as_ref().filter(|_| keep) {
            [own.ray_dump, own.occlusion_dump] = [dumps[0].address(), dumps[1].address()];
        }
        self.params.write(block, &own)?;
        let film = FilmParams { film, samples: self.own.samples, ..Default::default() };
        self.film.write(0, bytemuck::bytes_of(&film))?;
        Ok(self.params.address())
    }

    fn launch(&mut self, commands: &mut Commands, launches: &[Push], keep: bool) -> Result<Vec<Timing>> {
        let timings = commands.run(|r| {
            for push in launches {
                self.launched[0] += u64::from(push.count);
                self.launched[1] += u64::from(self.rays.camera_push(push).count);
                self.rays.record(r, push, self.has_entry_points);
                r.barrier();
                let groups = (push.count >> push.sample_bits).div_ceil(shaders::LANES);
                let resolved = Push { pass: self.film.address(), ..*push };
                r.timed("resolve", |r| r.dispatch(&self.resolve, &resolved, groups));
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

/// Appends the active rays of a dump.
fn take_rays(from: &Buffer, count: u32, to: &mut Vec<Ray>) -> Result<()> {
    let size = size_of::<Ray>() as u64;
    from.read_with(0, size * count as u64, size, |_, bytes| {
        to.extend(bytemuck::pod_collect_to_vec::<u8, Ray>(bytes).into_iter().filter(|r| r.tmax > r.tmin));
    })
}
