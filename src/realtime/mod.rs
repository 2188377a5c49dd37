//! Ambient occlusion frame after frame, in passes (`passes`) over the images of a frame (`resources`).
//!
//! `gbuffer` finds the surface at each pixel's centre; `ao_trace` traces occlusion rays of the pixels that are sampled in this
//! frame; `gather` averages the samples of a pixel if there are several; `temporal` adds them to the
//! history of the same surface, reprojected from the previous frame; `filter` averages over neighbours. Passes whose inputs have not changed
//! are skipped (`graph`): while neither the camera nor the scene moves no camera rays are traced, nor occlusion rays of pixels with a full history. At rest, where the image converges,
//! `rest_samples` takes the place of the passes up to `filter` after a few frames.

mod frame_samples;
pub mod frame_settings;
mod graph;
pub(super) mod params;
mod passes;
mod resample;
mod resources;
pub mod sequence;
pub mod settings;

use glam::{DAffine3, DMat3, DVec3};

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::block::Block;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Timing};
use crate::integrators::path::PathOptions;
use crate::interface::records::denoise::RadianceRecord;
use crate::interface::records::frame::MAX_VARIANCE;
use crate::raster::Primary;
use crate::scene::Scene;
use crate::shaders::StreamShaders;
use crate::tracer::stream::launch_rays;
use crate::tracer::transform::rows;
use crate::tracer::{MovedBounds, Tracer};
use display::{Display, DisplayMode};
use frame_samples::FrameSamples;
use graph::{Frame, Graph, Params};
use params::{FrameParams, moved_records};
pub use passes::display;
pub(crate) use passes::nlmeans;
pub use passes::nodes::NodeVisits;
use passes::{debug, debug_view};
use resample::SeenSurfaces;
use resources::{Extent, Resource, SURFACE_BYTES};
pub use settings::{Filter, FilterKind, GtaoConstants, Preset, Resolution, Settings, Technique};

/// Distance from a pixel's tangent plane, in pixel footprints, from which a neighbour counts as another surface.
pub(super) const DEPTH_TOLERANCE: f32 = 1.5;
/// Cosine between normals below which a neighbour counts as another surface.
const NORMAL_TOLERANCE: f32 = 0.9;
/// Work and timings of a frame.
#[derive(Clone, Debug, Default)]
pub struct FrameStats {
    /// Device seconds of each step of each pass, in order.
    pub timings: Vec<Timing>,
    /// Samples of each pixel that is sampled in the frame.
    pub samples: u32,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Occlusion rays traced.
    pub occlusion_rays: u64,
    /// Occlusion rays of sampled pixels that were not traced: background, or a full history while nothing moves.
    pub skipped_rays: u64,
    /// BVH nodes that the frame's camera rays visit; `None` unless they are displayed ([`DisplayMode::Nodes`]).
    pub nodes: Option<NodeVisits>,
}

/// The surface point at a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Position, relative to the scene's origin.
    pub position: [f32; 3],
    /// Position of the same point before the scene's last update.
    pub before: [f32; 3],
}

impl FrameStats {
    /// Device seconds of the passes that trace rays, by which the quality of refitted hierarchies is judged ([`Tracer::traced`]).
    pub fn tracing_seconds(&self) -> f64 {
        self.timings.iter().filter(|t| t.label.ends_with(" trace") || t.label == "gbuffer").map(|t| t.seconds).sum()
    }
}

/// The real-time pipeline at one image size.
pub struct Realtime {
    size: [u32; 2],
    settings: Settings,
    graph: Graph,
    params: Params<FrameParams>,
    /// The buffer to display, if any.
    display: Option<Display>,
    /// The buffer that the last frame displayed.
    shown: Option<Option<Display>>,
    /// Passes of the display that exist.
    displays: Vec<DisplayPassKind>,
    primary_reason: String,
    state: State,
    is_radiance: bool,
    frame_samples: FrameSamples,
    /// How much of an image the one before has shown, once it is needed.
    seen: Option<SeenSurfaces>,
}

/// Which pass writes the displayed image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DisplayPassKind {
    Buffer,
    Rays,
    View(DisplayMode),
}

impl DisplayPassKind {
    fn of(shown: DisplayMode) -> Self {
        match shown {
            DisplayMode::Rays => Self::Rays,
            shown if debug_view(shown).is_some() => Self::View(shown),
            _ => Self::Buffer,
        }
    }
}

/// State that the next frame depends on.
#[derive(Clone, Default)]
struct State {
    frame: u32,
    camera: Option<CameraRecord>,
    has_history: bool,
    has_resolved: bool,
    /// Where samples lay in their pixels.
    offset: [f32; 2],
    /// Frames since camera and scene last changed, this one included; of an image that begins at rest its first frame, too.
    resting: u32,
    /// Ambient visibility: mean number of samples of a pixel at rest when they were last denoised.
    denoised_samples: u64,
    /// Radiance: index of the next path in a pixel's sequence. A pixel takes the samples of its sequence one after the other, also where it is sampled in every second or fourth frame only:
    /// all samples of a sequence are more even than every fourth of them.
    first_path: u32,
    /// Radiance: the samples since the image came to rest are of a block of the sequence, from its beginning.
    in_block: bool,
    /// Radiance: maximum number of paths of a pixel since then. The other pixels of the pattern follow with samples of the same indices.
    pattern_paths: u32,
    /// Lights or materials have changed: histories of radiance count less.
    has_new_light: bool,
    /// The rotation to the environment map, if it is not yet on the device.
    environment_turn: Option<DMat3>,
    /// A frame was interrupted: the samples at rest are in pieces and start anew.
    was_interrupted: bool,
}

/// Paths at rest begin at a multiple of this: 2^k samples of a sequence fill the square evenly only where the first one's index is a multiple of 2^k.
const REST_BLOCK: u32 = 1 << 12;

/// Index of the stage that finds the surfaces in view, of all pipelines.
const SURFACES_STAGE: usize = 0;

/// Share of the surfaces in view that the previous image has shown, below which a frame begins anew: the first frame of an image has its samples where they say most, and those of a frame that goes on with
/// histories of few pixels are worse in all others.
const LEAST_KNOWN: f64 = 1.0 / 3.0;

/// Pixels by which that share is known.
const KNOWN_PIXELS: u32 = 2048;

/// Maximum samples for which a history of radiance counts after lights or materials have changed, per ray of a frame.
const PAST_AFTER_NEW_LIGHT: f32 = 8.0;

impl Realtime {
    /// The streams that it traces.
    pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
        passes::streams(settings)
    }

    /// Creates the pipeline for images of `size` pixels of the tracer's scene. `lights` are the positions of the scene's point lights relative to its origin,
    /// which Larsen's pipeline needs.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Self> {
        settings.check()?;
        let settings = &settings.with_launches_of(&tracer.device().info);
        let block = Block { origin: [0, 0], size };
        let rays = u64::from(block.rays()) * u64::from(settings.rays_per_pixel);
        if rays > u64::from(u32::MAX) {
            return Err(Error::Usage(format!(
                "{} rays per pixel of {}x{}: a frame has 2^32 rays at most; use fewer, or a smaller image",
                settings.rays_per_pixel, size[0], size[1]
            )));
        }
        let (primary, primary_reason) = match settings.primary {
            Some(primary) => (primary, "requested".to_owned()),
            None => Primary::auto(tracer, u64::from(size[0]) * u64::from(size[1])),
        };
        let pixels = |size: [u32; 2]| u64::from(size[0]) * u64::from(size[1]);
        let extent = Extent {
            pixels: pixels(size),
            half_pixels: pixels(size.map(|n| n.div_ceil(2))),
            launch_rays: launch_rays(&tracer.device().info).into(),
        };
        let device = tracer.device();
        let frame_samples = FrameSamples::of_visibility(settings, pixels(size));
        let stages = passes::stages(tracer, block, settings, primary, lights, frame_samples)?;
        Ok(Self {
            size,
            settings: Settings { primary: Some(primary), ..*settings },
            graph: Graph::new(device, extent, stages)?,
            params: Params::new(device, "frame parameters")?,
            display: None,
            shown: None,
            displays: Vec::new(),
            primary_reason,
            state: State::default(),
            is_radiance: false,
            frame_samples,
            seen: None,
        })
    }

    /// Creates the pipeline for frames of radiance. The tracer must have been built from `flat` with [`crate::tracer::Needs::shading`]; `options` are those of
    /// paths, whose number per pixel is [`Settings::rays_per_pixel`].
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range or without effect on radiance, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn radiance(
        tracer: &Tracer,
        flat: &FlatScene,
        size: [u32; 2],
        settings: &Settings,
        options: &PathOptions,
    ) -> Result<Self> {
        settings.check()?;
        settings.check_radiance()?;
        let settings = &settings.with_launches_of(&tracer.device().info);
        let block = Block { origin: [0, 0], size };
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let extent = Extent { pixels, half_pixels: pixels.div_ceil(4), ..Default::default() };
        let device = tracer.device();
        let frame_samples = FrameSamples::of_radiance(settings, pixels, device.info.is_cpu());
        let stages = passes::radiance_stages(tracer, flat, block, settings, options, frame_samples)?;
        let graph = Graph::new(device, extent, stages)?;
        let primary_reason = match graph.resources().buffer(Resource::KnownHits) {
            Some(_) => "paths begin with a camera ray; in motion at what those of the G-buffer hit, which are traced once",
            None => "paths begin with a camera ray",
        };
        Ok(Self {
            size,
            settings: Settings {
                primary: Some(Primary::Traced),
                rest_samples: settings.rest_samples.max(Settings::RADIANCE_REST_SAMPLES),
                ..*settings
            },
            graph,
            params: Params::new(device, "frame parameters")?,
            display: None,
            shown: None,
            displays: Vec::new(),
            primary_reason: primary_reason.into(),
            state: State::default(),
            is_radiance: true,
            frame_samples,
            seen: None,
        })
    }

    /// Returns true for frames of radiance.
    pub fn is_radiance(&self) -> bool {
        self.is_radiance
    }

    /// Number of values per pixel of [`Realtime::result`]: 1 of ambient visibility, 3 of radiance.
    pub fn channels(&self) -> usize {
        if self.is_radiance { 3 } else { 1 }
    }

    /// Lights or materials have changed since the last frame: histories of radiance count in the next one as far as its samples do not differ from them, and for eight frames at most. Those of ambient visibility do not depend on them.
    pub fn change_light(&mut self) {
        if self.is_radiance {
            self.state.has_new_light = true;
            self.state.resting = 0;
        }
    }

    /// Turns the environment map from the next frame on, and calls [`Realtime::change_light`]: `to_map` is the rotation from world directions to the map's
    /// ([`crate::scene::EnvironmentMap::to_map`]). No other environment has a direction, and ambient visibility depends on none.
    pub fn turn_environment(&mut self, to_map: DMat3) {
        if self.is_radiance {
            self.state.environment_turn = Some(to_map);
            self.change_light();
        }
    }

    /// Moves lights, and surfaces that emit light, to where they are in `scene` from the next frame on, and calls [`Realtime::change_light`] if any has moved. `scene` is the
    /// tracer's in the pose to which that was updated. Ambient visibility depends on no light.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] where lights were switched on or off, which needs other shaders.
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<()> {
        if self.graph.move_lights(tracer, scene)? {
            self.change_light();
        }
        Ok(())
    }

    /// Image size in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Settings of the pipeline; [`Settings::primary`] is resolved.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Number of frames at rest after which the image no longer changes; `None`: with every frame, or it is pixels that come to rest, each on its own.
    pub fn frames_to_rest(&self) -> Option<u32> {
        if !self.settings.converges() {
            return self.settings.frames_to_rest();
        }
        let frames = self.frame_samples.frames_for(self.settings.rest_samples);
        // frames of a pattern of radiance have samples of the same indices; the frame before those at rest counts besides
        Some(if self.is_radiance { frames * self.settings.resolution.period() + 1 } else { frames })
    }

    /// Number of frames at rest, the one before them not counted, that have as many samples of a pixel as so many long frames that do not grow: fewer where they do.
    pub fn frames_for(settings: &Settings, size: [u32; 2], is_radiance: bool, is_cpu: bool, frames: u32) -> u32 {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let samples = match is_radiance {
            true => FrameSamples::of_radiance(settings, pixels, is_cpu),
            false => FrameSamples::of_visibility(settings, pixels),
        };
        samples.frames_for_first(frames).min(frames)
    }

    /// Samples of a pixel that the last frame shows: since the image came to rest, or of the longest history.
    pub fn shown_samples(&self) -> u32 {
        let (s, resting) = (&self.settings, self.state.resting);
        if s.converges() {
            let since_rest = self.frame_samples.since_rest(resting);
            let period = if self.is_radiance { s.resolution.period() } else { 1 };
            let of_first = if self.frame_samples.has_forgotten_short(resting) { 0 } else { s.rays_per_pixel };
            u32::try_from(since_rest / u64::from(period)).unwrap_or(u32::MAX).saturating_add(of_first)
        } else {
            resting.saturating_add(1).min(s.history).saturating_mul(s.rays_per_pixel)
        }
    }

    /// Why camera rays are traced or rasterized.
    pub fn primary_reason(&self) -> &str {
        &self.primary_reason
    }

    /// Discards the history.
    pub fn reset(&mut self) {
        self.state.has_history = false;
        self.state.has_resolved = false;
        self.state.camera = None;
    }

    /// Discards the history as [`Realtime::reset`] does, and restarts the sampler at the first frame.
    pub fn rewind(&mut self) {
        self.start_at(0);
    }

    /// Discards the history, and gives the next frame this number, by which samples are chosen. After the last number of 32 bits comes 0.
    pub fn start_at(&mut self, frame: u32) {
        self.reset();
        self.state.frame = frame;
        self.state.first_path = (frame / self.settings.resolution.period()).wrapping_mul(self.settings.rays_per_pixel);
        self.state.pattern_paths = 0;
    }

    /// Renders the next frame. `moved` is what has moved in the scene since the previous one ([`crate::tracer::UpdateStats::moved`]).
    ///
    /// # Errors
    /// Those of the device.
    pub fn frame(&mut self, tracer: &Tracer, camera: &CameraRecord, moved: &[MovedBounds]) -> Result<FrameStats> {
        self.frame_with(tracer, camera, moved, None)
    }

    /// As [`Realtime::frame`]; `control` is asked between launches whether to stop. After an interruption the next frame is what it would have been without
    /// the interrupted one, histories included; only samples at rest start anew. Where something had moved in the scene, with Larsen's pipeline and after other errors there is no history.
    ///
    /// # Errors
    /// Those of the device, and [`Error::Interrupted`] when `control` says so.
    pub fn frame_with(
        &mut self,
        tracer: &Tracer,
        camera: &CameraRecord,
        moved: &[MovedBounds],
        control: Option<&mut dyn Control>,
    ) -> Result<FrameStats> {
        let before = self.state.clone();
        let stats = self.try_frame(tracer, camera, moved, control);
        match &stats {
            Ok(_) => {}
            // where the scene was is known of the frame before only
            Err(Error::Interrupted) if moved.is_empty() && self.settings.technique != Technique::Larsen => {
                self.graph.take_back();
                self.state = State { was_interrupted: true, ..before };
            }
            Err(_) => {
                self.graph.invalidate();
                self.reset();
            }
        }
        stats
    }

    /// Returns true if the previous image may have shown little of what the camera sees now.
    fn may_be_cut(&self, camera: &CameraRecord) -> bool {
        let Some(before) = self.state.camera.filter(|before| before != camera) else { return false };
        if !self.state.has_history || self.settings.technique == Technique::Larsen {
            return false;
        }
        // paths wait for the host after the surfaces anyway
        self.is_radiance || is_jump(&before, camera, self.settings.attenuation().reach())
    }

    /// Radiance: has paths at rest begin with a block of the sequence.
    fn align_paths(&mut self, rest_starts: bool, resting: u32) {
        let (taken, begins_pattern) =
            (self.state.first_path % REST_BLOCK, self.state.frame.is_multiple_of(self.settings.resolution.period()));
        if rest_starts {
            self.state.in_block = taken == 0 && begins_pattern;
        }
        // in motion the frames together take a sequence from its beginning; a pattern has the same paths in all its frames
        if resting > 0 && begins_pattern && !self.state.in_block {
            // a camera that has stood still from the first frame has the paths of a still
            let is_forgotten = self.frame_samples.has_forgotten_short(resting) && taken <= self.frame_samples.in_short();
            let rest = if is_forgotten { 0 } else { REST_BLOCK };
            self.state.first_path = (self.state.first_path - taken).wrapping_add(rest);
            self.state.in_block = true;
        }
    }

    fn try_frame(
        &mut self,
        tracer: &Tracer,
        camera: &CameraRecord,
        moved_bounds: &[MovedBounds],
        mut control: Option<&mut dyn Control>,
    ) -> Result<FrameStats> {
        let moved = moved_records(moved_bounds);
        let is_larsen = self.settings.technique == Technique::Larsen;
        // Larsen's pipeline skips no pass
        let is_undisturbed = !self.state.has_new_light && !self.state.was_interrupted;
        let has_moved = !moved.is_empty() || self.state.camera != Some(*camera);
        let still = !has_moved && !is_larsen && is_undisturbed;
        // histories are of the same pixels then, wherever in them samples lie
        let only_light_is_new = !has_moved && self.state.has_new_light && self.state.has_resolved;
        // an image of which nothing is known yet begins as if it had come to rest: there are no histories to go on with, and places of their own for all paths say more
        let begins_at_rest = self.is_radiance && !self.state.has_resolved && self.frame_samples.starts_anew(1);
        let resting = if still { self.state.resting.saturating_add(1) } else { u32::from(begins_at_rest) };
        let has_come_to_rest = self.frames_to_rest().is_some_and(|frames| resting >= frames);
        let (is_long, samples) = (self.frame_samples.is_long(resting), self.frame_samples.of(resting));
        if has_come_to_rest && self.shown == Some(self.display) {
            return Ok(FrameStats { skipped_rays: self.pixels() * u64::from(samples), ..Default::default() });
        }
        let rest_starts = resting == 0 || !self.state.has_resolved || self.frame_samples.starts_anew(resting);
        if self.is_radiance {
            self.align_paths(rest_starts, resting);
        }
        // one path a frame: places of frames are more even than those of the first few points of a sequence
        let spreads = self.is_radiance
            && self.settings.converges()
            && self.settings.antialias
            && samples > 1
            && (is_long || !rest_starts || !self.state.has_resolved || only_light_is_new);
        let offset = match self.settings.antialias {
            // what is known of surfaces is of the last frame whose samples lay at one place
            true if spreads && (still || only_light_is_new) => self.state.offset,
            true if still && is_long && !self.is_radiance => self.state.offset,
            true => sample_offset(self.state.frame),
            false => [0.0; 2],
        };
        // camera rays start elsewhere
        let has_moved_samples = offset != self.state.offset;
        for (resource, changed) in [
            (Resource::FrameNumber, true),
            (Resource::Camera, !still || has_moved_samples),
            (Resource::Scene, !moved.is_empty()),
        ] {
            if changed {
                self.graph.touch(resource);
            }
        }
        let stages = self.graph.begin(self.display.as_ref(), is_long);
        let rest_samples = self.frame_samples.since_rest(resting);
        let denoised = if resting == 0 { 0 } else { self.state.denoised_samples };
        let denoises = !self.is_radiance
            && rest_samples >= nlmeans::MIN_SAMPLES
            && resting >= nlmeans::MIN_FRAMES
            && rest_samples >= denoised + denoised / 16;
        self.params.write(&self.frame_params(camera, still, offset))?;
        let frame = Frame {
            tracer,
            settings: &self.settings,
            block: self.block(),
            camera: *camera,
            moved: &moved,
            number: self.state.frame,
            offset,
            has_moved,
            previous_to_camera: between(&self.state.camera.unwrap_or(*camera), camera),
            has_resolved: self.state.has_resolved,
            rest_starts,
            spreads,
            resting,
            is_long,
            samples,
            rest_samples,
            first_sample: match self.is_radiance {
                true => self.state.first_path,
                false if is_long => self.frame_samples.in_long_before(resting),
                false => 0,
            },
            denoises,
            has_denoised: denoises || denoised > 0,
            most_past: match self.state.has_new_light {
                true => PAST_AFTER_NEW_LIGHT * self.settings.rays_per_pixel as f32,
                false => f32::INFINITY,
            },
            environment_turn: self.state.environment_turn,
            params: self.params.address(),
            display: self.display,
        };
        let pixels = self.pixels();
        // surfaces first where the camera may have jumped: histories are of little use then
        let looks_first = stages.first() == Some(&SURFACES_STAGE) && self.may_be_cut(camera);
        let (surfaces, others) = stages.split_at(usize::from(looks_first));
        let mut timings = Vec::new();
        if looks_first {
            let between_launches = control.as_mut().map(|c| &mut **c as &mut dyn Control);
            timings = self.graph.run(&frame, surfaces, between_launches)?;
            let seen = match &mut self.seen {
                Some(seen) => seen,
                none => none.insert(SeenSurfaces::new(tracer)?),
            };
            let known = seen.share(frame.params, pixels as u32, sample_stride(self.size))?;
            if known < LEAST_KNOWN {
                self.graph.take_back();
                self.rewind();
                return self.try_frame(tracer, camera, moved_bounds, control);
            }
        }
        timings.extend(self.graph.run(&frame, others, control)?);
        self.graph.finish();
        tracer.check_finished()?;
        let occlusion_rays = self.graph.rays()?;
        let period = self.settings.resolution.period();
        let all = pixels * u64::from(samples) / u64::from(if is_long && !self.is_radiance { 1 } else { period });
        self.state.frame = self.state.frame.wrapping_add(1);
        self.state.pattern_paths = self.state.pattern_paths.max(samples);
        self.state.denoised_samples = if denoises { rest_samples } else { denoised };
        if self.state.frame.is_multiple_of(period) {
            self.state.first_path = self.state.first_path.wrapping_add(self.state.pattern_paths);
            self.state.pattern_paths = 0;
        }
        self.state.camera = Some(*camera);
        self.state.has_history = self.settings.history > 1 || is_larsen;
        self.state.has_resolved = true;
        self.state.resting = resting;
        self.state.offset = offset;
        self.state.has_new_light = false;
        self.state.environment_turn = None;
        self.state.was_interrupted = false;
        self.shown = Some(self.display);
        Ok(FrameStats {
            timings,
            samples,
            primary_rays: match self.settings.primary {
                Some(Primary::Raster) if !is_long => 0,
                // of each sample, unless they are those of the G-buffer
                _ if self.is_radiance => {
                    let has_own = spreads || self.graph.resources().buffer(Resource::KnownHits).is_none();
                    pixels * (if has_own { u64::from(samples) } else { 0 } + u64::from(!still || has_moved_samples))
                }
                _ if is_long => pixels * u64::from(samples),
                _ if still && !has_moved_samples => 0,
                _ => pixels,
            },
            occlusion_rays,
            skipped_rays: all.saturating_sub(occlusion_rays),
            nodes: match self.display.is_some_and(|d| d.shown == DisplayMode::Nodes) {
                true => Some(NodeVisits::read(self.graph.resources(), pixels)?),
                false => None,
            },
        })
    }

    /// Sets the buffer that the next frames write to [`Realtime::displayed`], in the same submission; `None`: none, at no cost. It may change
    /// before every frame: the first call compiles the pass, later ones write its parameters. The first one with [`DisplayMode::Rays`] discards the history.
    ///
    /// # Errors
    /// [`Error::Usage`] for a buffer that these settings do not produce, and those of compiling the shader.
    pub fn display(&mut self, tracer: &Tracer, display: Option<Display>) -> Result<()> {
        if let Some(display) = &display {
            display.shown.check(&self.settings)?;
            if self.is_radiance {
                display.shown.check_radiance()?;
            }
            let view = debug_view(display.shown);
            let kind = DisplayPassKind::of(display.shown);
            if !self.displays.contains(&kind) {
                let stage = match view {
                    Some((view, shader)) => debug::stage(tracer, self.block(), display.shown, view, shader)?,
                    None => display::stage(tracer, self.pixels() as u32, kind == DisplayPassKind::Rays)?,
                };
                if !self.graph.extend(tracer.device(), vec![stage])? {
                    self.reset();
                }
                self.displays.push(kind);
            }
        }
        if self.display != display {
            self.graph.touch(Resource::DisplaySettings);
        }
        self.display = display;
        Ok(())
    }

    /// The displayed image of the last frame, in device memory: 8-bit RGBA with alpha 255, rows from the top. `None` before the first call of
    /// [`Realtime::display`].
    pub fn displayed(&self) -> Option<&Buffer> {
        self.graph.resources().buffer(Resource::DisplayImage)
    }

    /// The last frame, rows from the top: ambient visibility of each pixel, or linear radiance, red, green and blue. Ambient visibility is 0 for background; of a
    /// pixel that shows some, it is the mean over the pixel.
    pub fn result(&self) -> Result<Vec<f32>> {
        let channels = self.channels();
        match self.resolved()? {
            Some(resolved) => Ok(resolved.iter().flat_map(|q| &q[..channels]).copied().collect()),
            None => self.read(Resource::Result),
        }
    }

    /// The final image with coverage, if there is one besides that of the filter.
    fn resolved(&self) -> Result<Option<Vec<[f32; 4]>>> {
        let resolved: Vec<[f32; 4]> = self.read(Resource::Resolved)?;
        Ok((!resolved.is_empty()).then_some(resolved))
    }

    /// Input of the last frame's spatial filter (of radiance: diffuse reflection divided by the albedo, the mean of its channels), rows from the top; 0 for background and for pixels without a sample yet. With Larsen's pipeline: the result.
    pub fn unfiltered(&self) -> Result<Vec<f32>> {
        match self.settings.technique {
            Technique::Larsen => self.result(),
            _ => Ok(self.estimates()?.into_iter().map(|e| e[0]).collect()),
        }
    }

    /// Number of samples accumulated in each pixel of the last frame.
    pub fn samples(&self) -> Result<Vec<f32>> {
        Ok(self.estimates()?.into_iter().map(|e| e[1]).collect())
    }

    /// Variance of the mean of each pixel's samples in the last frame, before any spatial filter; 0 for background.
    pub fn variances(&self) -> Result<Vec<f32>> {
        Ok(self.estimates()?.into_iter().map(|[_, samples, variance]| variance / samples.max(1.0)).collect())
    }

    /// Bent normal of each pixel of the last frame, rows from the top: the mean over the cosine-weighted hemisphere of ambient visibility
    /// times direction, world space. Its length is two thirds on an unoccluded plane, and 0 if everything is occluded. Divided by
    /// [`Realtime::result`] it is the mean unoccluded direction. 0 for background.
    ///
    /// # Errors
    /// [`Error::Usage`] without [`Settings::bent`], and those of the device.
    pub fn bent(&self) -> Result<Vec<[f32; 3]>> {
        if !self.settings.bent {
            return Err(display::bent_normals_disabled());
        }
        self.read(Resource::BentResult)
    }

    /// Reads back a resource, one record per pixel.
    fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, resource: Resource) -> Result<Vec<T>> {
        self.graph.resources().read(resource, self.pixels())
    }

    /// Mean, number of samples and variance of one sample of each pixel.
    fn estimates(&self) -> Result<Vec<[f32; 3]>> {
        if self.is_radiance {
            let history: Vec<RadianceRecord> = self.read(Resource::DiffuseHistory)?;
            let mean = |c: [f32; 3]| c.iter().sum::<f32>() / 3.0;
            return Ok(history.iter().map(|h| [mean(h.mean), h.samples, mean(h.variance)]).collect());
        }
        let mut history: Vec<[u32; 2]> = self.read(Resource::History)?;
        // Larsen's pipeline has none
        history.resize(self.pixels() as usize, [0; 2]);
        // as shaders pack it (`pack_estimate`)
        Ok(history
            .iter()
            .map(|h| [f32::from_bits(h[0]), (h[1] >> 16) as f32 / 16.0, (h[1] & 0xffff) as f32 * (MAX_VARIANCE / 65535.0)])
            .collect())
    }

    /// Coverage of the last frame, rows from the top: the fraction of each pixel that shows the scene. Without antialiasing: 1 where its centre does, else 0.
    pub fn coverage(&self) -> Result<Vec<f32>> {
        match self.resolved()? {
            Some(resolved) => Ok(resolved.iter().map(|q| q[3]).collect()),
            None => self.sampled(),
        }
    }

    /// 1 where the sample of a pixel shows the scene in the last frame, else 0; rows from the top.
    fn sampled(&self) -> Result<Vec<f32>> {
        let guide: Vec<[f32; 2]> = self.read(Resource::Guide)?;
        Ok(guide.iter().map(|g| if g[0] < f32::INFINITY { 1.0 } else { 0.0 }).collect())
    }

    /// Surface point of each pixel of the last frame, rows from the top; `None` for background.
    pub fn surfaces(&self) -> Result<Vec<Option<Surface>>> {
        const WORDS: usize = SURFACE_BYTES as usize / 4;
        let now: Vec<[f32; WORDS]> = self.read(Resource::Surface)?;
        let before: Vec<[f32; 3]> = self.read(Resource::PreviousPosition)?;
        let covered = self.sampled()?;
        let surface = |(k, covered): (usize, &f32)| {
            let position = [now[k][0], now[k][1], now[k][2]];
            let before = before.get(k).copied().unwrap_or(position);
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

    /// Parameters that all passes share.
    fn frame_params(&self, camera: &CameraRecord, still: bool, offset: [f32; 2]) -> FrameParams {
        let (s, resources) = (&self.settings, self.graph.resources());
        let previous = self.state.camera.unwrap_or(*camera);
        FrameParams {
            camera_to_world: camera.camera_to_world,
            world_to_camera: inverse(camera),
            previous_world_to_camera: inverse(&previous),
            view: camera.view,
            previous_view: previous.view,
            orthographic: camera.orthographic.into(),
            previous_orthographic: previous.orthographic.into(),
            size: self.size,
            offset,
            previous_offset: self.state.offset,
            tiles_x: self.block().tiles_x(),
            frame: self.state.frame,
            seed: s.seed,
            rays_per_pixel: s.rays_per_pixel,
            pattern: s.resolution as u32,
            sequence: s.sequence as u32,
            reach: s.attenuation().visible_reach() as f32,
            falloff_log2: s.attenuation().falloff_log2() as f32,
            most_samples: s.most_samples() as f32,
            depth_tolerance: DEPTH_TOLERANCE,
            normal_tolerance: NORMAL_TOLERANCE,
            still: still.into(),
            has_history: self.state.has_history.into(),
            rest: (s.rest && still && self.state.has_history && !s.converges()).into(),
            surface: resources.address(Resource::Surface),
            normals: resources.address(Resource::Normals),
            axes: resources.address(Resource::Axes),
            guide: resources.address(Resource::Guide),
            previous_guide: resources.previous_address(Resource::Guide),
            previous_history: resources.previous_address(Resource::History),
            previous_position: resources.address(Resource::PreviousPosition),
        }
    }
}

/// Where the samples of a frame lie in their pixels: offset from the centre, pixels; evenly distributed over any number of consecutive frames (Roberts, "The
/// Unreasonable Effectiveness of Quasirandom Sequences", 2018).
fn sample_offset(frame: u32) -> [f32; 2] {
    // powers of the inverse of the plastic number
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step: f64| ((0.5 + f64::from(frame) * step).fract() - 0.5) as f32)
}

/// Returns true if a camera has turned, moved or zoomed by more than a camera in motion does from frame to frame: by an eighth of the view, or of the length of occlusion rays.
fn is_jump(before: &CameraRecord, now: &CameraRecord, reach: f64) -> bool {
    const PART: f64 = 0.125;
    let change = |column: usize| {
        let squares =
            (0..3).map(|row| f64::from(now.camera_to_world[row][column] - before.camera_to_world[row][column]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    // half angles are about their tangents
    let view = if now.orthographic { 1.0 } else { 2.0 * f64::from(now.view[1]).min(1.0) };
    let has_turned = (0..3).any(|axis| change(axis) > PART * view);
    let zoom = f64::from(now.view[1] / before.view[1]);
    has_turned || change(3) > PART * reach || now.orthographic != before.orthographic || !(0.5..2.0).contains(&zoom)
}

/// One of how many pixels tells what of an image is known: a number that has no divisor in common with the width, so that they are in all columns.
fn sample_stride(size: [u32; 2]) -> u32 {
    let least = (size[0] * size[1] / KNOWN_PIXELS).max(1);
    (least..).find(|stride| gcd(*stride, size[0]) == 1).unwrap_or(1)
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// World to camera, from camera to world.
pub(super) fn inverse(camera: &CameraRecord) -> [[f32; 4]; 3] {
    rows(&to_world(camera).inverse())
}

/// From the space of one camera to that of another.
fn between(from: &CameraRecord, to: &CameraRecord) -> [[f32; 4]; 3] {
    rows(&(to_world(to).inverse() * to_world(from)))
}

fn to_world(camera: &CameraRecord) -> DAffine3 {
    let m = camera.camera_to_world.map(|row| row.map(f64::from));
    let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}
