//! Accumulates samples of every pixel on a film: step by step ([`super::schedule`]), block by
//! block, batch by batch and launch by launch. A stop leaves every pixel with complete samples.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::block::{Block, BlockParams, TILE_PIXELS};
use super::camera::CameraRecord;
use super::convergence::{TileCount, TileErrors};
use super::display::DisplayErrors;
use super::pace::Pace;
use super::samples::SampleSettings;
use super::schedule::Step;
use super::state::{FilmState, tiles};
use super::{Film, FilmPixel, MAX_CHANNELS, record_bytes, record_words};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Buffer, Commands, Device, Memory, Timing};
use crate::tracer::stream::launch_rays;
use crate::tracer::{Push, Tracer};

/// Log2 of the maximum number of samples per pixel in a launch, which are coherent, by default.
pub(crate) const MAX_SAMPLE_BITS: u32 = 4;

/// Evaluates samples of pixels on the device: the device side of an integrator.
pub(crate) trait Estimator {
    /// Channels of its film.
    const CHANNELS: usize;
    /// Log2 of the maximum number of samples per pixel in a launch.
    const SAMPLE_BITS: u32 = MAX_SAMPLE_BITS;

    /// Must the rays of the first sample of each pixel be kept? Then it is a batch of its own.
    fn keeps_first(&self) -> bool {
        false
    }

    /// Number of regions whose work the longest region of a launch does ([`Pace::with_steps`]).
    fn steps(&self) -> u32 {
        1
    }

    /// Prepares the launches of a batch of a block, which add to the pixels at the device address
    /// `film`, and returns the address of the pass's parameters. `keep`: the batch is the first
    /// sample and [`Estimator::keeps_first`] is true.
    fn begin(&mut self, block: &BlockParams, film: u64, keep: bool) -> Result<u64>;

    /// Runs launches in order, which add to the film; with `keep` it is one.
    fn launch(&mut self, commands: &mut Commands, launches: &[Push], keep: bool) -> Result<Vec<Timing>>;
}

/// An accumulated image and its statistics. Ray counts and times are those of this run.
#[derive(Clone, Debug, Default)]
pub struct Accumulated {
    /// The image.
    pub film: Film,
    /// Exact sums, if [`super::schedule::FilmOptions::keep_state`] is set.
    pub state: Option<FilmState>,
    /// Minimum samples per pixel.
    pub spp: u32,
    /// Maximum samples per pixel.
    pub max_spp: u32,
    /// Rendering stopped before all samples were taken.
    pub stopped_early: bool,
    /// Converged tiles, if the film has a target ([`super::schedule::FilmOptions::target_rmse`],
    /// [`super::schedule::FilmOptions::display_target`]).
    pub converged: Option<TileCount>,
    /// Errors of displayed tiles, infinite before their second check, if
    /// [`super::schedule::FilmOptions::display_target`] is set.
    pub displayed: Option<TileErrors>,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Camera rays not traced because their tile contains no geometry.
    pub skipped_primary_rays: u64,
    /// Camera rays that hit geometry.
    pub covered: u64,
    /// Device seconds by label: `"PASS STEP"`, or `"PASS"` for a pass of a single shader.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Duration of the longest launch, device seconds.
    pub longest_launch: f64,
    /// Wall-clock seconds of the trace loop, including shader compilation.
    pub trace_seconds: f64,
}

/// Maximum number of rays in a launch: the capacity of an estimator. `most` is the device's.
pub(crate) fn max_rays(most: u32, size: [u32; 2], spp: u32, sample_bits: u32) -> u32 {
    let max_pixels = Block::cut(size).iter().map(Block::rays).max().unwrap_or(0) as u64;
    let bits = spp.max(1).ilog2().min(sample_bits);
    (max_pixels << bits).min(most.into()) as u32
}

/// Tiles of a block with the same number of samples, which are sampled together.
struct TileGroup {
    block: Block,
    // index of the block in the image
    number: usize,
    // samples that each pixel has
    first: u32,
    // tile indices within the block
    tiles: Vec<u32>,
    // the subset that is traced; `None`: all tiles of the block
    traced: Option<Vec<u32>>,
}

/// Pixels of a tile group on the device, and their film.
struct PixelBatch {
    params: BlockParams,
    tiles: Option<Vec<u32>>,
    pixels: u32,
    film: Buffer,
    // backup of the film, restored if a batch is abandoned
    before: Option<Buffer>,
    _tile_buffer: Option<Buffer>,
}

/// A power of two of samples per pixel that are taken together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Batch {
    first: u32,
    bits: u32,
}

impl Batch {
    /// The largest batch that fits a launch of `sample_bits`, the samples left of `wanted`, and
    /// `most` (at least one). Above 2^[`MAX_SAMPLE_BITS`] it is no larger than all before it
    /// together, so that a stop loses at most half of a render with the batch in progress.
    fn next(first: u32, wanted: u32, most: u32, sample_bits: u32) -> Self {
        let samples = (wanted - first).min(most.max(1));
        let before = first.checked_ilog2().unwrap_or(0).max(MAX_SAMPLE_BITS);
        Self { first, bits: samples.ilog2().min(sample_bits).min(before) }
    }

    fn samples(&self) -> u32 {
        1 << self.bits
    }
}

/// Accumulates the samples of an image.
///
/// When `control` requests a stop, only complete samples are kept, so that all pixels of a tile
/// have the same count. The batch in progress is abandoned for that, unless the pixels have no
/// sample yet.
///
/// # Errors
/// Those of the device and of `control`, usually [`crate::Error::Interrupted`].
pub(crate) fn accumulate<E: Estimator>(
    tracer: &Tracer,
    camera: &CameraRecord,
    samples: &SampleSettings,
    estimator: &mut E,
    control: &mut dyn Control,
) -> Result<Accumulated> {
    let (start, options) = (Instant::now(), &samples.film);
    let [tiles_x, tiles_y] = tiles(samples.size);

    // Begin with an empty film, or with the one to resume.
    let mut out = Accumulated { film: Film::new(samples.size[0], samples.size[1], E::CHANNELS), ..Default::default() };
    let mut tile_samples = vec![0; tiles_x * tiles_y];
    if options.needs_state() {
        let state = match options.start.as_deref() {
            None => FilmState::new(samples.size, E::CHANNELS),
            Some(s) if s.size() == samples.size && s.channels() == E::CHANNELS => s.clone(),
            Some(s) => {
                return Err(Error::Usage(format!(
                    "a film of {}x{} pixels with {} channels cannot be resumed as one of {}x{} with {}; \
                     render with the same size and integrator",
                    s.size()[0],
                    s.size()[1],
                    s.channels(),
                    samples.size[0],
                    samples.size[1],
                    E::CHANNELS
                )));
            }
        };
        tile_samples.copy_from_slice(state.tile_samples());
        out.film = state.film();
        out.state = Some(state);
    }

    // Take step after step, until the film is finished or a stop is requested.
    let blocks = Block::cut(samples.size);
    let steps = estimator.steps();
    let launcher = Launcher {
        tracer,
        estimator,
        commands: Commands::new(tracer.device())?,
        pace: Pace::up_to(launch_rays(&tracer.device().info)).with_steps(steps),
    };
    let rates = vec![Rate::default(); blocks.len()];
    let displayed = options.display_target.map(|target| DisplayErrors::new(target, &out.film));
    let mut run = Run { launcher, camera, samples, start, blocks, rates, tile_samples, displayed, out };
    let mut next = options.next(samples.spp, &run.tile_samples, &|| run.open_tiles());
    while let Some(step) = next {
        let most = run.tile_samples.iter().copied().max().unwrap_or(0);
        let stopped = run.step(&step, control)?;
        if let Some(state) = &mut run.out.state {
            state.set_tile_samples(&run.tile_samples);
            run.out.film = state.film();
        }
        if let Some(displayed) = &mut run.displayed {
            displayed.update(&run.out.film, &run.tile_samples, |n| options.is_check(n));
        }
        next = options.next(samples.spp, &run.tile_samples, &|| run.open_tiles());
        run.sum_up();
        if stopped {
            break;
        }
        if next.is_some() && step.goal > most && options.intervals.contains(&step.goal) {
            control.interval(&run.out)?;
        }
    }
    run.sum_up();

    // Complete the statistics.
    let mut out = run.out;
    tracer.check_finished()?;
    out.stopped_early = next.is_some();
    if !options.keep_state {
        out.state = None;
    }
    out.trace_seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

/// State of an accumulation in progress.
struct Run<'a, E> {
    launcher: Launcher<'a, E>,
    camera: &'a CameraRecord,
    samples: &'a SampleSettings,
    start: Instant,
    blocks: Vec<Block>,
    // sampling rate of each block
    rates: Vec<Rate>,
    // samples per pixel of each tile of the image
    tile_samples: Vec<u32>,
    // errors of displayed tiles, if they decide
    displayed: Option<DisplayErrors>,
    out: Accumulated,
}

/// Measured time per pixel sample.
#[derive(Clone, Copy, Default)]
struct Rate {
    seconds: f64,
    samples: u64,
}

impl Rate {
    /// Number of samples of `pixels` pixels that fit into `time`: one before the first measurement.
    fn fit(&self, time: Duration, pixels: u32) -> u32 {
        let each = self.seconds / self.samples as f64 * f64::from(pixels.max(1));
        if self.samples == 0 { 1 } else { ((time.as_secs_f64() / each.max(1e-9)) as u32).max(1) }
    }
}

impl<E: Estimator> Run<'_, E> {
    /// Takes the samples of a step. Returns true if a time limit or a request stopped it early.
    fn step(&mut self, step: &Step, control: &mut dyn Control) -> Result<bool> {
        let groups: Vec<TileGroup> =
            self.blocks.iter().enumerate().flat_map(|(number, block)| self.groups(step, number, block)).collect();
        let work = |g: &TileGroup| f64::from(step.goal - g.first) * g.tiles.len() as f64;
        let (mut to_do, mut late, mut stop_requested) = (groups.iter().map(work).sum::<f64>(), false, false);
        let pixels_of = |tiles: usize| tiles as u64 * u64::from(TILE_PIXELS);
        let total = pixels_of(self.tile_samples.len()) * u64::from(self.samples.spp);
        let mut done = total - (u64::from(TILE_PIXELS) * step.left).min(total);

        for group in groups {
            // a stop was requested and these pixels have samples: start nothing more
            if stop_requested && group.first > 0 {
                continue;
            }
            // the remaining time is divided in proportion to the remaining work
            let share = work(&group) / to_do.max(1.0);
            to_do -= work(&group);
            let deadline = self.samples.time_limit.map(|limit| {
                let left = limit.saturating_sub(self.start.elapsed());
                Instant::now() + left.mul_f64(share.min(1.0))
            });

            // Batches of as many samples as fit the time, by the measured rate.
            let mut pixel_batch = self.pixel_batch(&group)?;
            let (pixels, mut sample) = (pixels_of(group.tiles.len()), group.first);
            while sample < step.goal {
                let keep = self.launcher.estimator.keeps_first() && sample == 0;
                let time = deadline.map(|d| d.saturating_duration_since(Instant::now()));
                let most = match time {
                    _ if keep => 1,
                    None => u32::MAX,
                    Some(time) => self.rates[group.number].fit(time, pixel_batch.pixels),
                };
                let batch = Batch::next(sample, step.goal, most, E::SAMPLE_BITS);
                let before = done + pixels * u64::from(sample - group.first);
                let mut report = |share: f64, control: &mut dyn Control| {
                    let part = (share * (pixels * u64::from(batch.samples())) as f64) as u64;
                    control.progress(before + part, total);
                };
                let began = Instant::now();
                let taken = self.launcher.batch(&mut pixel_batch, batch, keep, &mut self.out, control, &mut report)?;
                let Some(batch) = taken else {
                    stop_requested = true;
                    break;
                };

                // Learn the rate, and look whether to stop.
                sample += batch.samples();
                let rate = &mut self.rates[group.number];
                rate.seconds += began.elapsed().as_secs_f64();
                rate.samples += u64::from(pixel_batch.pixels) * u64::from(batch.samples());
                control.progress(done + pixels * u64::from(sample - group.first), total);
                if sample >= self.samples.spp {
                    break;
                }
                let too_late = deadline.is_some_and(|d| Instant::now() >= d);
                late |= too_late;
                stop_requested |= !too_late && control.should_stop()?;
                if too_late || stop_requested {
                    break;
                }
            }

            done += pixels * u64::from(step.goal - group.first);
            self.take(&group, &pixel_batch, sample)?;
        }
        Ok(late || stop_requested)
    }

    /// The tiles of a block that a step samples, grouped by their number of samples.
    fn groups(&self, step: &Step, number: usize, block: &Block) -> Vec<TileGroup> {
        let width = self.samples.size[0];
        let mut of_samples: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for tile in 0..block.tiles() {
            let at = block.image_tile(tile, width);
            if step.tiles[at] {
                of_samples.entry(self.tile_samples[at]).or_default().push(tile);
            }
        }
        let live = self.samples.tile_mask.as_ref().and_then(|c| c.tiles(block));
        let group = |(first, tiles): (u32, Vec<u32>)| {
            let traced = match &live {
                None if tiles.len() as u32 == block.tiles() => None,
                None => Some(tiles.clone()),
                // both ascend
                Some(live) => Some(tiles.iter().copied().filter(|t| live.binary_search(t).is_ok()).collect()),
            };
            TileGroup { block: *block, number, first, tiles, traced }
        };
        of_samples.into_iter().map(group).collect()
    }

    /// Uploads a tile group with the current sums of its pixels.
    fn pixel_batch(&mut self, group: &TileGroup) -> Result<PixelBatch> {
        let device = self.launcher.tracer.device();
        let mut pixel_batch = PixelBatch::new(device, group, self.camera, self.samples, E::CHANNELS)?;
        let record = record_bytes(E::CHANNELS);
        match &self.out.state {
            Some(state) if group.first > 0 => {
                let (tiles, width) = (pixel_batch.tiles.as_deref(), self.samples.size[0]);
                pixel_batch.film.fill(record * pixel_batch.pixels as u64, record, |first, bytes| {
                    for (k, bytes) in bytes.chunks_exact_mut(record as usize).enumerate() {
                        match group.image_index(tiles, first as u32 + k as u32, width) {
                            Some(at) => bytes.copy_from_slice(bytemuck::cast_slice(state.record(at))),
                            None => bytes.fill(0),
                        }
                    }
                })?;
            }
            _ => self.launcher.commands.run(|r| r.clear(&pixel_batch.film)).map(drop)?,
        }
        Ok(pixel_batch)
    }

    /// Reads back a group's pixels, which have `samples` samples each now.
    fn take(&mut self, group: &TileGroup, pixel_batch: &PixelBatch, samples: u32) -> Result<()> {
        let (width, out) = (self.samples.size[0], &mut self.out);
        let taken = u64::from(samples - group.first);
        let mut inside = 0u64;
        for &tile in &group.tiles {
            self.tile_samples[group.block.image_tile(tile, width)] = samples;
            for at in (0..TILE_PIXELS).filter_map(|k| group.block.image_index(tile * TILE_PIXELS + k, width)) {
                inside += 1;
                // pixels of skipped tiles are not on the device
                if out.state.is_none() {
                    out.film.set(at, &FilmPixel::default(), samples);
                }
            }
        }
        let (record, mut traced) = (record_bytes(E::CHANNELS), 0u64);
        pixel_batch.film.read_with(0, record * pixel_batch.pixels as u64, record, |first, bytes| {
            for (k, bytes) in bytes.chunks_exact(record as usize).enumerate() {
                let Some(at) = group.image_index(pixel_batch.tiles.as_deref(), first as u32 + k as u32, width) else {
                    continue;
                };
                let mut words = [0u32; record_words(MAX_CHANNELS)];
                let words = &mut words[..record_words(E::CHANNELS)];
                bytemuck::cast_slice_mut::<u32, u8>(words).copy_from_slice(bytes);
                let pixel = FilmPixel::from_words(words);
                traced += 1;
                out.covered += u64::from(pixel.covered);
                match &mut out.state {
                    Some(state) => {
                        let old = state.record_mut(at);
                        out.covered -= u64::from(FilmPixel::from_words(old).covered);
                        old.copy_from_slice(words);
                    }
                    None => out.film.set(at, &pixel, samples),
                }
            }
        })?;
        out.primary_rays += traced * taken;
        out.skipped_primary_rays += (inside - traced) * taken;
        Ok(())
    }

    /// For each tile, true if it has not converged to the target of the film.
    fn open_tiles(&self) -> Vec<bool> {
        match (&self.displayed, self.samples.film.target_rmse) {
            (Some(displayed), _) => displayed.open(),
            (None, Some(target)) => TileErrors::from_film(&self.out.film).unconverged(target),
            (None, None) => vec![true; self.tile_samples.len()],
        }
    }

    /// Updates the statistics of the image.
    fn sum_up(&mut self) {
        self.out.spp = self.tile_samples.iter().copied().min().unwrap_or(0);
        self.out.max_spp = self.tile_samples.iter().copied().max().unwrap_or(0);
        self.out.converged = self.samples.film.is_adaptive().then(|| TileCount::from_open(&self.open_tiles()));
        self.out.displayed = self.displayed.as_ref().map(|d| d.tiles().clone());
    }
}

impl TileGroup {
    /// Index in an image `width` pixels wide of a pixel of the device; `None` for padding.
    fn image_index(&self, tiles: Option<&[u32]>, index: u32, width: u32) -> Option<usize> {
        let index = match tiles {
            Some(tiles) => tiles[(index / TILE_PIXELS) as usize] * TILE_PIXELS + index % TILE_PIXELS,
            None => index,
        };
        self.block.image_index(index, width)
    }
}

/// State shared by all launches.
struct Launcher<'a, E> {
    tracer: &'a Tracer,
    estimator: &'a mut E,
    commands: Commands,
    pace: Pace,
}

impl<E: Estimator> Launcher<'_, E> {
    /// Takes a batch of samples and returns it. On a stop request it restores the film and returns
    /// `None`, or, if the pixels have no sample yet, takes a batch of one sample instead. `report`
    /// gets the completed share of the batch, in [0, 1].
    fn batch(
        &mut self,
        pixel_batch: &mut PixelBatch,
        mut batch: Batch,
        keep: bool,
        out: &mut Accumulated,
        control: &mut dyn Control,
        report: &mut dyn FnMut(f64, &mut dyn Control),
    ) -> Result<Option<Batch>> {
        let pass = self.estimator.begin(&pixel_batch.params, pixel_batch.film.address(), keep)?;
        pixel_batch.save(&mut self.commands, batch)?;
        let (mut first, mut restarted) = (0u64, false);
        while first < (pixel_batch.pixels as u64) << batch.bits {
            // A submission of several launches, each with all samples of its pixels.
            let all = (pixel_batch.pixels as u64) << batch.bits;
            let rays = self.pace.rays();
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

            // Run it, and adapt the size of the next launches to its time.
            let timings = self.estimator.launch(&mut self.commands, &launches, keep)?;
            if first - begin >= rays as u64 * launches.len() as u64 {
                self.pace.learn(rays, &timings, start.elapsed().as_secs_f64(), launches.len() as u32);
            }
            out.add_timings(&timings);
            if !restarted {
                report(first as f64 / all as f64, control);
            }

            // Abandon the batch on request; pixels without samples take one that cannot be stopped.
            if first < all && control.should_stop()? && (batch.first > 0 || batch.bits > 0) {
                pixel_batch.restore(&mut self.commands, batch)?;
                if batch.first > 0 {
                    return Ok(None);
                }
                batch.bits = 0;
                first = 0;
                restarted = true;
            }
        }
        Ok(Some(batch))
    }
}

impl PixelBatch {
    /// Allocates a group's pixels; the film is not yet initialized.
    fn new(
        device: &Arc<Device>,
        group: &TileGroup,
        camera: &CameraRecord,
        samples: &SampleSettings,
        channels: usize,
    ) -> Result<Self> {
        let tiles = group.traced.clone();
        let pixels = tiles.as_ref().map_or(group.block.rays(), |t| t.len() as u32 * TILE_PIXELS);
        let film = Buffer::new(device, "film", record_bytes(channels) * pixels as u64, Memory::Device)?;
        let tile_buffer = match &tiles {
            Some(t) => Some(Buffer::from_slice(device, "tiles", t)?),
            None => None,
        };
        let params = BlockParams {
            tiles: tile_buffer.as_ref().map_or(0, Buffer::address),
            pixel_filter: samples.pixel_filter as u32,
            ..group.block.params(samples.size, camera, samples.seed)
        };
        Ok(Self { params, tiles, pixels, film, before: None, _tile_buffer: tile_buffer })
    }

    /// Backs the film up, so that a batch can be abandoned; the first batch needs no backup.
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
    use crate::tracer::stream::LAUNCH_RAYS;

    #[test]
    fn batches_take_every_sample_once() {
        for (spp, most, bits, want) in [
            (1, u32::MAX, 4, vec![1]),
            (16, u32::MAX, 4, vec![16]),
            (23, u32::MAX, 4, vec![16, 4, 2, 1]),
            (40, u32::MAX, 4, vec![16, 16, 8]),
            (5, 0, 4, vec![1; 5]),
            (9, 3, 4, vec![2, 2, 2, 2, 1]),
            (64, u32::MAX, 4, vec![16; 4]),
            (64, u32::MAX, 6, vec![16, 16, 32]),
            (300, u32::MAX, 6, vec![16, 16, 32, 64, 64, 64, 32, 8, 4]),
        ] {
            let (mut got, mut first) = (Vec::new(), 0);
            while first < spp {
                let b = Batch::next(first, spp, most, bits);
                assert_eq!(b.first, first);
                assert!(b.samples() <= max_rays(LAUNCH_RAYS, [1, 1], spp, bits), "{spp}");
                got.push(b.samples());
                first += b.samples();
            }
            assert_eq!((first, got), (spp, want));
        }
    }
}
