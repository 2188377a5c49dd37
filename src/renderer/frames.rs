//! Real-time frames: one image after another, with temporal accumulation.

use std::time::Instant;

use super::brightness;
use super::complete::{CHOSEN, Completed, SCENE_OPTIONS};
use super::laps::{self, Laps};
use super::report::{FrameReport, FramesReport, Seconds, Setup};
use super::still::{aov_needs, camera_text, spp_text};
use super::{RenderSettings, Renderer, TracerRequest, camera_numbers};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::files;
use crate::film::camera::CameraRecord;
use crate::film::{Control, covered_mean};
use crate::gpu::{Buffer, Device};
use crate::integrators::aov::{self, Aov};
use crate::integrators::path::{PathOptions, PixelFilter};
use crate::integrators::{IntegratorName, PictureOptions};
use crate::output::png::Colour;
use crate::output::{Channel, Image};
use crate::realtime::display::{Display, DisplayMode};
use crate::realtime::frame_settings::{FrameRange, FrameSettings};
use crate::realtime::sequence::{self, CameraMotion, FrameSequence};
use crate::realtime::{Realtime, Settings, Technique};
use crate::scene::camera_path::CameraPath;
use crate::scene::load::load_camera_path;
use crate::scene::{Camera, Ground, LightKind, Orbit, Scene};
use crate::settings::Capability;
use crate::shaders::StreamShaders;
use crate::tracer::{Needs, Tracer};

/// Default frame rate, frames per second.
pub(super) const DEFAULT_FPS: f64 = 30.0;
/// Unit of displayed depths and positions, as a fraction of the scene's diagonal.
pub(super) const UNIT_OF_SCENE: f32 = 0.25;

/// Real-time frames of a scene, rendered one after another ([`Renderer::frames`]).
pub struct Frames<'r> {
    device: &'r Device,
    sequence: FrameSequence<'r>,
    tracer: Tracer,
    realtime: Realtime,
    size: [u32; 2],
    origin: glam::DVec3,
    aov: Vec<Aov>,
    /// Capabilities of the integrator, by which warnings are chosen.
    capabilities: &'static [Capability],
    options: PictureOptions,
    shown: DisplayMode,
    fps: f64,
    range: FrameRange,
    // frames before the first: of one view, then of the sequence
    warm_up: u32,
    lead_in: u32,
    done: u32,
    last_camera: Camera,
    report: FramesReport,
    metadata: Vec<(&'static str, String)>,
    laps: Laps,
}

/// A rendered frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameOutput {
    /// Frame number.
    pub number: u32,
    /// False for frames that are discarded.
    pub kept: bool,
}

impl Renderer {
    /// Prepares the frames of `settings.frames`, after the warm-up. `displays`: convert each frame
    /// to 8 bits ([`Frames::displayed`]).
    ///
    /// # Errors
    /// [`Error::Usage`] for settings that do not fit each other or the scene; those of the device.
    pub fn frames(
        &mut self,
        settings: &RenderSettings,
        displays: bool,
        control: &mut dyn Control,
    ) -> Result<Frames<'_>> {
        // Complete the settings by the scene, if they have an effect together.
        settings.check()?;
        let mut laps = Laps::after_open(self.open_seconds.wall);
        let timeline = &settings.frames;
        frame_settings(settings)?;
        let range = timeline.range();
        let path = timeline.camera_path.as_deref().map(load_camera_path).transpose()?;
        let first_of_path = path.as_ref().map(|path| path.camera_at(f64::from(range.first)));
        let completed = self.complete(settings, first_of_path)?;
        let chosen = completed.options();
        let Completed { camera, settings, choices, .. } = completed;
        laps.lap(laps::SURVEY);
        let realtime_settings = frame_settings(&settings)?;
        let scene = &self.scene;
        let mut warnings = scene.report.all_warnings();
        warnings.iter().for_each(|w| control.warning(w));

        // The motion of camera and scene.
        let size = settings.size(scene);
        let fps = timeline.fps.or(path.as_ref().map(|p| p.fps())).unwrap_or(DEFAULT_FPS);
        let sequence = frame_sequence(scene, timeline, path, &camera, fps)?;

        // The tracer. A single frame is one whose histories are full, not what it converges to.
        let integrator = settings.integrator();
        let is_radiance = !is_ambient_occlusion(integrator);
        let blend = if is_radiance { integrator.get().blend() } else { Blend::Masked };
        let flat = FlatScene::with_motion_and_blend(scene, sequence.motion()?, blend)?;
        let is_cpu = self.device.info.is_cpu();
        let settling = || {
            Realtime::frames_for(&realtime_settings, size, is_radiance, is_cpu, frames_of_history(&realtime_settings))
        };
        let (warm_up, lead_in) = frames_before(timeline, settling);
        let samples = (u64::from(range.end - range.first) + u64::from(warm_up) + u64::from(lead_in))
            .saturating_mul(u64::from(size[0]) * u64::from(size[1]));
        let rays_per_sample = if is_radiance { integrator.get().rays_per_sample() } else { 1 };
        let request = TracerRequest {
            needs: frame_needs(&settings, &realtime_settings),
            streams: frame_streams(&settings, &realtime_settings),
            rays: samples.saturating_mul(1 + u64::from(realtime_settings.rays_per_pixel) * rays_per_sample),
            camera: Some(&camera),
            control: &mut *control,
            warnings: &mut warnings,
        };
        laps.lap("prepare");
        let tracer = request.build(&self.device, self.kind, &flat, self.compute, &self.settings)?;
        laps.lap("build");

        // The pipeline of passes.
        let options = frame_path_options(&settings, scene, &camera, size, &realtime_settings)?;
        let mut realtime = pipeline(&tracer, &flat, size, &realtime_settings, options.as_ref())?;
        if displays {
            realtime.display(&tracer, Some(frame_display(&settings, scene)))?;
        }

        // The report, and metadata of images.
        let report = FramesReport {
            integrator,
            quantity: if is_radiance { integrator.get().quantity() } else { "ambient visibility" },
            setup: Setup::new(self, &tracer, &flat, &camera, (choices, chosen.clone()), &settings.scene, warnings),
            preset: timeline.preset.unwrap_or_default(),
            settings: Settings { catcher: realtime.settings().catcher, ..realtime_settings },
            primary: realtime.settings().primary.unwrap_or_default(),
            primary_reason: realtime.primary_reason().to_owned(),
            frames: Vec::new(),
            mean: 0.0,
            brightness: None,
            seconds: Seconds::default(),
        };
        let metadata = frame_metadata(&report, options.as_ref(), chosen);

        // Keep the pipelines for later calls.
        self.pipelines = self.device.live_pipelines();
        laps.lap("prepare");
        Ok(Frames {
            laps,
            device: &self.device,
            last_camera: camera,
            origin: flat.origin,
            sequence,
            tracer,
            realtime,
            size,
            aov: settings.image.aov.clone(),
            capabilities: integrator.get().capabilities(),
            options: settings.picture.options(),
            shown: timeline.show.unwrap_or_default(),
            fps,
            range,
            warm_up,
            lead_in,
            done: 0,
            report,
            metadata,
        })
    }
}

/// Numbers of frames before the first: those of one view, and those of the sequence. `settling`:
/// how many fill the histories of a single frame.
fn frames_before(timeline: &FrameSettings, settling: impl FnOnce() -> u32) -> (u32, u32) {
    let range = timeline.range();
    // frames of an orbit have no beginning, others begin with frame 0
    let plays = timeline.animation().is_some() && timeline.time.is_none() || timeline.camera_path.is_some();
    let lead_in = timeline.lead_in.unwrap_or(0).min(if plays { range.first } else { u32::MAX });
    let is_single = range.end - range.first == 1 && lead_in == 0;
    (timeline.warm_up.unwrap_or_else(|| if is_single { settling() } else { 0 }), lead_in)
}

impl Frames<'_> {
    /// Number of frames, including those that are discarded.
    pub fn count(&self) -> u32 {
        // no more than numbers of frames can be
        self.discarded().saturating_add(self.range.end - self.range.first)
    }

    /// Number of frames before the first that is kept.
    fn discarded(&self) -> u32 {
        self.warm_up.saturating_add(self.lead_in)
    }

    /// Frame rate, frames per second.
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// Colour type of files without alpha that store what is displayed.
    pub fn colour(&self) -> Colour {
        match self.shown {
            DisplayMode::Result if self.realtime.is_radiance() => Colour::Rgb,
            shown => shown.colour(),
        }
    }

    /// Image size in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Renders the next frame; `None` after the last.
    ///
    /// # Errors
    /// Those of the device.
    pub fn advance(&mut self) -> Result<Option<FrameOutput>> {
        if self.done >= self.count() {
            return Ok(None);
        }
        let number = self.range.first + self.done.saturating_sub(self.discarded());
        let kept = self.done >= self.discarded();
        let ahead = self.discarded().saturating_sub(self.done).min(self.lead_in);
        let start = Instant::now();
        let (camera, update) = self.sequence.frame(f64::from(number) - f64::from(ahead), &mut self.tracer)?;
        self.last_camera = camera;
        if self.sequence.has_cut() {
            self.realtime.rewind();
        }
        self.realtime.change_materials(update.materials);
        if let Some(posed) = self.sequence.posed_lights() {
            self.realtime.move_lights(&self.tracer, posed)?;
        }
        let stats = self.realtime.frame(&self.tracer, &self.camera_record(), &update.moved)?;
        self.tracer.traced(stats.tracing_seconds());
        let (seconds, update_seconds) = (start.elapsed().as_secs_f64(), update.mesh_seconds + update.top_seconds);
        self.report.frames.push(FrameReport { number, kept, seconds, update_seconds, stats });
        self.done += 1;
        if self.done == self.count() {
            let start = Instant::now();
            self.report.mean =
                covered_mean(&self.realtime.result()?, self.realtime.channels(), &self.realtime.coverage()?);
            self.report.brightness =
                brightness::warning(self.report.mean, self.capabilities, f64::from(self.options.exposure));
            self.report.setup.warnings.extend(self.report.brightness.clone());
            self.device.check_validation()?;
            self.device.save_pipeline_cache();
            self.laps.add("film", start.elapsed().as_secs_f64());
        }
        Ok(Some(FrameOutput { number, kept }))
    }

    /// The last frame as an image: `Y` ambient visibility, or `R`, `G`, `B` linear radiance, `A`
    /// coverage, `samples` accumulated in each pixel, and auxiliary outputs.
    ///
    /// # Errors
    /// Those of the device.
    pub fn image(&self, control: &mut dyn Control) -> Result<Image> {
        let realtime = &self.realtime;
        let (coverage, samples) = (realtime.coverage()?, realtime.samples()?);
        let counts = || samples.iter().zip(&coverage).filter(|(_, c)| **c > 0.0).map(|(n, _)| n.ceil() as u32);
        let spp = match (counts().min(), counts().max()) {
            (Some(least), Some(most @ 1..)) => spp_text(least, most),
            // Larsen's pipeline counts none
            _ => self.report.settings.rays_per_pixel.to_string(),
        };
        let mut channels = colour_channels(realtime)?;
        channels.extend([Channel::from_floats("A", coverage), Channel::from_floats("samples", samples)]);
        if self.aov.iter().any(|a| *a != Aov::Bent) {
            let pixels = aov::render(&self.tracer, &self.camera_record(), self.size, control)?;
            channels.extend(aov::channels(&self.aov, &pixels, self.origin));
        }
        if Aov::Bent.is_in(&self.aov) {
            let bent = realtime.bent()?;
            let axis = |(k, name): (usize, &str)| Channel::from_floats(name, bent.iter().map(|b| b[k]).collect());
            channels.extend(["bent.X", "bent.Y", "bent.Z"].into_iter().enumerate().map(axis));
        }
        let number = self.report.frames.last().map_or(self.range.first, |f| f.number);
        let of_frame = [("camera", camera_text(&self.last_camera)), ("frame", number.to_string()), ("spp", spp)];
        let entries = self
            .metadata
            .iter()
            .cloned()
            .chain(of_frame)
            .chain(camera_numbers::metadata(&self.last_camera, self.aspect()));
        let mut metadata: Vec<_> = entries.map(|(k, v)| (k.to_owned(), v)).collect();
        metadata.sort();
        Ok(Image { width: self.size[0], height: self.size[1], channels, metadata })
    }

    /// The linear picture of an image of [`Frames::image`]: radiance is tone mapped.
    pub fn picture(&self, image: &Image) -> Image {
        if !self.realtime.is_radiance() {
            return image.clone();
        }
        let mut shown = self.options.tone_map.apply(image, self.options.exposure);
        shown.channels.extend(image.channels.iter().find(|c| c.name == "A").cloned());
        shown
    }

    /// Coverage of the last frame, rows from the top: the fraction of each pixel that shows the
    /// scene; without antialiasing 1 where its centre does, else 0.
    ///
    /// # Errors
    /// Those of the device.
    pub fn coverage(&self) -> Result<Vec<f32>> {
        self.realtime.coverage()
    }

    /// Width over height.
    fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }

    /// The camera of the last frame, as shaders read it.
    fn camera_record(&self) -> CameraRecord {
        CameraRecord::new(&self.last_camera, self.origin, self.aspect())
    }

    /// The last frame in device memory, 8-bit RGBA, rows from the top; `None` if not displayed.
    pub fn displayed(&self) -> Option<&Buffer> {
        self.realtime.displayed()
    }

    /// The report of the frames.
    pub fn report(self) -> FramesReport {
        let (mut report, mut laps) = (self.report, self.laps);
        let sum = |kept: bool| report.frames.iter().filter(|f| f.kept == kept).map(|f| f.seconds).sum();
        laps.add("warm-up", sum(false));
        laps.add("frames", sum(true));
        report.seconds.parts = laps.into_parts();
        report
    }
}

/// The pipeline's settings that `settings` describe.
///
/// # Errors
/// [`Error::Usage`] for settings that have no effect together.
pub fn frame_settings(settings: &RenderSettings) -> Result<Settings> {
    let is_radiance = !is_ambient_occlusion(settings.integrator());
    let mut out = settings.frames.settings(&settings.integrators.ao, settings.seed())?;
    let shown = settings.frames.show.unwrap_or_default();
    // of buffers each pixel has one place; bent normals are not averaged over several
    let shows_buffers = shown != DisplayMode::Result || Aov::Bent.is_in(&settings.image.aov);
    if settings.frames.antialias.is_none() {
        // without it edges of bright surfaces flicker
        out.antialias = out.history > 1
            && !shows_buffers
            && (is_radiance || settings.frames.preset.unwrap_or_default().antialiases());
    }
    if is_radiance {
        out.check_radiance()?;
        out.rest_rr_depth = settings.integrators.path.rr_depth.unwrap_or(out.rest_rr_depth);
    }
    out.converge |= settings.frames.at_rest.is_none() && (is_radiance || out.antialias);
    out.bent = Aov::Bent.is_in(&settings.image.aov) || shown == DisplayMode::Bent;
    out.check()?;
    shown.check(&out)?;
    if is_radiance {
        shown.check_radiance()?;
    }
    Ok(out)
}

/// The channels of a frame's value: `Y`, or `R`, `G` and `B`.
///
/// # Errors
/// Those of the device.
pub(super) fn colour_channels(realtime: &Realtime) -> Result<Vec<Channel>> {
    let (values, n) = (realtime.result()?, realtime.channels());
    let names: &[&str] = if n == 1 { &["Y"] } else { &["R", "G", "B"] };
    let plane = |c: usize| values.iter().skip(c).step_by(n).copied().collect();
    Ok(names.iter().enumerate().map(|(c, name)| Channel::from_floats(*name, plane(c))).collect())
}

/// Returns true if frames of the integrator are ambient occlusion, and not radiance.
pub fn is_ambient_occlusion(integrator: IntegratorName) -> bool {
    integrator.can(Capability::AmbientVisibility)
}

/// Scene data that frames with these settings need.
pub fn frame_needs(settings: &RenderSettings, realtime_settings: &Settings) -> Needs {
    let integrator = settings.integrator();
    let needs = if is_ambient_occlusion(integrator) {
        Needs { normals: realtime_settings.occlusion.is_about_shading_normals(), ..Default::default() }
    } else {
        integrator.get().needs(&settings.integrators)
    };
    aov_needs(needs, &settings.image.aov)
}

/// Streams that frames with these settings trace, as far as they are known without the scene.
pub fn frame_streams(settings: &RenderSettings, realtime_settings: &Settings) -> Vec<&'static StreamShaders> {
    let integrator = settings.integrator();
    if is_ambient_occlusion(integrator) {
        Realtime::streams(realtime_settings).to_vec()
    } else {
        integrator.get().streams(&settings.integrators)
    }
}

/// Metadata of the images of frames. `options`: those of frames of radiance; `chosen`: options for
/// what was chosen.
fn frame_metadata(
    report: &FramesReport,
    options: Option<&PathOptions>,
    chosen: Option<String>,
) -> Vec<(&'static str, String)> {
    let FramesReport { setup, settings, .. } = report;
    let mut metadata: Vec<_> = match options {
        Some(options) => {
            let text = |(key, text): (&'static str, Option<String>)| text.map(|text| (key, text));
            // samples lie where the frames have them
            options.identity().into_iter().filter_map(text).filter(|m| m.0 != "pixel_filter").collect()
        }
        None => {
            let others = [("sequence", settings.sequence.to_string()), ("technique", settings.technique.to_string())];
            let ground = settings.catcher.map(|_| ("ground", Ground::Catcher.to_string()));
            settings.occlusion.metadata().into_iter().chain(others).chain(ground).collect()
        }
    };
    let filter = if settings.antialias { PixelFilter::Box } else { PixelFilter::Centre };
    metadata.extend([
        ("device", format!("{} ({})", setup.device, setup.driver)),
        ("history", settings.history.to_string()),
        ("integrator", report.integrator.name().into()),
        ("pixel_filter", filter.to_string()),
        ("preset", report.preset.to_string()),
        ("primary", report.primary.to_string()),
        ("rays_per_pixel", settings.rays_per_pixel.to_string()),
        ("resolution", settings.resolution.to_string()),
        ("scene", files::portable_name(&setup.scene)),
        ("seed", settings.seed.to_string()),
        ("tracer", setup.tracer.to_string()),
        ("version", env!("CARGO_PKG_VERSION").into()),
    ]);
    metadata.extend(chosen.map(|options| (CHOSEN, options)));
    metadata.extend(setup.scene_options.clone().map(|options| (SCENE_OPTIONS, options)));
    metadata
}

/// Options of the paths of frames of radiance; `None` for ambient occlusion.
///
/// # Errors
/// [`Error::Usage`] for settings that do not fit the camera.
pub fn frame_path_options(
    settings: &RenderSettings,
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    realtime_settings: &Settings,
) -> Result<Option<PathOptions>> {
    if is_ambient_occlusion(settings.integrator()) {
        return Ok(None);
    }
    let mut job = settings.job(scene, camera);
    (job.samples.size, job.samples.spp) = (size, realtime_settings.rays_per_pixel);
    let options = settings.integrator().get().path_options(&job)?;
    let rr_depth = settings.integrators.path.rr_depth.unwrap_or(settings.frames.preset.unwrap_or_default().rr_depth());
    Ok(options.map(|options| PathOptions { rr_depth, ..options }))
}

/// The pipeline of frames. `paths`: options of the paths of frames of radiance.
///
/// # Errors
/// Those of [`Realtime::new`] and [`Realtime::radiance`].
pub fn pipeline(
    tracer: &Tracer,
    flat: &FlatScene,
    size: [u32; 2],
    realtime_settings: &Settings,
    paths: Option<&PathOptions>,
) -> Result<Realtime> {
    match paths {
        Some(paths) => Realtime::radiance(tracer, flat, size, realtime_settings, paths),
        None => {
            let catcher = flat.scene.catcher().filter(|_| realtime_settings.technique != Technique::Larsen);
            let settings = Settings { catcher, ..*realtime_settings };
            Realtime::new(tracer, size, &settings, &point_lights(flat.scene, flat))
        }
    }
}

/// The display of frames with these settings.
pub(super) fn frame_display(settings: &RenderSettings, scene: &Scene) -> Display {
    let PictureOptions { tone_map, exposure } = settings.picture.options();
    let shown = settings.frames.show.unwrap_or_default();
    Display { shown, exposure, unit: UNIT_OF_SCENE * scene_size(scene) as f32, tone_map }
}

/// Number of frames of a static view after which the image no longer changes.
pub(super) fn settling_frames(realtime: &Realtime) -> u32 {
    realtime.frames_to_rest().unwrap_or_else(|| frames_of_history(realtime.settings()))
}

/// Number of frames after which the histories of a static view are full.
fn frames_of_history(settings: &Settings) -> u32 {
    match settings.technique {
        Technique::Larsen => 4,
        _ => settings.history.min(Settings::MAX_SAMPLES) * settings.resolution.period() - 1,
    }
}

/// Diagonal of the scene's bounds, scene units; 1 for an empty scene.
pub(super) fn scene_size(scene: &Scene) -> f64 {
    scene.bounds().map(|(lo, hi)| (hi - lo).length()).filter(|d| *d > 0.0).unwrap_or(1.0)
}

/// The motion of a camera along a path, or around the scene in so many frames.
///
/// # Errors
/// [`Error::Scene`] for an orbit around a scene without geometry.
pub(super) fn camera_motion(
    scene: &Scene,
    path: Option<CameraPath>,
    orbit_frames: Option<u32>,
) -> Result<CameraMotion> {
    Ok(match (path, orbit_frames) {
        (Some(path), _) => CameraMotion::Path(path),
        (None, Some(frames)) => CameraMotion::Orbit(orbit(scene, f64::from(frames))?),
        (None, None) => CameraMotion::Still,
    })
}

/// Scene and camera over time, as settings of frames have them.
fn frame_sequence<'a>(
    scene: &'a Scene,
    timeline: &FrameSettings,
    path: Option<CameraPath>,
    camera: &Camera,
    fps: f64,
) -> Result<FrameSequence<'a>> {
    let motion = camera_motion(scene, path, timeline.orbit)?;
    let animation = timeline.animation().map(|a| sequence::find_animation(scene, a)).transpose()?;
    let file_camera = scene.cameras.iter().position(|c| c == camera);
    let sequence = FrameSequence::new(scene, camera.clone(), file_camera, motion, animation, fps)?;
    Ok(sequence.held_at(timeline.time))
}

fn orbit(scene: &Scene, frames: f64) -> Result<Orbit> {
    let (lo, hi) =
        scene.bounds().ok_or_else(|| Error::Scene("--orbit: the scene has no geometry to orbit around".into()))?;
    Orbit::vertical((lo + hi) * 0.5, frames)
}

/// Positions of point lights, relative to the tracer's origin.
pub(super) fn point_lights(scene: &Scene, flat: &FlatScene) -> Vec<[f32; 3]> {
    let point = scene.lights.iter().filter(|l| matches!(l.kind, LightKind::Point));
    point.map(|l| (l.position - flat.origin).as_vec3().to_array()).collect()
}
