//! Frames of ambient visibility or radiance, one after the other, in passes (`passes`) over the
//! images of a frame (`resources`).
//!
//! A frame is planned (`plan`), its passes run, and what it leaves behind is committed to the
//! `history`. Which stages of passes there are is the signal's (`signals`). Of ambient visibility
//! `gbuffer` finds the surface at each pixel's centre; `ao_trace` traces occlusion rays of the
//! pixels that are sampled in this frame; `gather` averages the samples of a pixel if there are
//! several; `temporal` adds them to the history of the same surface, reprojected from the previous
//! frame; `filter` averages over neighbours. Passes whose inputs have not changed are skipped
//! (`graph`): while neither the camera nor the scene moves no camera rays are traced, nor occlusion
//! rays of pixels with a full history. At rest, where the image converges, `rest_samples` takes the
//! place of the passes up to `filter` after a few frames.

mod camera_change;
pub mod display;
mod frame_samples;
pub mod frame_settings;
mod graph;
mod history;
pub(super) mod params;
mod passes;
mod plan;
mod readback;
mod resample;
mod resources;
mod seen;
pub mod sequence;
pub mod settings;
mod signals;
pub mod surface_masks;

use glam::DMat3;

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::block::Block;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Timing};
use crate::integrators::path::PathOptions;
use crate::scene::Scene;
use crate::shaders::StreamShaders;
use crate::tracer::{MaterialChange, MovedBounds, Tracer};
use camera_change::between;
pub(super) use camera_change::inverse;
use display::{Display, DisplayMode};
use frame_samples::FrameSamples;
use graph::{Frame, Graph, Params};
use history::History;
use params::{FrameParams, MovedRecord, moved_records};
pub(crate) use passes::nlmeans;
pub use passes::nodes::NodeVisits;
use passes::{debug, debug_view};
use plan::{FramePlan, Inputs, Signal};
pub use readback::Surface;
use resources::Resource;
use seen::SeenSurfaces;
pub use settings::{Filter, FilterKind, GtaoConstants, Preset, Resolution, Settings, Technique};
use signals::Pipeline;
use signals::larsen::Larsen;
use signals::radiance::Radiance;
use signals::visibility::AmbientVisibility;

/// Distance from a tangent plane, in pixel footprints, from which neighbours are other surfaces.
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
    /// Occlusion rays of sampled pixels not traced: background, or a full history at rest.
    pub skipped_rays: u64,
    /// BVH nodes that camera rays visit, if they are displayed ([`DisplayMode::Nodes`]).
    pub nodes: Option<NodeVisits>,
}

impl FrameStats {
    /// Device seconds of passes that trace rays, by which hierarchies are judged.
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
    /// Passes of the display that exist.
    displays: Vec<DisplayPassKind>,
    primary_reason: String,
    signal: &'static dyn Signal,
    history: History,
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
    fn from_mode(shown: DisplayMode) -> Self {
        match shown {
            DisplayMode::Rays => Self::Rays,
            shown if debug_view(shown).is_some() => Self::View(shown),
            _ => Self::Buffer,
        }
    }
}

/// Index of the stage that finds the surfaces in view, of all pipelines.
const SURFACES_STAGE: usize = 0;

/// Share of the surfaces in view that the previous image has shown, below which a frame begins
/// anew: first frames have their samples where they say most.
const MIN_KNOWN: f64 = 1.0 / 3.0;

/// Pixels by which that share is known.
const KNOWN_PIXELS: u32 = 2048;

impl Realtime {
    /// The streams that it traces.
    pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
        AmbientVisibility::streams(settings)
    }

    /// Creates the pipeline for images of `size` pixels of the tracer's scene. `lights` are the
    /// positions of the scene's point lights relative to its origin, for Larsen's pipeline.
    ///
    /// # Errors
    /// [`Error::Usage`] for wrong settings, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Self> {
        settings.check()?;
        let settings = &settings.with_launches_of(&tracer.device().info);
        let pipeline = match settings.technique {
            Technique::Larsen => Larsen::pipeline(tracer, size, settings, lights)?,
            Technique::Traced | Technique::Gtao => AmbientVisibility::pipeline(tracer, size, settings)?,
        };
        Self::from_pipeline(tracer, size, pipeline)
    }

    /// Creates the pipeline for frames of radiance. The tracer must have been built from `flat`
    /// with [`crate::tracer::Needs::shading`]; paths have `options`, but their own number per
    /// pixel.
    ///
    /// # Errors
    /// [`Error::Usage`] for wrong settings, [`Error::OutOfMemory`], and those of compiling shaders.
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
        Self::from_pipeline(tracer, size, Radiance::pipeline(tracer, flat, size, settings, options)?)
    }

    fn from_pipeline(tracer: &Tracer, size: [u32; 2], pipeline: Pipeline) -> Result<Self> {
        let Pipeline { signal, settings, frame_samples, extent, stages, primary_reason } = pipeline;
        let device = tracer.device();
        Ok(Self {
            size,
            settings,
            graph: Graph::new(device, extent, stages)?,
            params: Params::new(device, "frame parameters")?,
            display: None,
            displays: Vec::new(),
            primary_reason,
            signal,
            history: History::default(),
            frame_samples,
            seen: None,
        })
    }

    /// Returns true for frames of radiance.
    pub fn is_radiance(&self) -> bool {
        self.signal.depends_on_light()
    }

    /// Number of values per pixel of [`Realtime::result`]: 1 of ambient visibility, 3 of radiance.
    pub fn channels(&self) -> usize {
        self.signal.channels()
    }

    /// Notes that lights or materials have changed: histories of radiance count in the next frame
    /// as far as its samples do not differ, for eight frames at most.
    pub fn change_light(&mut self) {
        if self.signal.depends_on_light() {
            self.history.change_light();
        }
    }

    /// Notes what of materials has changed ([`crate::tracer::UpdateStats::materials`]): where
    /// surfaces are that are partly transparent, histories are discarded.
    pub fn change_materials(&mut self, change: MaterialChange) {
        match change {
            MaterialChange::None => (),
            MaterialChange::Shading => self.change_light(),
            MaterialChange::Alpha => self.start_at(self.history.frame),
        }
    }

    /// Turns the environment map from the next frame on, which changes light: `to_map` is the
    /// rotation from world directions to the map's ([`crate::scene::EnvironmentMap::to_map`]).
    pub fn turn_environment(&mut self, to_map: DMat3) {
        if self.signal.depends_on_light() {
            self.history.environment_turn = Some(to_map);
            self.history.change_light();
        }
    }

    /// Moves lights and emissive surfaces to where they are in `scene` from the next frame on, and
    /// notes a change of light. `scene` is the tracer's in the pose to which that was updated.
    /// Where nothing has emitted light, and something does, frames begin without a history.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] where lights were switched, which needs other shaders.
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<()> {
        if self.graph.move_lights(tracer, scene)? {
            self.change_light();
        }

        // samples that are black throughout say nothing of light that begins, nor how noisy it is
        let was_black = std::mem::replace(&mut self.history.is_black, scene.is_black());
        if was_black && !self.history.is_black && self.signal.depends_on_light() {
            self.start_at(self.history.frame);
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

    /// Number of frames at rest after which the image no longer changes; `None`: it always does.
    pub fn frames_to_rest(&self) -> Option<u32> {
        self.signal.frames_to_rest(&self.settings, &self.frame_samples)
    }

    /// Number of frames at rest, the one before them not counted, that have as many samples of a
    /// pixel as so many long frames that do not grow: fewer where they do.
    pub fn frames_for(settings: &Settings, size: [u32; 2], is_radiance: bool, is_cpu: bool, frames: u32) -> u32 {
        let signal: &dyn Signal = if is_radiance { &Radiance } else { &AmbientVisibility };
        signal.frame_samples(settings, signals::pixels(size), is_cpu).frames_for_first(frames).min(frames)
    }

    /// Samples of a pixel that the last frame shows: those at rest, or of the longest history.
    pub fn shown_samples(&self) -> u32 {
        let (s, resting) = (&self.settings, self.history.motion.frames_at_rest());
        if s.converges() {
            let since_rest = self.frame_samples.since_rest(resting);
            let period = self.signal.rest_period(s);
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
        self.history.reset();
    }

    /// Discards the history, and restarts the sampler at the first frame.
    pub fn rewind(&mut self) {
        self.start_at(0);
    }

    /// Discards the history, and gives the next frame this number, by which samples are chosen.
    /// After the last number of 32 bits comes 0.
    pub fn start_at(&mut self, frame: u32) {
        self.history.start_at(frame, &self.settings);
    }

    /// Renders the next frame. `moved` is what has moved in the scene since the previous one
    /// ([`crate::tracer::UpdateStats::moved`]).
    ///
    /// # Errors
    /// Those of the device.
    pub fn frame(&mut self, tracer: &Tracer, camera: &CameraRecord, moved: &[MovedBounds]) -> Result<FrameStats> {
        self.frame_with(tracer, camera, moved, None)
    }

    /// Renders the next frame as [`Realtime::frame`] does; `control` is asked between launches
    /// whether to stop. After an interruption the next frame is what it would have been without the
    /// interrupted one, histories included; only samples at rest start anew. Where something had
    /// moved in the scene, with Larsen's pipeline and after other errors there is no history.
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
        let before = self.history.clone();
        let stats = self.try_frame(tracer, camera, &moved_records(moved), control);
        match &stats {
            Ok(_) => {}
            // where the scene was is known of the frame before only
            Err(Error::Interrupted) if moved.is_empty() && self.signal.has_pixel_histories() => {
                self.graph.take_back();
                self.history = before.after_interruption();
            }
            Err(_) => {
                self.graph.invalidate();
                self.history.reset();
            }
        }
        stats
    }

    /// Plans the next frame, runs it, and commits what it leaves behind.
    fn try_frame(
        &mut self,
        tracer: &Tracer,
        camera: &CameraRecord,
        moved: &[MovedRecord],
        mut control: Option<&mut dyn Control>,
    ) -> Result<FrameStats> {
        let settings = self.settings;
        let inputs = Inputs {
            signal: self.signal,
            settings: &settings,
            frame_samples: self.frame_samples,
            camera: *camera,
            has_moved_objects: !moved.is_empty(),
            display: self.display,
        };
        loop {
            let plan = FramePlan::next(&self.history, &inputs);
            if plan.is_skipped {
                let skipped_rays = self.pixels() * u64::from(plan.progress.samples);
                return Ok(FrameStats { skipped_rays, ..Default::default() });
            }
            let between_launches = control.as_mut().map(|c| &mut **c as &mut dyn Control);
            if let Some(timings) = self.run(tracer, &plan, camera, moved, between_launches)? {
                let occlusion_rays = self.graph.rays()?;
                self.history = plan.commit(&self.history, &inputs);
                return self.stats(&plan, timings, occlusion_rays);
            }
            // little is known of what the frame shows: it begins anew, and that is certain then
            self.history.start_at(0, &self.settings);
        }
    }

    /// Runs the stages of a planned frame. Returns the times of its passes, or `None` if the
    /// previous image shows too little of it: then it is taken back.
    fn run(
        &mut self,
        tracer: &Tracer,
        plan: &FramePlan,
        camera: &CameraRecord,
        moved: &[MovedRecord],
        mut control: Option<&mut dyn Control>,
    ) -> Result<Option<Vec<Timing>>> {
        // what has changed decides which stages run
        self.graph.touch(Resource::FrameNumber);
        if plan.has_new_view {
            self.graph.touch(Resource::Camera);
        }
        if plan.has_moved_objects {
            self.graph.touch(Resource::Scene);
        }
        let stages = self.graph.begin(self.display.as_ref(), plan.progress.is_long);
        self.params.write(&self.frame_params(camera, plan.progress.is_still, plan.offset))?;
        let previous = self.history.camera.unwrap_or(*camera);
        let frame = Frame {
            tracer,
            settings: &self.settings,
            block: self.block(),
            camera: *camera,
            moved,
            plan,
            previous_to_camera: between(&previous, camera),
            camera_rests: inverse(&previous) == inverse(camera) && previous.view == camera.view,
            params: self.params.address(),
            display: self.display,
        };

        // surfaces first where the camera may have jumped: histories are of little use then
        let looks_first = stages.first() == Some(&SURFACES_STAGE) && plan.may_be_cut;
        let (surfaces, others) = stages.split_at(usize::from(looks_first));
        let mut timings = Vec::new();
        if looks_first {
            let between_launches = control.as_mut().map(|c| &mut **c as &mut dyn Control);
            timings = self.graph.run(&frame, surfaces, between_launches)?;
            let seen = match &mut self.seen {
                Some(seen) => seen,
                none => none.insert(SeenSurfaces::new(tracer)?),
            };
            let pixels = self.size[0] * self.size[1];
            if seen.share(frame.params, pixels, sample_stride(self.size))? < MIN_KNOWN {
                self.graph.take_back();
                return Ok(None);
            }
        }

        // all that follows
        timings.extend(self.graph.run(&frame, others, control)?);
        self.graph.finish();
        tracer.check_finished()?;
        Ok(Some(timings))
    }

    /// Returns the work and the timings of a frame that has been rendered as planned.
    fn stats(&self, plan: &FramePlan, timings: Vec<Timing>, occlusion_rays: u64) -> Result<FrameStats> {
        let (pixels, samples) = (self.pixels(), plan.progress.samples);
        let all = pixels * u64::from(samples) / u64::from(self.signal.period(plan, &self.settings));
        let has_known_hits = self.graph.resources().buffer(Resource::KnownHits).is_some();
        let shows_nodes = self.display.is_some_and(|d| d.shown == DisplayMode::Nodes);
        Ok(FrameStats {
            timings,
            samples,
            primary_rays: self.signal.camera_rays(plan, &self.settings, pixels, has_known_hits),
            occlusion_rays,
            skipped_rays: all.saturating_sub(occlusion_rays),
            nodes: shows_nodes.then(|| NodeVisits::read(self.graph.resources(), pixels)).transpose()?,
        })
    }

    /// Sets the buffer that the next frames write to [`Realtime::displayed`]; `None`: none. It may
    /// change before every frame: the first call compiles the pass, later ones write parameters.
    /// The first one with [`DisplayMode::Rays`] discards the history.
    ///
    /// # Errors
    /// [`Error::Usage`] for a buffer that does not exist, and those of compiling the shader.
    pub fn display(&mut self, tracer: &Tracer, display: Option<Display>) -> Result<()> {
        if let Some(display) = &display {
            self.signal.check_display(display.shown, &self.settings)?;
            let view = debug_view(display.shown);
            let kind = DisplayPassKind::from_mode(display.shown);
            if !self.displays.contains(&kind) {
                let stage = match view {
                    Some((view, shader)) => debug::stage(tracer, self.block(), display.shown, view, shader)?,
                    None => passes::display::stage(tracer, self.pixels() as u32, kind == DisplayPassKind::Rays)?,
                };
                if !self.graph.extend(tracer.device(), vec![stage])? {
                    self.history.reset();
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

    /// The displayed image of the last frame, in device memory: 8-bit RGBA with alpha 255, rows
    /// from the top. `None` before the first call of [`Realtime::display`].
    pub fn displayed(&self) -> Option<&Buffer> {
        self.graph.resources().buffer(Resource::DisplayImage)
    }

    fn pixels(&self) -> u64 {
        signals::pixels(self.size)
    }

    fn block(&self) -> Block {
        Block { origin: [0, 0], size: self.size }
    }

    /// Returns the parameters that all passes share.
    fn frame_params(&self, camera: &CameraRecord, still: bool, offset: [f32; 2]) -> FrameParams {
        let (s, resources) = (&self.settings, self.graph.resources());
        let previous = self.history.camera.unwrap_or(*camera);
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
            previous_offset: self.history.offset,
            tiles_x: self.block().tiles_x(),
            frame: self.history.frame,
            seed: s.seed,
            rays_per_pixel: s.rays_per_pixel,
            pattern: s.resolution as u32,
            sequence: s.sequence as u32,
            reach: s.occlusion.visible_reach() as f32,
            falloff_log2: s.occlusion.falloff_log2() as f32,
            most_samples: s.most_samples() as f32,
            depth_tolerance: DEPTH_TOLERANCE,
            normal_tolerance: NORMAL_TOLERANCE,
            still: still.into(),
            has_history: self.history.has_history.into(),
            rest: (s.rest && still && self.history.has_history && !s.converges()).into(),
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

/// One of how many pixels tells what of an image is known: a number that has no divisor in common
/// with the width, so that they are in all columns.
fn sample_stride(size: [u32; 2]) -> u32 {
    let least = (size[0] * size[1] / KNOWN_PIXELS).max(1);
    (least..).find(|stride| gcd(*stride, size[0]) == 1).unwrap_or(1)
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}
