//! A view: one image of the scene in progress, of frames in real time or of a still that converges.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;

use super::{Interactive, TracedScene};
use crate::accel::features::Blend;
use crate::colour::{srgb_byte, srgb_decode};
use crate::error::{Error, Result};
use crate::files;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::state::FilmState;
use crate::film::tile_mask::TileMask;
use crate::film::{Control, Film, SampleSettings};
use crate::gpu::Timing;
use crate::integrators::aov::{self, Aov};
use crate::integrators::{Integrator, RenderJob};
use crate::output::{self, Channel, FileSettings, Image, Picture, picture, png};
use crate::realtime::display::DisplayMode;
use crate::realtime::{FrameStats, Realtime, Technique};
use crate::renderer::frames::{
    colour_channels, frame_display, frame_needs, frame_path_options, frame_settings, frame_streams,
    is_ambient_occlusion, pipeline, settling_frames,
};
use crate::renderer::settings::CameraSettings;
use crate::renderer::shell::quoted;
use crate::renderer::still::camera_text;
use crate::renderer::{RenderSettings, camera_numbers};
use crate::scene::camera::ViewHeight;
use crate::scene::{Camera, ClipPlanes, Projection, Scene};
use crate::tracer::MovedBounds;

/// Rays of a launch of frames that may be interrupted, on CPU drivers: some hundredths of a second.
const CPU_LAUNCH_RAYS: u32 = 1 << 17;
/// Samples per pixel at which a still counts as finished.
const MAX_SPP: u32 = 1 << 20;
/// Side of the squares behind a transparent image, pixels, and their greys, sRGB.
const CHECKER: usize = 12;
const CHECKERS: [u8; 2] = [96, 128];

/// An image of the scene in progress.
pub struct View {
    settings: RenderSettings,
    size: [u32; 2],
    camera: Option<Camera>,
    /// Number of the traced scene, to find it again, and of the pose that the image shows.
    scene_number: u32,
    pose: u64,
    kind: Kind,
}

enum Kind {
    Frames(Box<FramesView>),
    Still(Box<StillView>),
}

/// Frames in real time.
struct FramesView {
    realtime: Realtime,
    shown: DisplayMode,
    /// Frames since camera and scene last moved.
    resting: u32,
    /// Number of those after which the image no longer changes.
    settling: u32,
    /// The last step was interrupted: at rest the image starts anew.
    was_interrupted: bool,
}

/// A still that converges.
struct StillView {
    integrator: &'static dyn Integrator,
    tile_mask: Option<Option<Arc<TileMask>>>,
    state: Option<Arc<FilmState>>,
    film: Film,
}

/// Statistics of a step of a view.
#[derive(Clone, Debug, Default)]
pub struct ViewStep {
    /// Device seconds of passes, in order.
    pub timings: Vec<Timing>,
    /// Rays traced: camera rays, and all others as far as they are known.
    pub rays: [u64; 2],
    /// Samples per pixel so far: as [`View::samples`].
    pub samples: u32,
    /// More steps do not change the image.
    pub is_settled: bool,
    /// Mean and maximum of BVH nodes visited per camera ray, if they are shown.
    pub nodes: Option<(f64, u32)>,
}

/// An image to show: 8-bit sRGB, RGBA with alpha 255, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewPicture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Four bytes per pixel.
    pub rgba: Vec<u8>,
}

impl ViewPicture {
    /// Writes a picture file, in the format of its extension.
    ///
    /// # Errors
    /// [`Error::Usage`] for a format that is no picture, [`Error::Output`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        Picture::of_bytes(rgb, self.size, png::Colour::Rgb)?.save(path, FileSettings::default().jpeg_quality())
    }
}

/// The linear values of a view, to be compared with those of another one.
#[derive(Clone, Debug, Default)]
pub struct ViewValues {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// 1 (ambient visibility) or 3 (linear RGB).
    pub channels: usize,
    /// Values, channels interleaved, rows from the top.
    pub values: Vec<f32>,
    /// 1 where a pixel shows the scene, 0 for background.
    pub coverage: Vec<f32>,
    /// Variance of each value, estimated from the samples; `None` where a filter has mixed pixels.
    pub variance: Option<Vec<f32>>,
}

impl View {
    /// Creates a view of `size` pixels: frames if the settings select them, else a still.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings without effect together; those of the device and of `control`.
    pub fn new(
        session: &mut Interactive,
        settings: &RenderSettings,
        size: [u32; 2],
        control: &mut dyn Control,
    ) -> Result<Self> {
        settings.check()?;
        output::check_size(size[0], size[1])?;
        let is_frames = settings.realtime_setting().is_some();
        let (scene_number, kind) = if is_frames {
            Self::new_frames(session, settings, size, control)?
        } else {
            Self::new_still(session, settings, control)?
        };
        Ok(Self { settings: settings.clone(), size, camera: None, scene_number, pose: 0, kind })
    }

    fn new_frames(
        session: &mut Interactive,
        settings: &RenderSettings,
        size: [u32; 2],
        control: &mut dyn Control,
    ) -> Result<(u32, Kind)> {
        let mut realtime_settings = frame_settings(settings)?;
        if session.device.info.is_cpu() {
            realtime_settings.launch_rays = CPU_LAUNCH_RAYS;
        }
        let integrator = settings.integrator();
        let blend = if is_ambient_occlusion(integrator) { Blend::Masked } else { integrator.get().blend() };
        let streams = frame_streams(settings, &realtime_settings);
        let index = session.traced_scene(blend, frame_needs(settings, &realtime_settings), streams, control)?;
        let traced = &session.traced[index];
        // which one makes no difference: lenses are for stills
        let any_camera = Camera::framing(DVec3::NEG_ONE, DVec3::ONE, 1.0);
        let options = frame_path_options(settings, session.scene, &any_camera, size, &realtime_settings)?;
        let mut realtime = pipeline(&traced.tracer, &traced.flat, size, &realtime_settings, options.as_ref())?;
        let display = frame_display(settings, session.scene);
        let shown = display.shown;
        realtime.display(&traced.tracer, Some(display))?;
        let settling = settling_frames(&realtime);
        let view = FramesView { realtime, shown, resting: 0, settling, was_interrupted: false };
        Ok((traced.number, Kind::Frames(Box::new(view))))
    }

    fn new_still(
        session: &mut Interactive,
        settings: &RenderSettings,
        control: &mut dyn Control,
    ) -> Result<(u32, Kind)> {
        let integrator = settings.integrator().get();
        let (needs, streams) = (integrator.needs(&settings.integrators), integrator.streams(&settings.integrators));
        let index = session.traced_scene(integrator.blend(), needs, streams, control)?;
        let view = StillView { integrator, tile_mask: None, state: None, film: Film::default() };
        Ok((session.traced[index].number, Kind::Still(Box::new(view))))
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Width over height.
    fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }

    /// Samples per pixel so far: a still's minimum; of frames those at rest, or of a history.
    pub fn samples(&self) -> u32 {
        match &self.kind {
            Kind::Frames(view) => view.realtime.shown_samples(),
            Kind::Still(view) => view.film.samples.iter().copied().min().unwrap_or(0),
        }
    }

    /// Returns true for frames, which keep their histories in motion; a still starts anew.
    pub fn is_realtime(&self) -> bool {
        matches!(self.kind, Kind::Frames(_))
    }

    /// Returns true if the session has replaced its tracer: it must be created anew.
    pub fn is_stale(&self, session: &Interactive) -> bool {
        session.find_traced(self.scene_number).is_none()
    }

    /// Has a view of frames continue those of another one of the same settings, and mostly of
    /// another size; with `keeps_own` only if it has not seen most of what that shows
    /// ([`Realtime::continue_from`]). Stills are left as they are.
    ///
    /// # Errors
    /// Those of the device.
    pub fn continue_from(&mut self, session: &Interactive, other: &Self, keeps_own: bool) -> Result<()> {
        let traced = session.find_traced(self.scene_number).filter(|traced| traced.number == other.scene_number);
        if let (Some(traced), Kind::Frames(ours), Kind::Frames(theirs)) = (traced, &mut self.kind, &other.kind)
            && ours.realtime.continue_from(&traced.tracer, &theirs.realtime, keeps_own)?
        {
            (self.camera, self.pose) = (other.camera.clone(), other.pose);
            ours.was_interrupted = true;
        }
        Ok(())
    }

    /// Discards what it knows of earlier frames.
    pub fn reset(&mut self) {
        match &mut self.kind {
            Kind::Frames(view) => {
                view.realtime.rewind();
                view.resting = 0;
            }
            Kind::Still(view) => view.restart(),
        }
    }

    /// Renders the next step: a frame, or samples of a still for about `time`, at least one of each
    /// pixel. After an interruption a still starts anew, a frame does not
    /// ([`Realtime::frame_with`]).
    ///
    /// # Errors
    /// Those of the device and of `control`, usually [`Error::Interrupted`].
    pub fn step(
        &mut self,
        session: &Interactive,
        camera: &Camera,
        time: Duration,
        control: &mut dyn Control,
    ) -> Result<ViewStep> {
        // whether the camera or the scene has moved
        let gone = || Error::Usage("the view's scene is no longer loaded".into());
        let traced = session.find_traced(self.scene_number).ok_or_else(gone)?;
        let has_moved = self.pose != traced.pose;
        let rests = self.camera.as_ref() == Some(camera) && !has_moved;
        self.camera = Some(camera.clone());
        self.pose = traced.pose;
        let aspect = self.aspect();

        // a frame, or samples of a still
        match &mut self.kind {
            Kind::Frames(view) => {
                let record = CameraRecord::new(camera, traced.flat.origin, aspect);
                let moved = if has_moved { &traced.moved[..] } else { &[] };
                if has_moved {
                    view.realtime.change_materials(traced.materials);
                }
                view.resting = if rests && !view.was_interrupted { view.resting.saturating_add(1) } else { 0 };
                let step = view.step(traced, &record, moved, control);
                view.was_interrupted = step.is_err();
                step
            }
            Kind::Still(view) => {
                if !rests {
                    view.restart();
                }
                let mut job = self.settings.job(session.scene, camera);
                job.samples = SampleSettings {
                    size: self.size,
                    spp: MAX_SPP,
                    time_limit: Some(time),
                    film: FilmOptions { start: view.state.clone(), keep_state: true, ..Default::default() },
                    ..job.samples
                };
                view.step(traced, job, control)
            }
        }
    }

    /// The image as it is after the last step; `None` before the first.
    ///
    /// # Errors
    /// Those of the device.
    pub fn picture(&self) -> Result<Option<ViewPicture>> {
        if self.camera.is_none() {
            return Ok(None);
        }
        let [width, height] = self.size;
        let background = self.settings.backdrop().of_pictures();
        let picture = match &self.kind {
            Kind::Frames(view) => {
                let Some(buffer) = view.realtime.displayed() else { return Ok(None) };
                let rgba = buffer.read(0, 4 * u64::from(width) * u64::from(height))?;
                let Some(background) = background else { return Ok(Some(ViewPicture { size: self.size, rgba })) };
                let rgb = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
                Picture::of_bytes(rgb, self.size, png::Colour::Rgb)?.on(background, &view.realtime.coverage()?)?
            }
            Kind::Still(view) if view.state.is_none() => return Ok(None),
            Kind::Still(view) => {
                let (image, options) = (view.image(self.size), self.settings.picture.options());
                if background.is_none() {
                    let shown = view.integrator.picture(&image, &options);
                    let (bytes, colour) = png::bytes_of(&shown, 0.0, Path::new("view"))?;
                    Picture::of_bytes(bytes, self.size, colour)?
                } else {
                    let mut shown = view.integrator.picture(&picture::unassociated(&image), &options);
                    shown.channels.retain(|c| c.name != "A");
                    shown.channels.extend(image.channels.into_iter().filter(|c| c.name == "A"));
                    Picture::new(&shown, background, &FileSettings::default(), Path::new("view"))?
                }
            }
        };
        Ok(Some(ViewPicture { size: self.size, rgba: opaque(&picture) }))
    }

    /// The values of the image after the last step.
    ///
    /// # Errors
    /// Those of the device.
    pub fn values(&self) -> Result<ViewValues> {
        let size = self.size;
        Ok(match &self.kind {
            Kind::Frames(view) => {
                let realtime = &view.realtime;
                let is_filtered = realtime.settings().filter.kind != crate::realtime::FilterKind::None
                    || realtime.settings().technique != Technique::Traced
                    || realtime.is_radiance();
                ViewValues {
                    size,
                    channels: realtime.channels(),
                    values: realtime.result()?,
                    coverage: realtime.coverage()?,
                    variance: if is_filtered { None } else { Some(realtime.variances()?) },
                }
            }
            Kind::Still(view) => {
                let film = &view.film;
                let channels = film.channels.max(1);
                let of_mean = |(k, v): (usize, &f32)| v / film.samples[k / channels].max(1) as f32;
                ViewValues {
                    size,
                    channels,
                    values: film.mean.clone(),
                    coverage: film.coverage.iter().map(|c| if *c > 0.0 { 1.0 } else { 0.0 }).collect(),
                    variance: Some(film.variance.iter().enumerate().map(of_mean).collect()),
                }
            }
        })
    }

    /// The image with all channels, as files hold it.
    ///
    /// # Errors
    /// Those of the device and of `control`.
    pub fn image(&self, session: &Interactive, control: &mut dyn Control) -> Result<Image> {
        let mut image = match &self.kind {
            Kind::Frames(view) => {
                let realtime = &view.realtime;
                let mut channels = colour_channels(realtime)?;
                channels.push(Channel::from_floats("A", realtime.coverage()?));
                channels.push(Channel::from_floats("samples", realtime.samples()?));
                Image { width: self.size[0], height: self.size[1], channels, metadata: Vec::new() }
            }
            Kind::Still(view) => view.image(self.size),
        };
        if let (Some(traced), Some(camera)) = (session.find_traced(self.scene_number), &self.camera) {
            let (aspect, origin) = (self.aspect(), traced.flat.origin);
            let record = CameraRecord::new(camera, origin, aspect);
            let wanted = [Aov::Depth, Aov::Position, Aov::Ng, Aov::Ids];
            let pixels = aov::render(&traced.tracer, &record, self.size, control)?;
            image.channels.extend(aov::channels(&wanted, &pixels, origin));
            let name = files::portable_name(session.name);
            let mut settings = self.settings.clone();
            settings.scene.material = session.edits.clone();
            let flags = render_flags(&name, session.scene, &settings, camera, self.size);
            image.metadata = camera_numbers::metadata(camera, aspect).map(|(k, v)| (k.to_owned(), v)).to_vec();
            image.metadata.extend([
                ("camera".into(), camera_text(camera)),
                ("command".into(), flags),
                ("scene".into(), name),
                ("version".into(), env!("CARGO_PKG_VERSION").into()),
            ]);
        }
        Ok(image)
    }
}

/// The picture as RGBA with alpha 255; what it leaves open shows a checkerboard.
fn opaque(picture: &Picture) -> Vec<u8> {
    let (channels, width) = (picture.colour.channels(), picture.width as usize);
    let pixel = |(k, p): (usize, &[u8])| {
        let (rgb, alpha) = match *p {
            [grey] => ([grey; 3], 255),
            [grey, alpha] => ([grey; 3], alpha),
            [r, g, b] => ([r, g, b], 255),
            [r, g, b, alpha, ..] => ([r, g, b], alpha),
            [] => ([0; 3], 255),
        };
        let is_light = (k % width / CHECKER + k / width / CHECKER).is_multiple_of(2);
        let behind = srgb_decode(f32::from(CHECKERS[usize::from(is_light)]) / 255.0);
        let share = f32::from(alpha) / 255.0;
        let over = |c: u8| match alpha {
            255 => c,
            _ => srgb_byte(srgb_decode(f32::from(c) / 255.0) * share + behind * (1.0 - share)),
        };
        [over(rgb[0]), over(rgb[1]), over(rgb[2]), 255]
    };
    picture.bytes.chunks_exact(channels).enumerate().flat_map(pixel).collect()
}

impl FramesView {
    fn step(
        &mut self,
        traced: &TracedScene,
        camera: &CameraRecord,
        moved: &[MovedBounds],
        control: &mut dyn Control,
    ) -> Result<ViewStep> {
        if let Some(posed) = &traced.posed {
            self.realtime.move_lights(&traced.tracer, posed)?;
        }
        let FrameStats { timings, primary_rays, occlusion_rays, nodes, .. } =
            self.realtime.frame_with(&traced.tracer, camera, moved, Some(control))?;
        Ok(ViewStep {
            timings,
            rays: [primary_rays, occlusion_rays],
            samples: self.realtime.shown_samples(),
            is_settled: self.resting >= self.settling,
            nodes: nodes.filter(|_| self.shown == DisplayMode::Nodes).map(|n| (n.mean, n.max)),
        })
    }
}

impl StillView {
    fn restart(&mut self) {
        (self.state, self.tile_mask) = (None, None);
    }

    fn step(&mut self, traced: &TracedScene, mut job: RenderJob, control: &mut dyn Control) -> Result<ViewStep> {
        let record = job.camera_record(&traced.flat);
        let make = || job.tile_mask(self.integrator, &traced.flat, &record);
        job.samples.tile_mask = self.tile_mask.get_or_insert_with(make).clone();
        let rendered = match self.integrator.render(&traced.tracer, &traced.posed(), &job, control) {
            Ok(rendered) => rendered.image,
            Err(e) => {
                self.restart();
                return Err(e);
            }
        };
        (self.film, self.state) = (rendered.film, rendered.state.map(Arc::new));
        Ok(ViewStep {
            timings: rendered.device_seconds.iter().map(|&(label, seconds)| Timing { label, seconds }).collect(),
            rays: [rendered.primary_rays, 0],
            samples: rendered.spp,
            is_settled: rendered.spp >= MAX_SPP,
            nodes: None,
        })
    }

    fn image(&self, size: [u32; 2]) -> Image {
        let names = self.integrator.channels();
        let plane = |(c, name): (usize, &&str)| Channel::from_floats(*name, self.film.plane(c));
        let mut channels: Vec<_> = names.iter().enumerate().map(plane).collect();
        channels.push(Channel::from_floats("A", self.film.coverage.clone()));
        Image { width: size[0], height: size[1], channels, metadata: Vec::new() }
    }
}

/// The command that renders what a view shows: `skylit render SCENE ...`, quoted for a shell.
pub fn render_flags(name: &str, scene: &Scene, settings: &RenderSettings, camera: &Camera, size: [u32; 2]) -> String {
    let mut settings = settings.clone();
    settings.image.size = Some(size);
    settings.camera = camera_settings(&scene.cameras, camera);
    render_command(name, &scene.report.options, &settings)
}

/// The command that renders a scene with these settings: `skylit render ...`, quoted for a shell.
/// `load`: the options of loading it ([`crate::scene::load::LoadOptions::flags`]).
pub fn render_command(name: &str, load: &[String], settings: &RenderSettings) -> String {
    let output = format!("{}.png", settings.integrator().name());
    let words = ["skylit".into(), "render".into(), name.to_owned(), "-o".into(), output];
    words
        .into_iter()
        .chain(load.iter().cloned())
        .chain(settings.flags())
        .map(|w| quoted(&w))
        .collect::<Vec<_>>()
        .join(" ")
}

/// The settings that choose this camera: the name of one of the file's, or position, target, up
/// vector and field of view or height.
pub fn camera_settings(cameras: &[Camera], camera: &Camera) -> CameraSettings {
    if let Some(index) = cameras.iter().position(|c| c == camera) {
        return CameraSettings { camera: Some(index.to_string()), ..Default::default() };
    }
    camera_placement(camera)
}

/// Position, target, up vector and field of view or height of a camera.
pub fn camera_placement(camera: &Camera) -> CameraSettings {
    let to_world = &camera.camera_to_world;
    let (fov_y, orthographic) = match camera.projection {
        Projection::Perspective { fov_y } => (Some(fov_y.to_degrees()), None),
        Projection::Orthographic { half_height } => (None, Some(ViewHeight::Units(2.0 * half_height))),
    };
    let (eye, forward) = (to_world.translation, -to_world.matrix3.z_axis);
    // far enough for the direction to survive the sum
    let distance = eye.abs().max_element().max(1.0);
    CameraSettings {
        camera: None,
        view: None,
        eye: Some(eye),
        target: Some(eye + forward * distance),
        up: Some(to_world.matrix3.y_axis),
        fov_y,
        orthographic,
        clip: Some(camera.clip).filter(|clip| *clip != ClipPlanes::NONE),
    }
}
