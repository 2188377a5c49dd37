//! Samples of every pixel, added up on a film: step by step ([`super::schedule`]), in each the image block by block, batch by batch and launch by
//! launch, with progress, a time limit and a way to stop that leaves whole samples of all pixels. What a sample is, an `Estimator` knows.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::block::{Block, BlockParams, TILE_PIXELS};
use super::camera::CameraRecord;
use super::convergence::{TileCount, TileErrors};
use super::pace::{MAX_RAYS, Pace};
use super::schedule::{FilmOptions, Step};
use super::state::{FilmState, tiles};
use super::tile_mask::TileMask;
use super::{Film, FilmPixel, MAX_CHANNELS, record_bytes, record_words};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Buffer, Commands, Device, Memory, Timing};
use crate::tracer::{Push, Tracer};

/// Samples of a pixel in a launch at most, as a power of two: neighbouring rays, which then start and end close together.
const MAX_SAMPLE_BITS: u32 = 4;

/// What estimates pixels.
pub(crate) trait Estimator {
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
pub(crate) struct Plan<'a> {
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub spp: u32,
    /// Of the sampler.
    pub seed: u32,
    /// Stop after this time with what there is.
    pub time_limit: Option<Duration>,
    /// Which tiles of the image show anything; without it all are traced.
    pub tile_mask: Option<&'a TileMask>,
    /// What the film starts from, and where it stops on its way.
    pub film: &'a FilmOptions,
}

/// An image and how it came about. Rays and times are those of this run.
#[derive(Clone, Debug, Default)]
pub struct Accumulated {
    /// The image.
    pub film: Film,
    /// Its sums, where something needs them ([`FilmOptions`]).
    pub state: Option<FilmState>,
    /// Samples that every pixel got.
    pub spp: u32,
    /// Samples that any pixel got at most.
    pub max_spp: u32,
    /// Stopped before all samples were taken.
    pub stopped_early: bool,
    /// Tiles that know enough, where there is a target.
    pub converged: Option<TileCount>,
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
pub(crate) fn max_rays(size: [u32; 2], spp: u32) -> u32 {
    let max_pixels = Block::cut(size).iter().map(Block::rays).max().unwrap_or(0) as u64;
    let bits = Batch::next(0, spp.max(1), u32::MAX).bits;
    (max_pixels << bits).min(MAX_RAYS as u64) as u32
}

/// Tiles of a block that have as many samples, and get more together.
struct TileGroup {
    block: Block,
    // place of the block among all
    number: usize,
    // samples that they have
    first: u32,
    // as the block counts them
    tiles: Vec<u32>,
    // of these, those that are traced; none: the block's tiles, all of them
    traced: Option<Vec<u32>>,
}

/// A group's pixels on the device, and their film.
struct PixelBatch {
    params: BlockParams,
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
        Self { first, bits: samples.ilog2().min(MAX_SAMPLE_BITS) }
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
pub(crate) fn accumulate<E: Estimator>(
    tracer: &Tracer,
    camera: &CameraRecord,
    plan: &Plan,
    params: &BlockParams,
    estimator: &mut E,
    control: &mut dyn Control,
) -> Result<Accumulated> {
    let (start, options) = (Instant::now(), plan.film);
    let [tiles_x, tiles_y] = tiles(plan.size);
    let mut out = Accumulated { film: Film::new(plan.size[0], plan.size[1], E::CHANNELS), ..Default::default() };
    let mut tile_samples = vec![0; tiles_x * tiles_y];
    if options.needs_state() {
        let state = match options.start.as_deref() {
            None => FilmState::new(plan.size, E::CHANNELS),
            Some(s) if s.size() == plan.size && s.channels() == E::CHANNELS => s.clone(),
            Some(s) => {
                return Err(Error::Usage(format!(
                    "a film of {}x{} pixels with {} channels does not go on as one of {}x{} with {}",
                    s.size()[0],
                    s.size()[1],
                    s.channels(),
                    plan.size[0],
                    plan.size[1],
                    E::CHANNELS
                )));
            }
        };
        tile_samples.copy_from_slice(state.tile_samples());
        out.film = state.film();
        out.state = Some(state);
    }
    let blocks = Block::cut(plan.size);
    let launcher = Launcher { tracer, estimator, commands: Commands::new(tracer.device())?, pace: Pace::default() };
    let rates = vec![Rate::default(); blocks.len()];
    let mut run = Run { launcher, camera, plan, params, start, blocks, rates, tile_samples, out };
    let mut next = options.next(plan.spp, &run.tile_samples, &run.out.film);
    while let Some(step) = next {
        let most = run.tile_samples.iter().copied().max().unwrap_or(0);
        let stopped = run.step(&step, control)?;
        if let Some(state) = &mut run.out.state {
            state.set_tile_samples(&run.tile_samples);
            run.out.film = state.film();
        }
        next = options.next(plan.spp, &run.tile_samples, &run.out.film);
        run.sum_up();
        if stopped {
            break;
        }
        if next.is_some() && step.goal > most && options.intervals.contains(&step.goal) {
            control.interval(&run.out)?;
        }
    }
    run.sum_up();
    let mut out = run.out;
    tracer.check_finished()?;
    out.stopped_early = next.is_some();
    if !options.keep_state {
        out.state = None;
    }
    out.trace_seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

/// An image on its way.
struct Run<'a, E> {
    launcher: Launcher<'a, E>,
    camera: &'a CameraRecord,
    plan: &'a Plan<'a>,
    params: &'a BlockParams,
    start: Instant,
    blocks: Vec<Block>,
    // of each block
    rates: Vec<Rate>,
    // samples that the pixels of each tile of the image have
    tile_samples: Vec<u32>,
    out: Accumulated,
}

/// How long samples take.
#[derive(Clone, Copy, Default)]
struct Rate {
    seconds: f64,
    samples: u64,
}

impl Rate {
    /// Samples of so many pixels each that fit into a time; at least one, and one while nothing is known.
    fn fit(&self, time: Duration, pixels: u32) -> u32 {
        let each = self.seconds / self.samples as f64 * f64::from(pixels.max(1));
        if self.samples == 0 { 1 } else { ((time.as_secs_f64() / each.max(1e-9)) as u32).max(1) }
    }
}

impl<E: Estimator> Run<'_, E> {
    /// Takes the samples of a step; says whether it had to stop before all of the plan's were taken.
    fn step(&mut self, step: &Step, control: &mut dyn Control) -> Result<bool> {
        let groups: Vec<TileGroup> =
            self.blocks.iter().enumerate().flat_map(|(number, block)| self.groups(step, number, block)).collect();
        let work = |g: &TileGroup| f64::from(step.goal - g.first) * g.tiles.len() as f64;
        let (mut to_do, mut late, mut asked) = (groups.iter().map(work).sum::<f64>(), false, false);
        let pixels_of = |tiles: usize| tiles as u64 * u64::from(TILE_PIXELS);
        let total = pixels_of(self.tile_samples.len()) * u64::from(self.plan.spp);
        let mut done = total - (u64::from(TILE_PIXELS) * step.left).min(total);
        for group in groups {
            // every pixel has something already: nothing more is begun
            if asked && group.first > 0 {
                continue;
            }
            // what is left of the time is shared by what there is to do
            let share = work(&group) / to_do.max(1.0);
            to_do -= work(&group);
            let deadline = self.plan.time_limit.map(|limit| {
                let left = limit.saturating_sub(self.start.elapsed());
                Instant::now() + left.mul_f64(share.min(1.0))
            });
            let mut pixel_batch = self.pixel_batch(&group)?;
            let (pixels, mut sample) = (pixels_of(group.tiles.len()), group.first);
            while sample < step.goal {
                let keep = self.launcher.estimator.keeps_first() && sample == 0;
                // so many more as there is time for, judged by those that were taken
                let most = match deadline {
                    _ if keep => 1,
                    None => u32::MAX,
                    Some(d) => self.rates[group.number].fit(d.saturating_duration_since(Instant::now()), pixel_batch.pixels),
                };
                let batch = Batch::next(sample, step.goal, most);
                let before = done + pixels * u64::from(sample - group.first);
                let mut report = |share: f64, control: &mut dyn Control| {
                    let part = (share * (pixels * u64::from(batch.samples())) as f64) as u64;
                    control.progress(before + part, total);
                };
                let began = Instant::now();
                let taken = self.launcher.batch(&mut pixel_batch, batch, keep, &mut self.out, control, &mut report)?;
                let Some(batch) = taken else {
                    asked = true;
                    break;
                };
                sample += batch.samples();
                let rate = &mut self.rates[group.number];
                rate.seconds += began.elapsed().as_secs_f64();
                rate.samples += u64::from(pixel_batch.pixels) * u64::from(batch.samples());
                control.progress(done + pixels * u64::from(sample - group.first), total);
                if sample >= self.plan.spp {
                    break;
                }
                let too_late = deadline.is_some_and(|d| Instant::now() >= d);
                late |= too_late;
                asked |= !too_late && control.should_stop()?;
                if too_late || asked {
                    break;
                }
            }
            done += pixels * u64::from(step.goal - group.first);
            self.take(&group, &pixel_batch, sample)?;
        }
        Ok(late || asked)
    }

    /// The tiles of a block that a step is about, those with as many samples together.
    fn groups(&self, step: &Step, number: usize, block: &Block) -> Vec<TileGroup> {
        let width = self.plan.size[0];
        let mut of_samples: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for tile in 0..block.tiles() {
            let at = block.image_tile(tile, width);
            if step.tiles[at] {
                of_samples.entry(self.tile_samples[at]).or_default().push(tile);
            }
        }
        let live = self.plan.tile_mask.and_then(|c| c.tiles(block));
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

    /// Puts a group on the device, with what its pixels have.
    fn pixel_batch(&mut self, group: &TileGroup) -> Result<PixelBatch> {
        let device = self.launcher.tracer.device();
        let mut pixel_batch = PixelBatch::new(device, group, self.camera, self.plan, self.params, E::CHANNELS)?;
        let record = record_bytes(E::CHANNELS);
        match &self.out.state {
            Some(state) if group.first > 0 => {
                let (tiles, width) = (pixel_batch.tiles.as_deref(), self.plan.size[0]);
                pixel_batch.film.fill(record * pixel_batch.pixels as u64, record, |first, bytes| {
                    for (k, bytes) in bytes.chunks_exact_mut(record as usize).enumerate() {
                        match group.place(tiles, first as u32 + k as u32, width) {
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

    /// Takes a group's pixels, which have `samples` samples each now, from the device.
    fn take(&mut self, group: &TileGroup, pixel_batch: &PixelBatch, samples: u32) -> Result<()> {
        let (width, out) = (self.plan.size[0], &mut self.out);
        let taken = u64::from(samples - group.first);
        let mut inside = 0u64;
        for &tile in &group.tiles {
            self.tile_samples[group.block.image_tile(tile, width)] = samples;
            for at in (0..TILE_PIXELS).filter_map(|k| group.block.image_index(tile * TILE_PIXELS + k, width)) {
                inside += 1;
                // pixels of tiles that show nothing are not on the device
                if out.state.is_none() {
                    out.film.set(at, &FilmPixel::default(), samples);
                }
            }
        }
        let (record, mut traced) = (record_bytes(E::CHANNELS), 0u64);
        pixel_batch.film.read_with(0, record * pixel_batch.pixels as u64, record, |first, bytes| {
            for (k, bytes) in bytes.chunks_exact(record as usize).enumerate() {
                let Some(at) = group.place(pixel_batch.tiles.as_deref(), first as u32 + k as u32, width) else { continue };
                let mut words = [0u32; record_words(MAX_CHANNELS)];
                let words = &mut words[..record_words(E::CHANNELS)];
                bytemuck::cast_slice_mut::<u32, u8>(words).copy_from_slice(bytes);
                let pixel = FilmPixel::of(words);
                traced += 1;
                out.covered += u64::from(pixel.covered);
                match &mut out.state {
                    Some(state) => {
                        let old = state.record_mut(at);
                        out.covered -= u64::from(FilmPixel::of(old).covered);
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

    /// What there is to say of the image so far.
    fn sum_up(&mut self) {
        self.out.spp = self.tile_samples.iter().copied().min().unwrap_or(0);
        self.out.max_spp = self.tile_samples.iter().copied().max().unwrap_or(0);
        self.out.converged = self.plan.film.target_rmse.map(|target| TileErrors::of(&self.out.film).count(target));
    }
}

impl TileGroup {
    /// Place in an image of the given width of the pixel with this number among those on the device; `None` for padding.
    fn place(&self, tiles: Option<&[u32]>, index: u32, width: u32) -> Option<usize> {
        let index = match tiles {
            Some(tiles) => tiles[(index / TILE_PIXELS) as usize] * TILE_PIXELS + index % TILE_PIXELS,
            None => index,
        };
        self.block.image_index(index, width)
    }
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
        pixel_batch: &mut PixelBatch,
        mut batch: Batch,
        keep: bool,
        out: &mut Accumulated,
        control: &mut dyn Control,
        report: &mut dyn FnMut(f64, &mut dyn Control),
    ) -> Result<Option<Batch>> {
        let pass = self.estimator.begin(pixel_batch.params, keep)?;
        pixel_batch.save(&mut self.commands, batch)?;
        let (mut first, mut given_up) = (0u64, false);
        while first < (pixel_batch.pixels as u64) << batch.bits {
            let all = (pixel_batch.pixels as u64) << batch.bits;
            // pixels are rendered whole
            let rays = self.pace.rays().min(MAX_RAYS);
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
                pixel_batch.restore(&mut self.commands, batch)?;
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

impl PixelBatch {
    /// Room for a group's pixels, its film not yet filled.
    fn new(
        device: &Arc<Device>,
        group: &TileGroup,
        camera: &CameraRecord,
        plan: &Plan,
        params: &BlockParams,
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
            film: film.address(),
            tiles: tile_buffer.as_ref().map_or(0, Buffer::address),
            ..params.at(&group.block, plan.size, camera, plan.seed)
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
