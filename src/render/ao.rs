//! Ambient occlusion images: the passes `primary`, `occlusion` and `resolve`, several samples of each pixel at a time.
//!
//! `primary` traces camera rays; what they meet, it turns into occlusion rays, in a queue; `occlusion` traces that queue and says
//! what each sample adds; `resolve` adds the samples to the film, pixel by pixel and in their order. So an occlusion ray that does
//! not exist costs nothing, neighbouring rays belong to one pixel, and sums do not depend on launch sizes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Control;
use super::block::{Block, BlockParams, TILE_PIXELS};
use super::camera::CameraRecord;
use super::cover::Cover;
use super::film::{Film, FilmPixel};
use super::pace::{MOST, Pace};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Timing};
use crate::ray::Ray;
use crate::tracer::queue::RayQueue;
use crate::tracer::stream::StreamShaders;
use crate::tracer::{Push, Stream, Tracer, stream};

/// A hit whose falloff is below this is not looked for: half a step of an 8-bit image.
pub const FALLOFF_CUTOFF: f64 = 1.0 / 510.0;

/// Samples of a pixel in a launch at most, as a power of two: neighbouring rays, which then start and end close together.
const MOST_SAMPLE_BITS: u32 = 4;
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
struct Launcher<'a> {
    tracer: &'a Tracer,
    primary: Stream,
    occlusion: Stream,
    resolve: ComputePipeline,
    queue: RayQueue,
    samples: Buffer,
    params: Buffer,
    dumps: Option<[Buffer; 2]>,
    commands: Commands,
    pace: Pace,
}

/// The pixels of a block that are rendered, and their film.
struct Plot {
    params: BlockParams,
    // counted in tiles of the block; none: all
    tiles: Option<Vec<u32>>,
    pixels: u32,
    film: Buffer,
    // the film as it was before a batch that may be given up
    before: Option<Buffer>,
    _tile_buffer: Option<Buffer>,
}

/// Samples of every pixel that are taken together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Batch {
    first: u32,
    bits: u32,
}

impl Batch {
    /// As many samples as a launch takes and as are left of `wanted`, but no more than `most` (at least one).
    fn next(first: u32, wanted: u32, most: u32) -> Self {
        let samples = (wanted - first).min(most.max(1));
        Self { first, bits: samples.ilog2().min(MOST_SAMPLE_BITS) }
    }

    fn samples(&self) -> u32 {
        1 << self.bits
    }
}

/// The streams that [`render`] traces.
pub fn streams(options: &AoOptions) -> [&'static StreamShaders; 2] {
    [&stream::PRIMARY_CLOSEST, if options.binary() { &stream::OCCLUSION_ANY } else { &stream::OCCLUSION_CLOSEST }]
}

/// Renders ambient occlusion.
///
/// When `control` says stop, what is kept are whole samples of all pixels: a film whose pixels have different counts would be a
/// surprise. A batch that is under way is given up for that, unless there is nothing else yet.
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn render(tracer: &Tracer, camera: &CameraRecord, options: &AoOptions, control: &mut dyn Control) -> Result<AoResult> {
    let device = tracer.device();
    let start = Instant::now();
    let blocks = Block::cut(options.size);
    let most_pixels = blocks.iter().map(Block::rays).max().unwrap_or(0) as u64;
    let bits = Batch::next(0, options.spp.max(1), u32::MAX).bits;
    let most = (most_pixels << bits).min(MOST as u64) as u32;
    let [primary, occlusion] = streams(options);
    let mut launcher = Launcher {
        tracer,
        primary: tracer.stream(primary)?,
        occlusion: tracer.stream(occlusion)?,
        resolve: stream::RESOLVE.pipeline(device)?,
        queue: RayQueue::new(device, most)?,
        samples: Buffer::new(device, "samples", size_of::<f32>() as u64 * most as u64, Memory::Device)?,
        params: Buffer::new(device, "block parameters", size_of::<BlockParams>() as u64, Memory::Upload)?,
        dumps: match options.keep_rays {
            true => Some([ray_buffer(device, most)?, ray_buffer(device, most)?]),
            false => None,
        },
        commands: Commands::new(device)?,
        pace: Pace::default(),
    };
    let mut out = AoResult { film: Film::new(options.size[0], options.size[1]), spp: options.spp, ..Default::default() };
    let total = options.size[0] as u64 * options.size[1] as u64 * options.spp as u64;
    let mut finished = 0u64;
    for (k, block) in blocks.iter().enumerate() {
        // what is left of the time is shared among the blocks that are left
        let deadline = options.time_limit.map(|limit| {
            let left = limit.saturating_sub(start.elapsed());
            Instant::now() + left / (blocks.len() - k) as u32
        });
        let mut plot = Plot::new(device, block, camera, options)?;
        plot.params.samples = launcher.samples.address();
        plot.params.queue = launcher.queue.record();
        launcher.commands.run(|r| r.clear(&plot.film))?;
        let pixels = block.size[0] as u64 * block.size[1] as u64;
        let began = Instant::now();
        let mut sample = 0;
        while sample < options.spp {
            let keep = options.keep_rays && sample == 0;
            // so many more as there is time for, judged by those that were taken
            let most = match deadline {
                _ if keep => 1,
                None => u32::MAX,
                Some(_) if sample == 0 => 1,
                Some(d) => {
                    let each = began.elapsed().as_secs_f64() / sample as f64;
                    ((d - Instant::now().min(d)).as_secs_f64() / each.max(1e-9)) as u32
                }
            };
            let batch = Batch::next(sample, options.spp, most);
            let done = finished + pixels * sample as u64;
            let mut report = |share: f64, control: &mut dyn Control| {
                let part = (share * (pixels * batch.samples() as u64) as f64) as u64;
                control.progress(done + part, total);
            };
            let Some(batch) = launcher.batch(&mut plot, batch, keep, &mut out, control, &mut report)? else {
                break;
            };
            sample += batch.samples();
            control.progress(finished + pixels * sample as u64, total);
            let late = deadline.is_some_and(|d| Instant::now() >= d);
            if sample < options.spp && (late || control.should_stop()?) {
                break;
            }
        }
        finished += pixels * options.spp as u64;
        out.spp = out.spp.min(sample);
        out.stopped_early |= sample < options.spp;
        plot.take_film(block, sample, &mut out)?;
    }
    tracer.check_finished()?;
    out.trace_seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

fn ray_buffer(device: &Arc<Device>, rays: u32) -> Result<Buffer> {
    Buffer::new(device, "ray dump", size_of::<Ray>() as u64 * rays as u64, Memory::Readback)
}

impl Launcher<'_> {
    /// Takes a batch of samples, or of one sample when it has to stop and there is none yet; says which. `None`: it had to stop,
    /// and the film is as it was. `report` gets the share of the batch that is done.
    fn batch(
        &mut self,
        plot: &mut Plot,
        mut batch: Batch,
        keep: bool,
        out: &mut AoResult,
        control: &mut dyn Control,
        report: &mut dyn FnMut(f64, &mut dyn Control),
    ) -> Result<Option<Batch>> {
        let mut params = plot.params;
        if let Some(dumps) = self.dumps.as_ref().filter(|_| keep) {
            [params.ray_dump, params.occlusion_dump] = [dumps[0].address(), dumps[1].address()];
        }
        if let Some(bytes) = self.params.bytes_mut() {
            bytes[..size_of::<BlockParams>()].copy_from_slice(bytemuck::bytes_of(&params));
        }
        plot.save(&mut self.commands, batch)?;
        let pass = self.params.address();
        let (mut first, mut given_up) = (0u64, false);
        while first < (plot.pixels as u64) << batch.bits {
            let all = (plot.pixels as u64) << batch.bits;
            // pixels are rendered whole
            let rays = self.pace.rays().min(MOST);
            let wanted = if keep { 1 } else { self.pace.launches() };
            let (mut launches, begin) = (0, first);
            let start = Instant::now();
            let (queue, samples) = (&self.queue, &self.samples);
            let timings = self.commands.run(|r| {
                while launches < wanted && first < all {
                    let count = (rays as u64).min(all - first) as u32;
                    let push = Push {
                        scene: self.tracer.scene_address(),
                        pass,
                        first: first as u32,
                        count,
                        sample_index: batch.first,
                        sample_bits: batch.bits,
                        ..Default::default()
                    };
                    queue.clear(r);
                    r.fill(samples, size_of::<f32>() as u64 * count as u64, MET_NOTHING.to_bits());
                    r.barrier();
                    self.primary.record(r, &push);
                    r.barrier();
                    self.occlusion.record(r, &queue.push(push, count));
                    r.barrier();
                    r.timed("resolve", |r| r.dispatch(&self.resolve, &push, (count >> batch.bits).div_ceil(stream::LANES)));
                    // the next launch reuses the queue and the samples
                    r.barrier();
                    first += count as u64;
                    launches += 1;
                }
            })?;
            if first - begin >= rays as u64 * launches as u64 {
                self.pace.learn(rays, &timings, start.elapsed().as_secs_f64(), launches);
            }
            out.add_timings(&timings);
            if let Some([primary, occlusion]) = self.dumps.as_ref().filter(|_| keep) {
                let count = (first - begin) as u32;
                take_rays(primary, count, &mut out.kept_primary)?;
                take_rays(occlusion, count, &mut out.kept_occlusion)?;
            }
            if !given_up {
                report(first as f64 / all as f64, control);
            }
            if first < all && control.should_stop()? && (batch.first > 0 || batch.bits > 0) {
                plot.restore(&mut self.commands, batch)?;
                if batch.first > 0 {
                    return Ok(None);
                }
                // there is nothing yet: one sample, which nothing stops
                batch.bits = 0;
                first = 0;
                given_up = true;
            }
        }
        Ok(Some(batch))
    }
}

impl Plot {
    fn new(device: &Arc<Device>, block: &Block, camera: &CameraRecord, options: &AoOptions) -> Result<Self> {
        let tiles = options.cover.as_ref().and_then(|c| c.tiles(block));
        let pixels = tiles.as_ref().map_or(block.rays(), |t| t.len() as u32 * TILE_PIXELS);
        let film = Buffer::new(device, "film", size_of::<FilmPixel>() as u64 * pixels as u64, Memory::Device)?;
        let tile_buffer = match &tiles {
            Some(t) => Some(Buffer::from_slice(device, "tiles", t)?),
            None => None,
        };
        let params = BlockParams {
            hemisphere: (options.hemisphere == Hemisphere::Shading) as u32,
            falloff_log2: options.falloff.log2() as f32,
            radius: options.reach() as f32,
            film: film.address(),
            tiles: tile_buffer.as_ref().map_or(0, Buffer::address),
            ..block.params(options.size, camera, options.seed)
        };
        Ok(Self { params, tiles, pixels, film, before: None, _tile_buffer: tile_buffer })
    }

    /// Keeps the film, so that a batch can be given up. Before the first it is empty.
    fn save(&mut self, commands: &mut Commands, batch: Batch) -> Result<()> {
        if batch.first == 0 {
            return Ok(());
        }
        let size = self.film.size();
        let before = match self.before.take() {
            Some(b) => b,
            None => self.film.sibling("film before a batch", Memory::Device)?,
        };
        commands.run(|r| r.copy(&self.film, 0, &before, 0, size))?;
        self.before = Some(before);
        Ok(())
    }

    fn restore(&mut self, commands: &mut Commands, batch: Batch) -> Result<()> {
        commands.run(|r| match self.before.as_ref().filter(|_| batch.first > 0) {
            Some(before) => r.copy(before, 0, &self.film, 0, self.film.size()),
            None => r.clear(&self.film),
        })?;
        Ok(())
    }

    /// Puts the film's pixels, of `samples` samples each, in their places.
    fn take_film(&self, block: &Block, samples: u32, out: &mut AoResult) -> Result<()> {
        let record = size_of::<FilmPixel>() as u64;
        let width = out.film.width;
        // pixels of tiles that show nothing are not on the device
        block.each_pixel(width, |at| out.film.set(at, &FilmPixel::default(), samples));
        let mut traced = 0u64;
        self.film.read_with(0, record * self.pixels as u64, record, |first, bytes| {
            for (k, pixel) in bytes.chunks_exact(record as usize).enumerate() {
                let mut index = (first + k as u64) as u32;
                if let Some(tiles) = &self.tiles {
                    index = tiles[(index / TILE_PIXELS) as usize] * TILE_PIXELS + index % TILE_PIXELS;
                }
                if let Some(at) = block.image_index(index, width) {
                    let pixel: FilmPixel = bytemuck::pod_read_unaligned(pixel);
                    traced += samples as u64;
                    out.occlusion_rays += pixel.covered as u64;
                    out.film.set(at, &pixel, samples);
                }
            }
        })?;
        let all = block.size[0] as u64 * block.size[1] as u64 * samples as u64;
        out.primary_rays += traced;
        out.skipped_primary_rays += all - traced;
        out.skipped_rays = out.primary_rays + out.skipped_primary_rays - out.occlusion_rays;
        Ok(())
    }
}

impl AoResult {
    fn add_timings(&mut self, timings: &[Timing]) {
        for t in timings {
            self.longest_launch = self.longest_launch.max(t.seconds);
            match self.device_seconds.iter_mut().find(|d| d.0 == t.label) {
                Some(d) => d.1 += t.seconds,
                None => self.device_seconds.push((t.label, t.seconds)),
            }
        }
    }
}

/// Appends the rays of a dump that were traced.
fn take_rays(from: &Buffer, count: u32, to: &mut Vec<Ray>) -> Result<()> {
    let size = size_of::<Ray>() as u64;
    from.read_with(0, size * count as u64, size, |_, bytes| {
        to.extend(bytemuck::pod_collect_to_vec::<u8, Ray>(bytes).into_iter().filter(|r| r.tmax > r.tmin));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_take_every_sample_once() {
        for (spp, most, want) in [
            (1, u32::MAX, vec![1]),
            (16, u32::MAX, vec![16]),
            (23, u32::MAX, vec![16, 4, 2, 1]),
            (40, u32::MAX, vec![16, 16, 8]),
            (5, 0, vec![1; 5]),
            (9, 3, vec![2, 2, 2, 2, 1]),
        ] {
            let (mut got, mut first) = (Vec::new(), 0);
            while first < spp {
                let b = Batch::next(first, spp, most);
                assert_eq!(b.first, first);
                got.push(b.samples());
                first += b.samples();
            }
            assert_eq!((first, got), (spp, want));
        }
    }
}
