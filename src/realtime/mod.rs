//! Ambient occlusion frame after frame: the passes `gbuffer`, `accessibility`, `gather`, `temporal` and `filter`.
//!
//! `gbuffer` finds what each pixel's centre shows; `accessibility` traces occlusion rays of the pixels that are sampled in this
//! frame; `gather` adds up those of a pixel where there are several; `temporal` adds them to what earlier
//! frames know of the same surface; `filter` averages over neighbours. What nothing has changed since the previous frame is not
//! done again: while neither the camera nor the scene moves there are no camera rays, and pixels with a full history rest.

mod bent;
mod budget;
pub mod display;
pub mod frame_settings;
mod images;
mod larsen;
pub(super) mod params;
mod passes;
pub mod sequence;
pub mod settings;

use crate::shaders::{self, StreamShaders};
use glam::{DAffine3, DMat3, DVec3};

use crate::error::{Error, Result};
use crate::film::block::{Block, BlockParams};
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands, Timing};
use crate::integrators::ao::Hemisphere;
use crate::interface::records::frame::MAX_VARIANCE;
use crate::raster::{Primary, View};
use crate::tracer::gpu_scene::rows;
use crate::tracer::stream::LAUNCH_RAYS;
use crate::tracer::{Moved, Push, Tracer};
use budget::BudgetPass;
use display::{Display, DisplayPass};
use images::{Images, POSITION_BYTES, SURFACE_BYTES};
use larsen::Larsen;
use params::{FrameParams, MovedRecord, moved_records};
use passes::Passes;
pub use settings::{Budget, Filter, FilterKind, Preset, Resolution, Settings, Technique};

/// Launches of a submission: between them others get their turn on the device.
const MAX_LAUNCHES: usize = 8;
/// Distance from a pixel's plane, in footprints of the pixel, at which its neighbours belong to another surface.
pub(super) const DEPTH_TOLERANCE: f32 = 1.5;
/// Cosine between normals, likewise.
const NORMAL_TOLERANCE: f32 = 0.9;
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

impl FrameStats {
    /// Device seconds of what traces rays, which hierarchies that change are judged by ([`Tracer::traced`]).
    pub fn tracing_seconds(&self) -> f64 {
        self.timings.iter().filter(|t| t.label.contains("trace") || t.label == "gbuffer").map(|t| t.seconds).sum()
    }
}

/// The frames of one image size.
pub struct Realtime {
    size: [u32; 2],
    settings: Settings,
    passes: Passes,
    images: Images,
    larsen: Option<Box<Larsen>>,
    budget: Option<Box<BudgetPass>>,
    display: Option<DisplayPass>,
    /// Is it recorded?
    displays: bool,
    commands: Commands,
    primary_reason: String,
    state: State,
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
        [
            &shaders::GBUFFER_CLOSEST,
            if settings.attenuation().is_binary() { &shaders::ACCESSIBILITY_ANY } else { &shaders::ACCESSIBILITY_CLOSEST },
        ]
    }

    /// For images of `size` pixels of the tracer's scene. `lights` are the positions of its point lights, relative to its origin: the
    /// reference work's pipeline asks for them.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Self> {
        settings.check()?;
        let most = if settings.budget == Budget::Variance { Settings::MAX_SHARE } else { 1 } * settings.rays_per_pixel;
        let rays = u64::from(Block { origin: [0, 0], size }.rays()) * u64::from(most);
        if rays > u64::from(u32::MAX) {
            return Err(Error::Usage(format!(
                "{} rays per pixel of {}x{}: a frame has 2^32 rays at most; use fewer, or a smaller image",
                settings.rays_per_pixel, size[0], size[1]
            )));
        }
        let (primary, primary_reason) = match settings.primary {
            Some(primary) => (primary, "asked for".to_owned()),
            None => Primary::auto(tracer, u64::from(size[0]) * u64::from(size[1])),
        };
        Ok(Self {
            size,
            settings: Settings { primary: Some(primary), ..*settings },
            passes: Passes::new(tracer, size, settings, primary)?,
            primary_reason,
            images: Images::new(tracer, size, settings)?,
            larsen: match settings.technique {
                Technique::Larsen => Some(Box::new(Larsen::new(tracer, size, lights, settings)?)),
                _ => None,
            },
            budget: match settings.budget {
                Budget::Variance => Some(Box::new(BudgetPass::new(tracer, size, settings)?)),
                Budget::Uniform => None,
            },
            display: None,
            displays: false,
            commands: Commands::new(tracer.device())?,
            state: State::default(),
        })
    }

    /// Pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// How frames are made; [`Settings::primary`] is what it turned out to be.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Why camera rays are traced, or the scene drawn.
    pub fn primary_reason(&self) -> &str {
        &self.primary_reason
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
        let moved = moved_records(moved);
        // the reference work's pipeline makes everything anew
        let still = moved.is_empty() && self.state.camera == Some(*camera) && self.larsen.is_none();
        if !still {
            self.state.guide ^= 1;
        }
        self.state.history ^= 1;
        self.write_params(camera, &moved, still)?;
        let pixels = self.pixels();
        let push = Push { scene: tracer.scene_address(), pass: self.images.frame_params.address(), ..Default::default() };
        let launches = self.launches(push);
        let mut batches = launches.chunks(MAX_LAUNCHES).peekable();
        let (mut timings, mut first, mut drawn) = (Vec::new(), true, Ok(()));
        let view = View { camera: *camera, image_size: self.size, block: self.block(), at: [0.5; 2] };
        loop {
            // a frame without launches still has its other passes
            let (batch, begins) = (batches.next().unwrap_or_default(), std::mem::take(&mut first));
            let ends = batches.peek().is_none();
            timings.extend(self.commands.run(|r| {
                let (passes, images) = (&self.passes, &self.images);
                if begins && !still {
                    let guide = &images.guides[self.state.guide];
                    drawn = passes.record_gbuffer(r, tracer, images, guide, push, &view);
                }
                if let Some(larsen) = &self.larsen {
                    larsen.record(r, push, &images.result);
                } else {
                    if begins {
                        passes.record_begin(r, images, push, pixels as u32, self.settings.technique);
                        self.budget.iter().for_each(|b| b.record(r, push));
                    }
                    let several = self.settings.rays_per_pixel > 1 && self.budget.is_none();
                    for push in batch {
                        passes.record_occlusion(r, push, self.settings.rays_per_pixel, several);
                    }
                    if ends {
                        self.budget.iter().for_each(|b| b.record_gather(r, &passes.gather, push));
                        let history = &images.histories[self.state.history];
                        passes.record_end(r, images, push, pixels as u32, history, &self.settings.filter);
                    }
                }
                if let Some(display) = self.display.as_ref().filter(|_| ends && self.displays) {
                    display.record(r, pixels as u32);
                }
            })?);
            if ends {
                break;
            }
        }
        drawn?;
        tracer.check_finished()?;
        let occlusion_rays = match &self.larsen {
            Some(larsen) => larsen.occlusion_rays()?,
            None => {
                let bytes = self.images.ray_count.read(0, 4)?;
                u64::from(u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
            }
        };
        let all = pixels * u64::from(self.settings.rays_per_pixel) / u64::from(self.settings.resolution.period());
        self.state.frame = self.state.frame.wrapping_add(1);
        self.state.camera = Some(*camera);
        self.state.has_history = self.settings.history > 1 || self.larsen.is_some();
        Ok(FrameStats {
            timings,
            primary_rays: if still || self.settings.primary == Some(Primary::Raster) { 0 } else { pixels },
            occlusion_rays,
            skipped_rays: all.saturating_sub(occlusion_rays),
        })
    }

    /// What frames from the next on leave in [`Realtime::displayed`], beside everything else and in the same submission; `None`: nothing,
    /// at no cost. May change before every frame: the first time compiles the pass, later ones write its parameters.
    ///
    /// # Errors
    /// [`Error::Usage`] for what these settings do not make, and those of compiling the shader.
    pub fn display(&mut self, tracer: &Tracer, display: Option<Display>) -> Result<()> {
        self.displays = false;
        let Some(display) = display else { return Ok(()) };
        display.shown.check(&self.settings)?;
        let mut pass = match self.display.take() {
            Some(pass) => pass,
            None => DisplayPass::new(tracer, self.pixels())?,
        };
        pass.set(&display, &self.settings, self.images.frame_params.address())?;
        (self.display, self.displays) = (Some(pass), true);
        Ok(())
    }

    /// The last frame as [`Realtime::display`] asked for it, in device memory: a word a pixel, rows from the top, the bytes red, green,
    /// blue and 255. `None` before the first time.
    pub fn displayed(&self) -> Option<&Buffer> {
        self.display.as_ref().map(|d| &d.words)
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

    /// Bent normal of each pixel of the last frame, rows from the top: the mean over the cosine-weighted hemisphere of accessibility times
    /// direction, world space. Its length tells how much is open, and how much to one side: on an open plane two thirds, where nothing
    /// is open 0. Divided by [`Realtime::result`] it is the mean of the open directions. 0 where nothing is.
    ///
    /// # Errors
    /// [`Error::Usage`] without [`Settings::bent`], and those of the device.
    pub fn bent(&self) -> Result<Vec<[f32; 3]>> {
        let bent = self.images.bent.as_ref().ok_or_else(bent::not_asked_for)?;
        Ok(bytemuck::pod_collect_to_vec(&bent.result.read(0, 12 * self.pixels())?))
    }

    /// Mean, number of samples and variance of one sample of each pixel.
    fn estimates(&self) -> Result<Vec<[f32; 3]>> {
        let history: Vec<[u32; 2]> =
            bytemuck::pod_collect_to_vec(&self.images.histories[self.state.history].read(0, 8 * self.pixels())?);
        // as shaders pack it (`pack_estimate`)
        Ok(history
            .iter()
            .map(|h| [f32::from_bits(h[0]), (h[1] >> 16) as f32 / 16.0, (h[1] & 0xffff) as f32 * (MAX_VARIANCE / 65535.0)])
            .collect())
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

    /// The launches of occlusion rays, each of whole pixels.
    fn launches(&self, push: Push) -> Vec<Push> {
        let n = self.settings.rays_per_pixel;
        let (all, most) = (self.block().rays() * n, LAUNCH_RAYS / n * n);
        if let Some(budget) = &self.budget {
            return budget.launches(self.pixels(), push);
        }
        match self.settings.technique {
            Technique::Traced => {
                (0..all).step_by(most as usize).map(|first| Push { first, count: most.min(all - first), ..push }).collect()
            }
            Technique::Gtao | Technique::Larsen => Vec::new(),
        }
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
            reach: s.attenuation().reach() as f32,
            falloff_log2: s.attenuation().falloff_log2() as f32,
            most_samples: s.most_samples() as f32,
            depth_tolerance: DEPTH_TOLERANCE,
            normal_tolerance: NORMAL_TOLERANCE,
            still: still.into(),
            has_history: self.state.has_history.into(),
            moved_count: moved.len() as u32,
            clamp_width: s.clamp,
            moved_weight: s.moved_weight,
            filter_samples: s.filter.samples,
            rest: (s.rest && still && self.state.has_history).into(),
            slices: s.gtao[0],
            steps: s.gtao[1],
            evenness: if s.attenuation().is_binary() { 0.0 } else { s.sequence.evenness() },
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
            ray_count: images.ray_count.address(),
            ..images.bent.as_ref().map_or_else(FrameParams::default, |b| b.params(self.state.history))
        };
        let frame = self.budget.as_ref().map_or(frame, |b| b.params(frame));
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

/// World to camera, from the camera's own.
pub(super) fn inverse(camera: &CameraRecord) -> [[f32; 4]; 3] {
    let m = camera.camera_to_world.map(|row| row.map(f64::from));
    let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
    let to_world = DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3));
    rows(&to_world.inverse())
}
