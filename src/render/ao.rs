//! Ambient occlusion images: the passes `primary` and `occlusion`, one sample of each pixel after the other.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Control;
use super::block::{Block, BlockParams};
use super::camera::CameraRecord;
use super::film::{Film, FilmPixel};
use super::pace::{MOST, Pace};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Device, Memory, Timing};
use crate::ray::Ray;
use crate::tracer::{Push, Stream, Tracer, stream};

/// A hit whose falloff is below this is not looked for: half a step of an 8-bit image.
pub const FALLOFF_CUTOFF: f64 = 1.0 / 510.0;

/// Bytes of the G-buffer per ray of a launch.
const GBUFFER_BYTES: u64 = 48;

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
        }
    }
}

impl AoOptions {
    /// Hits beyond this distance change nothing that can be seen: the radius, or where the falloff has faded.
    pub fn reach(&self) -> f64 {
        if self.falloff > 1.0 { self.radius.min(-FALLOFF_CUTOFF.ln() / self.falloff.ln()) } else { self.radius }
    }

    /// Does any hit do, or has the nearest one to be found?
    pub fn binary(&self) -> bool {
        self.falloff <= 1.0
    }
}

/// An image and how it came about.
#[derive(Clone, Debug, Default)]
pub struct AoResult {
    /// The image.
    pub film: Film,
    /// Samples that every pixel got.
    pub spp: u32,
    /// Stopped before all samples were taken.
    pub stopped_early: bool,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays not traced because the camera ray met nothing.
    pub skipped_rays: u64,
    /// Device seconds of each pass.
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

/// Buffers of a launch.
struct Launch {
    gbuffer: Buffer,
    params: Buffer,
    dumps: Option<[Buffer; 2]>,
}

/// Renders ambient occlusion.
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn render(tracer: &Tracer, camera: &CameraRecord, options: &AoOptions, control: &mut dyn Control) -> Result<AoResult> {
    let device = tracer.device();
    let start = Instant::now();
    let primary = tracer.stream(&stream::PRIMARY_CLOSEST)?;
    let occlusion = tracer.stream(if options.binary() { &stream::OCCLUSION_ANY } else { &stream::OCCLUSION_CLOSEST })?;
    let mut commands = Commands::new(device)?;
    let blocks = Block::cut(options.size);
    let most = blocks.iter().map(Block::rays).max().unwrap_or(0).min(MOST);
    let mut launch = Launch {
        gbuffer: Buffer::new(device, "G-buffer", GBUFFER_BYTES * most as u64, Memory::Device)?,
        params: Buffer::new(device, "block parameters", 2 * size_of::<BlockParams>() as u64, Memory::Upload)?,
        dumps: match options.keep_rays {
            true => Some([ray_buffer(device, most)?, ray_buffer(device, most)?]),
            false => None,
        },
    };
    let mut out = AoResult { film: Film::new(options.size[0], options.size[1]), spp: options.spp, ..Default::default() };
    let mut pace = Pace::default();
    let total = options.size[0] as u64 * options.size[1] as u64 * options.spp as u64;
    let mut finished_pixels = 0u64;
    for (k, block) in blocks.iter().enumerate() {
        // what is left of the time is shared among the blocks that are left
        let deadline = options.time_limit.map(|limit| {
            let left = limit.saturating_sub(start.elapsed());
            Instant::now() + left / (blocks.len() - k) as u32
        });
        let mut film = Buffer::new(device, "film", size_of::<FilmPixel>() as u64 * block.rays() as u64, Memory::Device)?;
        let mut params = block.params(options.size, camera, options.seed);
        params.hemisphere = (options.hemisphere == Hemisphere::Shading) as u32;
        params.falloff_log2 = options.falloff.log2() as f32;
        params.radius = options.reach() as f32;
        params.film = film.address();
        params.gbuffer = launch.gbuffer.address();
        commands.run(|r| r.clear(&film))?;
        let pixels = block.size[0] as u64 * block.size[1] as u64;
        let mut sample = 0;
        while sample < options.spp {
            let keep =
                if options.keep_rays && sample == 0 { Some((&mut out.kept_primary, &mut out.kept_occlusion)) } else { None };
            one_sample(
                &mut commands,
                tracer,
                [&primary, &occlusion],
                block,
                params,
                &mut launch,
                sample,
                &mut pace,
                keep,
                &mut |timings| {
                    for t in timings {
                        out.longest_launch = out.longest_launch.max(t.seconds);
                        match out.device_seconds.iter_mut().find(|d| d.0 == t.label) {
                            Some(d) => d.1 += t.seconds,
                            None => out.device_seconds.push((t.label, t.seconds)),
                        }
                    }
                    control.should_stop()
                },
            )?;
            sample += 1;
            control.progress(finished_pixels * options.spp as u64 + pixels * sample as u64, total);
            let late = deadline.is_some_and(|d| Instant::now() >= d);
            if sample < options.spp && (late || control.should_stop()?) {
                break;
            }
        }
        finished_pixels += pixels;
        out.spp = out.spp.min(sample);
        out.stopped_early |= sample < options.spp;
        out.primary_rays += pixels * sample as u64;
        let film_size = film.size() / size_of::<FilmPixel>() as u64 * size_of::<FilmPixel>() as u64;
        read_film(&mut film, film_size, block, sample, &mut out)?;
    }
    tracer.check_finished()?;
    out.trace_seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

fn ray_buffer(device: &Arc<Device>, rays: u32) -> Result<Buffer> {
    Buffer::new(device, "ray dump", size_of::<Ray>() as u64 * rays as u64, Memory::Readback)
}

/// Where the rays of a sample go.
type Keep<'a> = (&'a mut Vec<Ray>, &'a mut Vec<Ray>);

/// One sample of every pixel of a block. `seen` gets the timings of each submission; when it says stop, the sample is still
/// finished (a film whose pixels have different counts would be a surprise), unless it fails.
#[expect(clippy::too_many_arguments, reason = "the state of one loop, cut in two to be readable")]
fn one_sample(
    commands: &mut Commands,
    tracer: &Tracer,
    [primary, occlusion]: [&Stream; 2],
    block: &Block,
    params: BlockParams,
    launch: &mut Launch,
    sample: u32,
    pace: &mut Pace,
    mut keep: Option<Keep>,
    seen: &mut dyn FnMut(&[Timing]) -> Result<bool>,
) -> Result<()> {
    let size = size_of::<BlockParams>();
    let dumps = launch.dumps.as_ref().filter(|_| keep.is_some()).map(|d| [d[0].address(), d[1].address()]);
    let with_dump = |k: usize| BlockParams { ray_dump: dumps.map_or(0, |d| d[k]), ..params };
    if let Some(bytes) = launch.params.bytes_mut() {
        bytes[..size].copy_from_slice(bytemuck::bytes_of(&with_dump(0)));
        bytes[size..2 * size].copy_from_slice(bytemuck::bytes_of(&with_dump(1)));
    }
    let pass = launch.params.address();
    let mut first = 0;
    while first < block.rays() {
        let rays = pace.rays().min(MOST);
        let wanted = if keep.is_some() { 1 } else { pace.launches() };
        let (mut launches, begin) = (0, first);
        let start = Instant::now();
        let timings = commands.run(|r| {
            while launches < wanted && first < block.rays() {
                let count = rays.min(block.rays() - first);
                let push = Push { scene: tracer.scene_address(), pass, first, count, sample_index: sample, reserved: 0 };
                r.timed("primary", |r| primary.record(r, &push));
                r.barrier();
                r.timed("occlusion", |r| occlusion.record(r, &Push { pass: pass + size as u64, ..push }));
                // the next launch reuses the G-buffer
                r.barrier();
                first += count;
                launches += 1;
            }
        })?;
        if first - begin >= rays * launches {
            pace.learn(rays, &timings, start.elapsed().as_secs_f64(), launches);
        }
        if let (Some((a, b)), Some([from_a, from_b])) = (keep.as_mut(), launch.dumps.as_ref()) {
            take_rays(from_a, first - begin, a)?;
            take_rays(from_b, first - begin, b)?;
        }
        seen(&timings)?;
    }
    Ok(())
}

/// Appends the rays of a dump that were traced.
fn take_rays(from: &Buffer, count: u32, to: &mut Vec<Ray>) -> Result<()> {
    let size = size_of::<Ray>() as u64;
    from.read_with(0, size * count as u64, size, |_, bytes| {
        to.extend(bytemuck::pod_collect_to_vec::<u8, Ray>(bytes).into_iter().filter(|r| r.tmax > r.tmin));
    })
}

fn read_film(film: &mut Buffer, size: u64, block: &Block, samples: u32, out: &mut AoResult) -> Result<()> {
    let record = size_of::<FilmPixel>() as u64;
    let width = out.film.width;
    film.read_with(0, size, record, |first, bytes| {
        for (k, pixel) in bytes.chunks_exact(record as usize).enumerate() {
            let index = first + k as u64;
            if index < block.rays() as u64
                && let Some(at) = block.image_index(index as u32, width)
            {
                let pixel: FilmPixel = bytemuck::pod_read_unaligned(pixel);
                out.occlusion_rays += pixel.covered as u64;
                out.skipped_rays += (samples - pixel.covered) as u64;
                out.film.set(at, &pixel, samples);
            }
        }
    })
}
