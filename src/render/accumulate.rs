//! Samples of every pixel, added up on a film: the image block by block, batch by batch and launch by launch, with progress, a time limit
//! and a way to stop that leaves whole samples of all pixels. What a sample is, an [`Estimator`] knows.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Control;
use super::block::{Block, BlockParams, TILE_PIXELS};
use super::camera::CameraRecord;
use super::cover::Cover;
use super::film::{Film, FilmPixel, record_bytes};
use super::pace::{MOST, Pace};
use crate::error::Result;
use crate::gpu::{Buffer, Commands, Device, Memory, Timing};
use crate::tracer::{Push, Tracer};

/// Samples of a pixel in a launch at most, as a power of two: neighbouring rays, which then start and end close together.
const MOST_SAMPLE_BITS: u32 = 4;

/// What estimates pixels.
pub(super) trait Estimator {
    /// Values of a pixel of its film.
    const CHANNELS: usize;

    /// Has to keep what the launches of the first sample of each pixel trace: it then comes alone.
    fn keeps_first(&self) -> bool {
        false
    }

    /// Before the launches of a batch. `keep`: it is the first sample, and [`Estimator::keeps_first`]. Returns the address of the pass's
    /// parameters.
    fn begin(&mut self, params: BlockParams, keep: bool) -> Result<u64>;

    /// Runs launches one after the other, and adds what they find to the film that the parameters name. With `keep` there is one.
    fn launch(&mut self, commands: &mut Commands, launches: &[Push], keep: bool) -> Result<Vec<Timing>>;
}

/// How to accumulate.
pub(super) struct Plan<'a> {
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub spp: u32,
    /// Of the sampler.
    pub seed: u32,
    /// Stop after this time with what there is.
    pub time_limit: Option<Duration>,
    /// Which tiles of the image show anything; without it all are traced.
    pub cover: Option<&'a Cover>,
}

/// An image and how it came about.
#[derive(Clone, Debug, Default)]
pub struct Accumulated {
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
    /// Camera rays that met something.
    pub covered: u64,
    /// Device seconds of each step of each pass, `"PASS STEP"`; of a pass that is one shader, `"PASS"`.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Longest launch, device seconds.
    pub longest_launch: f64,
    /// Seconds of the trace loop, compiling included.
    pub trace_seconds: f64,
}

/// Rays of a launch at most, for a plan: what an estimator's buffers hold.
pub(super) fn most_rays(size: [u32; 2], spp: u32) -> u32 {
    let most_pixels = Block::cut(size).iter().map(Block::rays).max().unwrap_or(0) as u64;
    let bits = Batch::next(0, spp.max(1), u32::MAX).bits;
    (most_pixels << bits).min(MOST as u64) as u32
}

/// The pixels of a block that are rendered, and their film.
struct Plot {
    params: BlockParams,
    channels: usize,
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

/// Renders. `params`: what the estimator wants in its parameters beside what every block has.
///
/// When `control` says stop, what is kept are whole samples of all pixels: a film whose pixels have different counts would be a
/// surprise. A batch that is under way is given up for that, unless there is nothing else yet.
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub(super) fn accumulate<E: Estimator>(
    tracer: &Tracer,
    camera: &CameraRecord,
    plan: &Plan,
    params: &BlockParams,
    estimator: &mut E,
    control: &mut dyn Control,
) -> Result<Accumulated> {
    let (start, blocks) = (Instant::now(), Block::cut(plan.size));
    let mut launcher = Launcher { tracer, estimator, commands: Commands::new(tracer.device())?, pace: Pace::default() };
    let film = Film::new(plan.size[0], plan.size[1], E::CHANNELS);
    let mut out = Accumulated { film, spp: plan.spp, ..Default::default() };
    let total = plan.size[0] as u64 * plan.size[1] as u64 * plan.spp as u64;
    let mut finished = 0u64;
    for (k, block) in blocks.iter().enumerate() {
        // what is left of the time is shared among the blocks that are left
        let deadline = plan.time_limit.map(|limit| {
            let left = limit.saturating_sub(start.elapsed());
            Instant::now() + left / (blocks.len() - k) as u32
        });
        let mut plot = Plot::new(tracer.device(), block, camera, plan, params, E::CHANNELS)?;
        launcher.commands.run(|r| r.clear(&plot.film))?;
        let pixels = block.size[0] as u64 * block.size[1] as u64;
        let began = Instant::now();
        let mut sample = 0;
        while sample < plan.spp {
            let keep = launcher.estimator.keeps_first() && sample == 0;
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
            let batch = Batch::next(sample, plan.spp, most);
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
            if sample < plan.spp && (late || control.should_stop()?) {
                break;
            }
        }
        finished += pixels * plan.spp as u64;
        out.spp = out.spp.min(sample);
        out.stopped_early |= sample < plan.spp;
        plot.take_film(block, sample, &mut out)?;
    }
    tracer.check_finished()?;
    out.trace_seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

/// What all launches use.
struct Launcher<'a, E> {
    tracer: &'a Tracer,
    estimator: &'a mut E,
    commands: Commands,
    pace: Pace,
}

impl<E: Estimator> Launcher<'_, E> {
    /// Takes a batch of samples, or of one sample when it has to stop and there is none yet; says which. `None`: it had to stop,
    /// and the film is as it was. `report` gets the share of the batch that is done.
    fn batch(
        &mut self,
        plot: &mut Plot,
        mut batch: Batch,
        keep: bool,
        out: &mut Accumulated,
        control: &mut dyn Control,
        report: &mut dyn FnMut(f64, &mut dyn Control),
    ) -> Result<Option<Batch>> {
        let pass = self.estimator.begin(plot.params, keep)?;
        plot.save(&mut self.commands, batch)?;
        let (mut first, mut given_up) = (0u64, false);
        while first < (plot.pixels as u64) << batch.bits {
            let all = (plot.pixels as u64) << batch.bits;
            // pixels are rendered whole
            let rays = self.pace.rays().min(MOST);
            let wanted = if keep { 1 } else { self.pace.launches() };
            let (begin, start) = (first, Instant::now());
            let mut launches = Vec::new();
            while (launches.len() as u32) < wanted && first < all {
                let count = (rays as u64).min(all - first) as u32;
                launches.push(Push {
                    scene: self.tracer.scene_address(),
                    pass,
                    first: first as u32,
                    count,
                    sample_index: batch.first,
                    sample_bits: batch.bits,
                    ..Default::default()
                });
                first += count as u64;
            }
            let timings = self.estimator.launch(&mut self.commands, &launches, keep)?;
            if first - begin >= rays as u64 * launches.len() as u64 {
                self.pace.learn(rays, &timings, start.elapsed().as_secs_f64(), launches.len() as u32);
            }
            out.add_timings(&timings);
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
    fn new(
        device: &Arc<Device>,
        block: &Block,
        camera: &CameraRecord,
        plan: &Plan,
        params: &BlockParams,
        channels: usize,
    ) -> Result<Self> {
        let tiles = plan.cover.and_then(|c| c.tiles(block));
        let pixels = tiles.as_ref().map_or(block.rays(), |t| t.len() as u32 * TILE_PIXELS);
        let film = Buffer::new(device, "film", record_bytes(channels) * pixels as u64, Memory::Device)?;
        let tile_buffer = match &tiles {
            Some(t) => Some(Buffer::from_slice(device, "tiles", t)?),
            None => None,
        };
        let params = BlockParams {
            film: film.address(),
            tiles: tile_buffer.as_ref().map_or(0, Buffer::address),
            ..params.at(block, plan.size, camera, plan.seed)
        };
        Ok(Self { params, channels, tiles, pixels, film, before: None, _tile_buffer: tile_buffer })
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
    fn take_film(&self, block: &Block, samples: u32, out: &mut Accumulated) -> Result<()> {
        let record = record_bytes(self.channels);
        let width = out.film.width;
        // pixels of tiles that show nothing are not on the device
        let nothing = FilmPixel::empty(self.channels);
        block.each_pixel(width, |at| out.film.set(at, &nothing, samples));
        let mut traced = 0u64;
        self.film.read_with(0, record * self.pixels as u64, record, |first, bytes| {
            for (k, pixel) in bytes.chunks_exact(record as usize).enumerate() {
                let mut index = (first + k as u64) as u32;
                if let Some(tiles) = &self.tiles {
                    index = tiles[(index / TILE_PIXELS) as usize] * TILE_PIXELS + index % TILE_PIXELS;
                }
                if let Some(at) = block.image_index(index, width) {
                    let pixel = FilmPixel::read(pixel);
                    traced += samples as u64;
                    out.covered += pixel.covered as u64;
                    out.film.set(at, &pixel, samples);
                }
            }
        })?;
        let all = block.size[0] as u64 * block.size[1] as u64 * samples as u64;
        out.primary_rays += traced;
        out.skipped_primary_rays += all - traced;
        Ok(())
    }
}

impl Accumulated {
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
