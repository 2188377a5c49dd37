//! Ambient occlusion frame after frame: the passes `gbuffer`, `spawn`, `accessibility`, `gather`, `temporal` and `filter`.
//!
//! `gbuffer` finds what each pixel's centre shows; `spawn` makes occlusion rays of the pixels that are sampled in this frame and
//! `accessibility` traces them; `gather` adds up those of a pixel where there are several; `temporal` adds them to what earlier
//! frames know of the same surface; `filter` averages over neighbours. What nothing has changed since the previous frame is not
//! done again: while neither the camera nor the scene moves there are no camera rays, and pixels with a full history rest.

mod larsen;
mod params;
pub mod settings;

use glam::{DAffine3, DMat3, DVec3};

use super::ao::Hemisphere;
use super::block::{Block, BlockParams, TILE_PIXELS};
use super::camera::CameraRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, ComputePipeline, Memory, Recorder, Specialization, Timing};
use crate::tracer::gpu_scene::rows;
use crate::tracer::queue::RayQueue;
use crate::tracer::stream::{LANES, LAUNCH_RAYS, StreamShaders};
use crate::tracer::{Moved, Push, Stream, Tracer, stream};
use larsen::Larsen;
use params::{FrameParams, MOST_MOVED, MovedRecord};
pub use settings::{Filter, FilterKind, Preset, Resolution, Settings, Technique};

/// Rays that a launch holds at most; an image of more is made in several.
const MOST_QUEUED: u32 = 1 << 22;
/// Distance from a pixel's plane, in footprints of the pixel, at which its neighbours belong to another surface.
const DEPTH_TOLERANCE: f32 = 1.5;
/// Cosine between normals, likewise.
const NORMAL_TOLERANCE: f32 = 0.9;

/// Bytes of a pixel's surface (`surface` in shaders/common/frame.glsl).
const SURFACE_BYTES: u64 = 32;
/// Bytes of where it was.
const POSITION_BYTES: u64 = 12;

/// What making a frame took.
#[derive(Clone, Debug, Default)]
pub struct FrameStats {
    /// Device seconds of each step of each pass, in order.
    pub timings: Vec<Timing>,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays that this many pixels would have taken, and that were left out: nothing is there, or all is known.
    pub skipped_rays: u64,
}

/// A pixel's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Its point, relative to the scene's origin.
    pub position: [f32; 3],
    /// Where that point was before the scene's last update.
    pub before: [f32; 3],
}

/// The frames of one image size.
pub struct Realtime {
    size: [u32; 2],
    settings: Settings,
    passes: Passes,
    images: Images,
    larsen: Option<Box<Larsen>>,
    commands: Commands,
    /// Pixels of a launch of the occlusion passes.
    chunk: u32,
    state: State,
}

struct Passes {
    gbuffer: Stream,
    accessibility: Stream,
    spawn: ComputePipeline,
    gather: ComputePipeline,
    gtao: ComputePipeline,
    temporal: ComputePipeline,
    filter: ComputePipeline,
}

/// Device memory: parameters, and a record a pixel.
struct Images {
    block_params: Buffer,
    frame_params: Buffer,
    moved: Buffer,
    surface: Buffer,
    axes: Option<Buffer>,
    guides: [Buffer; 2],
    histories: [Buffer; 2],
    current: Buffer,
    samples: Option<Buffer>,
    previous_position: Option<Buffer>,
    result: Buffer,
    queue: RayQueue,
    /// Rays of each launch of a frame.
    counts: Buffer,
}

/// What is known from the frames before.
#[derive(Default)]
struct State {
    frame: u32,
    camera: Option<CameraRecord>,
    /// Which of the two guides and histories are this frame's.
    guide: usize,
    history: usize,
    has_history: bool,
}

impl Realtime {
    /// The streams that it traces.
    pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
        [&stream::GBUFFER_CLOSEST, if settings.binary() { &stream::ACCESSIBILITY_ANY } else { &stream::ACCESSIBILITY_CLOSEST }]
    }

    /// For images of `size` pixels of the tracer's scene. `lights` are the positions of its point lights, relative to its origin: the
    /// reference work's pipeline asks for them.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Self> {
        settings.check()?;
        let device = tracer.device();
        // whole tiles, so that a pixel's samples are in one launch
        let tiles = Block { origin: [0, 0], size }.rays();
        let chunk = (MOST_QUEUED / settings.rays_per_pixel / TILE_PIXELS * TILE_PIXELS).clamp(TILE_PIXELS, tiles);
        Ok(Self {
            size,
            settings: *settings,
            passes: Passes::new(tracer, settings)?,
            images: Images::new(tracer, size, settings, chunk)?,
            larsen: match settings.technique {
                Technique::Larsen => Some(Box::new(Larsen::new(tracer, size, lights, settings.unit)?)),
                _ => None,
            },
            commands: Commands::new(device)?,
            chunk,
            state: State::default(),
        })
    }

    /// Pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// How frames are made.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Forgets what earlier frames know.
    pub fn reset(&mut self) {
        self.state.has_history = false;
        self.state.camera = None;
    }

    /// As [`Realtime::reset`], and draws the same samples again, from the first frame on.
    pub fn rewind(&mut self) {
        self.reset();
        self.state.frame = 0;
    }

    /// Makes the next frame. `moved` is what has moved in the scene since the one before ([`crate::tracer::UpdateStats::moved`]).
    ///
    /// # Errors
    /// Those of the device.
    pub fn frame(&mut self, tracer: &Tracer, camera: &CameraRecord, moved: &[Moved]) -> Result<FrameStats> {
        let moved = MovedRecord::of(moved);
        // the reference work's pipeline makes everything anew
        let still = moved.is_empty() && self.state.camera == Some(*camera) && self.larsen.is_none();
        if !still {
            self.state.guide ^= 1;
        }
        self.state.history ^= 1;
        self.write_params(camera, &moved, still)?;
        let pixels = self.pixels();
        let tiles = self.block().rays();
        let push = Push { scene: tracer.scene_address(), pass: self.images.frame_params.address(), ..Default::default() };
        let gtao = self.settings.technique == Technique::Gtao;
        let launches = if gtao { 0 } else { tiles.div_ceil(self.chunk) };
        let (passes, images, larsen) = (&self.passes, &self.images, self.larsen.as_deref());
        let (guide, rays_per_pixel, chunk) = (&images.guides[self.state.guide], self.settings.rays_per_pixel, self.chunk);
        let timings = self.commands.run(|r| {
            if !still {
                r.fill(guide, guide.size(), f32::INFINITY.to_bits());
                r.barrier();
                let push = Push { pass: images.block_params.address(), ..push };
                for first in (0..tiles).step_by(LAUNCH_RAYS as usize) {
                    passes.gbuffer.record(r, &Push { first, count: LAUNCH_RAYS.min(tiles - first), ..push });
                    r.barrier();
                }
            }
            if let Some(larsen) = larsen {
                larsen.record(r, push, &images.result);
                return;
            }
            r.clear(&images.current);
            if gtao {
                let all = Push { count: pixels as u32, ..push };
                r.barrier();
                r.timed("gtao", |r| r.dispatch(&passes.gtao, &all, all.count.div_ceil(LANES)));
                r.barrier();
            }
            for launch in 0..launches {
                let first = launch * chunk;
                let push = Push { first, count: chunk.min(tiles - first), ..push };
                passes.record_occlusion(r, images, push, rays_per_pixel);
                r.copy(images.queue.count(), 0, &images.counts, 4 * u64::from(launch), 4);
                r.barrier();
            }
            let all = Push { count: pixels as u32, ..push };
            let groups = all.count.div_ceil(LANES);
            r.timed("temporal", |r| r.dispatch(&passes.temporal, &all, groups));
            r.barrier();
            r.timed("filter", |r| r.dispatch(&passes.filter, &all, groups));
        })?;
        tracer.check_finished()?;
        let occlusion_rays = match &self.larsen {
            Some(larsen) => larsen.occlusion_rays()?,
            None => {
                let counts = self.images.counts.read(0, 4 * u64::from(launches))?;
                counts.chunks_exact(4).map(|c| u64::from(u32::from_ne_bytes([c[0], c[1], c[2], c[3]]))).sum()
            }
        };
        let all = pixels * u64::from(self.settings.rays_per_pixel) / u64::from(self.settings.resolution.period());
        self.state.frame = self.state.frame.wrapping_add(1);
        self.state.camera = Some(*camera);
        self.state.has_history = self.settings.history > 1 || self.larsen.is_some();
        Ok(FrameStats {
            timings,
            primary_rays: if still { 0 } else { pixels },
            occlusion_rays,
            skipped_rays: all.saturating_sub(occlusion_rays),
        })
    }

    /// Accessibility of each pixel of the last frame, rows from the top; 0 where nothing is.
    pub fn result(&self) -> Result<Vec<f32>> {
        Ok(bytemuck::pod_collect_to_vec(&self.images.result.read(0, 4 * self.pixels())?))
    }

    /// What the last frame's filter was given, rows from the top; 0 where nothing is and where there is no sample yet. Of the reference
    /// work's pipeline: the result.
    pub fn unfiltered(&self) -> Result<Vec<f32>> {
        match self.larsen {
            Some(_) => self.result(),
            None => Ok(self.estimates()?.into_iter().map(|e| e[0]).collect()),
        }
    }

    /// Samples behind each pixel of the last frame.
    pub fn samples(&self) -> Result<Vec<f32>> {
        Ok(self.estimates()?.into_iter().map(|e| e[1]).collect())
    }

    /// Mean, number of samples and variance of one sample of each pixel.
    fn estimates(&self) -> Result<Vec<[f32; 3]>> {
        let history: Vec<[u32; 2]> =
            bytemuck::pod_collect_to_vec(&self.images.histories[self.state.history].read(0, 8 * self.pixels())?);
        Ok(history.iter().map(|h| [f32::from_bits(h[0]), half(h[1] as u16), half((h[1] >> 16) as u16)]).collect())
    }

    /// Where the last frame shows something: 1, elsewhere 0; rows from the top.
    pub fn coverage(&self) -> Result<Vec<f32>> {
        let guide: Vec<[f32; 2]> =
            bytemuck::pod_collect_to_vec(&self.images.guides[self.state.guide].read(0, 8 * self.pixels())?);
        Ok(guide.iter().map(|g| if g[0] < f32::INFINITY { 1.0 } else { 0.0 }).collect())
    }

    /// What each pixel of the last frame shows, rows from the top; `None` where nothing is.
    pub fn surfaces(&self) -> Result<Vec<Option<Surface>>> {
        let floats = |buffer: &Buffer, bytes: u64| -> Result<Vec<f32>> {
            Ok(bytemuck::pod_collect_to_vec(&buffer.read(0, bytes * self.pixels())?))
        };
        let now = floats(&self.images.surface, SURFACE_BYTES)?;
        let before = self.images.previous_position.as_ref().map(|b| floats(b, POSITION_BYTES)).transpose()?;
        let point = |values: &[f32], k: usize| [values[k], values[k + 1], values[k + 2]];
        let covered = self.coverage()?;
        let surface = |(k, covered): (usize, &f32)| {
            let position = point(&now, k * SURFACE_BYTES as usize / 4);
            let before = before.as_ref().map_or(position, |b| point(b, 3 * k));
            (*covered > 0.0).then_some(Surface { position, before })
        };
        Ok(covered.iter().enumerate().map(surface).collect())
    }

    fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    fn block(&self) -> Block {
        Block { origin: [0, 0], size: self.size }
    }

    fn write_params(&mut self, camera: &CameraRecord, moved: &[MovedRecord], still: bool) -> Result<()> {
        let (s, images) = (&self.settings, &mut self.images);
        let previous = self.state.camera.unwrap_or(*camera);
        let [guide, previous_guide] = [self.state.guide, self.state.guide ^ 1].map(|k| images.guides[k].address());
        let [history, previous_history] = [self.state.history, self.state.history ^ 1].map(|k| images.histories[k].address());
        let block = Block { origin: [0, 0], size: self.size };
        let frame = FrameParams {
            camera_to_world: camera.camera_to_world,
            world_to_camera: inverse(camera),
            previous_world_to_camera: inverse(&previous),
            view: camera.view,
            previous_view: previous.view,
            orthographic: camera.orthographic.into(),
            previous_orthographic: previous.orthographic.into(),
            size: self.size,
            tiles_x: block.tiles_x(),
            frame: self.state.frame,
            seed: s.seed,
            rays_per_pixel: s.rays_per_pixel,
            pattern: s.resolution as u32,
            sequence: s.sequence as u32,
            reach: s.reach() as f32,
            falloff_log2: s.falloff.log2() as f32,
            most_samples: s.most_samples() as f32,
            depth_tolerance: DEPTH_TOLERANCE,
            normal_tolerance: NORMAL_TOLERANCE,
            still: still.into(),
            has_history: self.state.has_history.into(),
            moved_count: moved.len() as u32,
            clamp_width: s.clamp,
            moved_weight: s.moved_weight,
            filter_samples: if s.filter.kind == FilterKind::None { 0.0 } else { s.filter.samples },
            filter_radius: if s.filter.kind == FilterKind::None { 0 } else { s.filter.radius },
            rest: s.rest.into(),
            slices: s.gtao[0],
            steps: s.gtao[1],
            reserved: 0,
            surface: images.surface.address(),
            axes: images.axes.as_ref().map_or(0, Buffer::address),
            guide,
            previous_guide,
            history,
            previous_history,
            current: images.current.address(),
            samples: images.samples.as_ref().map_or(0, Buffer::address),
            previous_position: images.previous_position.as_ref().map_or(0, Buffer::address),
            result: images.result.address(),
            moved: images.moved.address(),
            tiles: 0,
            queue: images.queue.record(),
        };
        let params = BlockParams {
            hemisphere: (s.hemisphere == Hemisphere::Shading).into(),
            frame: images.frame_params.address(),
            ..block.params(self.size, camera, s.seed)
        };
        images.block_params.write(0, bytemuck::bytes_of(&params))?;
        images.frame_params.write(0, bytemuck::bytes_of(&frame))?;
        if let Some(larsen) = &mut self.larsen {
            larsen.begin(images.frame_params.address(), self.state.frame)?;
        }
        images.moved.write(0, bytemuck::cast_slice(moved))
    }
}

impl Passes {
    fn new(tracer: &Tracer, settings: &Settings) -> Result<Self> {
        let device = tracer.device();
        let compute = |name: &str, spirv: &[u8]| ComputePipeline::new(device, name, spirv, &Specialization::default());
        let ballot = device.info.int64 && device.info.limits.subgroup_ballot;
        let [gbuffer, accessibility] = Realtime::streams(settings);
        Ok(Self {
            gbuffer: tracer.stream(gbuffer)?,
            accessibility: tracer.stream(accessibility)?,
            spawn: compute("spawn", if ballot { stream::SPAWN_BALLOT } else { stream::SPAWN })?,
            gather: compute("gather", stream::GATHER)?,
            gtao: compute("gtao", stream::GTAO)?,
            temporal: compute("temporal", stream::TEMPORAL)?,
            filter: compute("filter", stream::FILTER)?,
        })
    }

    /// The pixels of a launch.
    fn record_occlusion(&self, r: &mut Recorder, images: &Images, push: Push, rays_per_pixel: u32) {
        let groups = push.count.div_ceil(LANES);
        images.queue.clear(r);
        r.barrier();
        r.timed("spawn", |r| r.dispatch(&self.spawn, &push, groups));
        r.barrier();
        self.accessibility.record(r, &images.queue.push(push, push.count * rays_per_pixel));
        r.barrier();
        if rays_per_pixel > 1 {
            r.timed("gather", |r| r.dispatch(&self.gather, &push, groups));
            r.barrier();
        }
    }
}

impl Images {
    fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, chunk: u32) -> Result<Self> {
        let device = tracer.device();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let launches = Block { origin: [0, 0], size }.rays().div_ceil(chunk);
        let image = |name: &str, bytes: u64| Buffer::new(device, name, bytes * pixels, Memory::Device);
        let maybe = |wanted: bool, name: &str, bytes: u64| if wanted { image(name, bytes).map(Some) } else { Ok(None) };
        let upload = |name: &str, bytes: usize| Buffer::new(device, name, bytes as u64, Memory::Upload);
        let rays = chunk * settings.rays_per_pixel;
        Ok(Self {
            block_params: upload("block parameters", size_of::<BlockParams>())?,
            frame_params: upload("frame parameters", size_of::<FrameParams>())?,
            moved: upload("what moved", MOST_MOVED * size_of::<MovedRecord>())?,
            surface: image("surfaces", SURFACE_BYTES)?,
            axes: maybe(settings.hemisphere == Hemisphere::Shading, "axes of hemispheres", 12)?,
            guides: [image("guide", 8)?, image("guide", 8)?],
            histories: [image("history", 8)?, image("history", 8)?],
            current: image("samples of the frame", 8)?,
            samples: match settings.rays_per_pixel > 1 {
                true => Some(Buffer::new(device, "samples", 4 * u64::from(rays), Memory::Device)?),
                false => None,
            },
            previous_position: maybe(tracer.is_dynamic(), "previous positions", POSITION_BYTES)?,
            result: Buffer::new(device, "accessibility", 4 * pixels, Memory::Readback)?,
            queue: RayQueue::new(device, rays)?,
            counts: Buffer::new(device, "numbers of rays", 4 * u64::from(launches), Memory::Readback)?,
        })
    }
}

/// A half float that is not negative, and finite.
fn half(bits: u16) -> f32 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    match exponent {
        0 => fraction * (-24f32).exp2(),
        e => (1024.0 + fraction) * ((e - 25) as f32).exp2(),
    }
}

/// World to camera, from the camera's own.
fn inverse(camera: &CameraRecord) -> [[f32; 4]; 3] {
    let m = camera.camera_to_world.map(|row| row.map(f64::from));
    let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
    let to_world = DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3));
    rows(&to_world.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats() {
        for (bits, want) in
            [(0, 0.0), (0x3c00, 1.0), (0x4000, 2.0), (0x3555, 0.333_251_95), (0x6800, 2048.0), (1, 5.960_464_5e-8)]
        {
            assert_eq!(half(bits), want);
        }
    }
}
