//! The state of the viewer, and how events of the renderer and input of the user change it.
//! `panels/` show it.

use std::collections::VecDeque;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use super::bake_preview::{BakePreview, quick};
use super::baking::{BakePlace, BakeWanted, BakedMap, BakedModel};
use super::browse::Browsing;
use super::camera::CameraControl;
use super::dialog::{Dialog, RenderWanted, RenderedMotion};
use super::file_kind::FileKind;
use super::hiding::{self, HiddenObjects, NamedObjects};
use super::hierarchy::{FoundHierarchy, HierarchyKey, HierarchyState};
use super::layer::Layer;
use super::options::{CPU_FRAME_RATE, ViewOptions};
use super::remembered::{Hint, Remembered};
use super::renders::Render;
use super::request::{
    Comparison, DeviceSummary, Event, Mailbox, Outline, PickPurpose, Progress, Request, SceneSummary, TRUTH, Task,
};
use super::rounding::round_length;
use super::scene_list::{SceneList, Selection};
use super::technique::Technique;
use crate::error::{Error, Result};
use crate::integrators::IntegratorName;
use crate::integrators::lighting::LightingSettings;
use crate::interface::PixelFilter;
use crate::realtime::Preset;
use crate::realtime::frame_settings::{Antialias, FrameRange};
use crate::renderer::RenderSettings;
use crate::renderer::frames::frame_settings;
use crate::renderer::interactive::{Pick, ViewPicture, camera_placement, camera_settings, render_command};
use crate::renderer::settings::{CameraSettings, ImageSettings};
use crate::renderer::survey::rays::camera_ray;
use crate::scene::Camera;
use crate::scene::load::{GeometryOptions, LoadOptions};
use crate::scene::material_edit::MaterialEdit;
use crate::scene::settings::variant_index;
use crate::settings::{Capability, Length};
use crate::tracer::DeviceSettings;

/// Frames whose times are kept for the plot and the figures.
const KEPT_FRAMES: usize = 120;
/// Messages that are kept.
const KEPT_MESSAGES: usize = 100;
/// Time for which a new message is shown over the image.
const MESSAGE_TIME: Duration = Duration::from_secs(8);

/// Samples per pixel of stills that are rendered, unless the settings say otherwise.
const STILL_SPP: u32 = 64;
/// Frames of a turntable that is rendered.
const TURNTABLE_FRAMES: u32 = 120;
/// Frames before those of a turntable, in which histories become those of a moving camera.
const TURNTABLE_LEAD_IN: u32 = 30;
/// Frames per second of an animation that is rendered, the default of `skylit render`.
const ANIMATION_FPS: f64 = 30.0;
/// Width and height of a texture that is baked, texels, and samples: the defaults of `skylit bake`.
const BAKE_SIZE: u32 = 1024;
const BAKE_SPP: u32 = 64;
/// Width and height of the picture of its preview, pixels, at most, and samples of a pixel: so many
/// that what is partly transparent has little noise.
const PREVIEW_SIZE: [u32; 2] = [420, 280];
const PREVIEW_SPP: u32 = 64;
/// Offset of the truth's seed from that of the images.
const TRUTH_SEED: u32 = 0x7275_7468;

/// Content of the second image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Second {
    /// An image of its own.
    Technique(Technique),
    /// The truth that the first is compared with.
    Truth,
    /// The difference of the first from the truth.
    HeatMap,
}

/// Where the images are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrangement {
    /// One at a time: the first or the second.
    Single,
    /// Side by side: the first up to this share of the width.
    Split(f32),
}

/// An image on the screen, and how it is made.
#[derive(Clone, Debug, Default)]
pub struct PaneState {
    /// The last picture.
    pub progress: Option<Arc<Progress>>,
    /// Why there is none.
    pub error: Option<String>,
    /// Why it is black, if it is.
    pub black: Option<String>,
}

/// Playback of an animation.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// The animation, an index.
    pub animation: Option<usize>,
    /// Whether it runs.
    pub runs: bool,
    /// Seconds since its start.
    pub time: f64,
    /// Speed: 1 as the file says.
    pub speed: f64,
    /// Whether it starts again at its end.
    pub repeats: bool,
}

impl Playback {
    /// Plays or stops an animation that lasts so many seconds. At its end it starts anew.
    pub fn toggle(&mut self, duration: f64) {
        self.runs = !self.runs;
        if self.runs && self.time >= duration {
            self.time = 0.0;
        }
    }
}

/// The viewer.
pub struct App {
    mailbox: Arc<Mailbox>,
    events: Receiver<Event>,
    sent: Request,
    /// Number of the last request, and of the last one for which nothing is left to do.
    sent_number: u64,
    idle: u64,
    /// The technique of each image in the last request with it, by name, and the number of the
    /// first such request.
    techniques: [(String, u64); TRUTH + 1],
    load: u64,
    /// The load of the scene that is shown.
    loaded: u64,
    /// The scene that is requested.
    pub source: Option<String>,
    /// Scenes that were opened before, the last one first.
    pub recent: Vec<String>,
    /// When the scene's files were looked at, and when they were last modified then.
    modified: Option<(Instant, Vec<Option<std::time::SystemTime>>)>,
    /// Summary of the scene, once it is loaded.
    pub scene: Option<SceneSummary>,
    /// Summary of the device.
    pub device: DeviceSummary,
    /// Settings of device and tracer.
    pub device_settings: DeviceSettings,
    /// Settings of all images, of which each takes those that apply to it.
    pub settings: RenderSettings,
    /// Lights beside the scene's.
    pub lighting: LightingSettings,
    /// Technique that the first image shows.
    pub first: Technique,
    /// Content of the second image.
    pub second: Second,
    /// Truth that first images of an integrator are compared with, if it was chosen; else see
    /// [`Technique::truth`].
    chosen_truth: Option<(IntegratorName, Technique)>,
    /// Whether it is compared.
    pub compares: bool,
    /// Where the images are.
    pub arrangement: Arrangement,
    /// The second image is shown, where one is at a time.
    pub shows_second: bool,
    /// The images: first, second, truth.
    pub panes: [PaneState; 3],
    /// The last comparison, of what is requested now.
    pub comparison: Option<Box<Comparison>>,
    /// The first request whose images it may be of.
    comparable: u64,
    /// The first request of the first image whose times are among the figures.
    measured: u64,
    /// The camera, once the scene is loaded.
    pub control: Option<CameraControl>,
    /// Index of the file's camera that is followed while an animation moves it.
    pub followed: Option<usize>,
    /// Cameras that the user has kept, and what they saw.
    pub bookmarks: Vec<(String, Camera, Option<egui::TextureHandle>)>,
    /// Speed of the turntable, radians per second; 0 at rest.
    pub turntable: f64,
    /// Frame rate to hold; `None`: full resolution always.
    pub frame_rate: Option<f64>,
    /// Whether rendering is paused.
    pub is_paused: bool,
    /// The animation.
    pub playback: Playback,
    /// The object or node that is selected.
    pub selected: Option<Selection>,
    /// The list of objects.
    pub list: SceneList,
    /// The objects that settings leave out, as long as they and the scene stay.
    hidden: Option<HiddenObjects>,
    /// Outline of what is selected, of the last view at rest.
    outline: Option<Arc<Outline>>,
    /// Primitive that was clicked on.
    pub pick: Option<Pick>,
    /// Choices of what is drawn of the hierarchy, and its boxes.
    pub hierarchy: HierarchyState,
    /// Text that says what is being loaded, and the share that is done.
    pub loading: Option<(String, Option<f32>)>,
    /// Names of the Vulkan devices, by index.
    pub devices: Vec<String>,
    /// Why there are no images.
    pub failure: Option<String>,
    /// Why scenes could not be loaded, the last one last.
    pub load_failures: Vec<String>,
    /// Messages, the last one first.
    pub messages: VecDeque<(Instant, String, bool)>,
    /// State that is kept from one time to the next; `None`: nothing is.
    pub remembered: Option<Remembered>,
    /// It has been taken over.
    recalled: bool,
    /// When it was asked how near something is, if there is no answer yet.
    asked_how_near: Option<Instant>,
    /// The open dialog.
    pub dialog: Option<Dialog>,
    /// The system's file dialog, while it is open.
    pub browsing: Option<Browsing>,
    /// Whether help is shown.
    pub shows_help: bool,
    /// Whether the panel at the side is shown.
    pub shows_panel: bool,
    /// Frames of the first image, the last one last.
    pub frames: VecDeque<Arc<Progress>>,
    /// Settings of the command line, or of a file of settings: lengths and places of one scene are
    /// not those of the next.
    given: RenderSettings,
    /// The animation to start with, by index or name, and its time.
    first_animation: Option<(String, f64)>,
    /// Whether the exposure of the scene was decided, and the one that was chosen: once a scene, so
    /// that what is shown does not become brighter and darker by itself.
    exposure: (bool, Option<f64>),
    /// Which scene of a glTF file is shown; none: the one that the file names.
    pub gltf_scene: Option<String>,
    /// Normals and texture coordinates of all scenes that are opened.
    pub geometry: GeometryOptions,
    /// Normals and texture coordinates of the last scene that was opened.
    opened_geometry: GeometryOptions,
    /// Text to be put on the clipboard.
    pub copied: Option<String>,
    /// The window is to be closed.
    pub closes: bool,
    default_frame_rate: f64,
    last_load: u64,
    tasks: Vec<Task>,
    size: [u32; 2],
    layers: Vec<Layer>,
    pub renders: Vec<Render>,
    /// The preview of the dialog *Bake*.
    pub bake_preview: Option<BakePreview>,
    /// A model that was baked and is being opened.
    baked: Option<BakedModel>,
    /// The program that renders: this one.
    pub program: PathBuf,
}

impl App {
    /// The viewer as it starts.
    pub fn new(options: &ViewOptions, mailbox: Arc<Mailbox>, events: Receiver<Event>) -> Self {
        let mut app = Self {
            mailbox,
            events,
            sent: Request::default(),
            sent_number: 1,
            idle: 0,
            techniques: Default::default(),
            load: 0,
            loaded: 0,
            last_load: 0,
            source: None,
            recent: super::recent::load(),
            modified: None,
            scene: None,
            device: DeviceSummary::default(),
            device_settings: options.device.clone(),
            settings: RenderSettings::default(),
            lighting: LightingSettings::default(),
            first: Technique::Preset(Preset::Balanced),
            second: Second::Truth,
            chosen_truth: None,
            compares: false,
            arrangement: Arrangement::Single,
            shows_second: false,
            panes: Default::default(),
            comparison: None,
            comparable: 0,
            measured: 0,
            control: None,
            followed: None,
            bookmarks: Vec::new(),
            turntable: 0.0,
            frame_rate: options.frame_rate,
            is_paused: false,
            playback: Playback { animation: None, runs: false, time: 0.0, speed: 1.0, repeats: true },
            selected: None,
            list: SceneList::default(),
            hidden: None,
            outline: None,
            pick: None,
            hierarchy: HierarchyState::default(),
            loading: None,
            devices: Vec::new(),
            failure: None,
            load_failures: Vec::new(),
            messages: VecDeque::new(),
            remembered: None,
            recalled: false,
            asked_how_near: None,
            dialog: None,
            browsing: None,
            shows_help: false,
            shows_panel: true,
            frames: VecDeque::new(),
            given: RenderSettings::default(),
            first_animation: None,
            exposure: (false, None),
            gltf_scene: options.gltf_scene.clone(),
            geometry: options.geometry,
            opened_geometry: options.geometry,
            copied: None,
            closes: false,
            default_frame_rate: options.frame_rate.unwrap_or(CPU_FRAME_RATE),
            tasks: Vec::new(),
            size: [0; 2],
            layers: Vec::new(),
            renders: Vec::new(),
            bake_preview: None,
            baked: None,
            program: std::env::current_exe().unwrap_or_else(|_| PathBuf::from("skylit")),
        };

        // settings come first: a scene keeps those that were given
        app.take_settings(&options.settings);
        if let Some(scene) = &options.scene {
            app.open(scene);
        }
        app
    }

    /// Takes settings over: those of images, the technique that they select, light, and the
    /// animation to start with. The camera is for the next scene.
    fn take_settings(&mut self, settings: &RenderSettings) {
        self.settings = settings.clone();
        let frames = &mut self.settings.frames;
        let animation = frames.animation().map(|name| (name.to_owned(), frames.time.unwrap_or(0.0)));
        (frames.animate, frames.time) = (None, None);
        self.first_animation = animation;
        self.first = Technique::of_settings(&self.settings);
        self.lighting = settings.lighting.clone();
        self.given = self.settings.clone();
    }

    /// Reads a file of settings and shows what it says, of the scene that is open.
    ///
    /// # Errors
    /// Those of [`RenderSettings::load`]; [`Error::Usage`] for a camera that is chosen in two ways.
    pub fn load_settings(&mut self, path: &Path) -> Result<()> {
        let settings = RenderSettings::load(path)?;
        settings.camera.check()?;
        self.take_settings(&settings);
        if let Some(scene) = &self.scene {
            let animations = scene.animations.clone();
            self.start_animation(&animations);
            if self.settings.camera.chooses() {
                // as at the start: by what the settings say
                (self.control, self.followed) = (None, None);
            }
        }
        Ok(())
    }

    /// Shows the animation to start with, at its time.
    fn start_animation(&mut self, animations: &[(String, f64)]) {
        let Some((name, time)) = self.first_animation.take() else { return };
        let by_index = name.parse::<usize>().ok().filter(|k| *k < animations.len());
        match by_index.or_else(|| animations.iter().position(|a| a.0 == name)) {
            Some(k) => {
                self.playback =
                    Playback { animation: Some(k), runs: false, time: time.min(animations[k].1), ..self.playback }
            }
            None => self.report(format!("--animate {name}: the scene has no such animation"), true),
        }
    }

    /// Opens a file by what it is: a scene, an environment, or settings.
    pub fn open_file(&mut self, path: &str) {
        match FileKind::from_path(path) {
            FileKind::Scene => self.open(path),
            FileKind::Environment => {
                self.lighting.environment = Some(path.to_owned());
                // of the one before
                (self.lighting.environment_turn, self.lighting.environment_scale) = (None, None);
                let capabilities = self.first.integrator().get().capabilities();
                let is_lit = capabilities.contains(&Capability::SceneLights);
                let hint = if is_lit { "" } else { ", which lights path, direct, lit and whitted (4: path)" };
                self.remember_environment();
                self.report(format!("environment: {path}{hint}"), false);
            }
            FileKind::Settings => match self.load_settings(Path::new(path)) {
                Ok(()) => self.report(format!("loaded {path}"), false),
                Err(e) => self.report(e.to_string(), true),
            },
        }
    }

    /// Opens the last scene among files that were dropped on the window, and takes over the last
    /// environment and the last settings.
    pub fn open_dropped(&mut self, files: &[egui::DroppedFile]) {
        let paths: Vec<String> =
            files.iter().filter_map(|f| f.path.as_ref()).map(|p| p.to_string_lossy().into_owned()).collect();
        for kind in [FileKind::Scene, FileKind::Environment, FileKind::Settings] {
            if let Some(path) = paths.iter().rev().find(|path| FileKind::from_path(path) == kind) {
                self.open_file(path);
            }
        }
    }

    /// Opens a scene.
    pub fn open(&mut self, source: &str) {
        self.last_load += 1;
        self.load = self.last_load;
        if self.source.as_deref().is_some_and(|before| before != source) {
            self.gltf_scene = None;
        }
        self.source = Some(source.to_owned());
        self.opened_geometry = self.geometry;
        (self.modified, self.failure) = (None, None);
        self.loading = Some((format!("loading {source}"), None));
    }

    /// Normals and texture coordinates of the last scene that was opened.
    pub fn opened_geometry(&self) -> GeometryOptions {
        self.opened_geometry
    }

    /// Stops loading: the scene before stays.
    pub fn cancel_loading(&mut self) {
        self.loading = None;
        self.load = self.loaded;
        self.source = self.scene.as_ref().map(|s| s.source.clone());
        self.modified = None;
        self.report("loading was cancelled", false);
    }

    /// Returns true if a scene is being loaded that can be cancelled: not the images of one that is
    /// shown.
    pub fn can_cancel_loading(&self) -> bool {
        self.loading.is_some() && self.load != self.loaded
    }

    /// Loads the scene anew, as the user wants it. The camera stays, unless it sees nothing but
    /// black.
    pub fn reload(&mut self) {
        if self.source.is_some() {
            self.load_anew();
            self.task(Task::CheckView { frames: false });
        }
    }

    /// Loads the scene anew; the camera stays.
    fn load_anew(&mut self) {
        if let Some(source) = self.source.clone() {
            // what changes while it is being loaded is noticed
            let modified = self.modified.take();
            self.open(&source);
            self.modified = modified;
        }
    }

    /// A message for the user.
    pub fn report(&mut self, text: impl Into<String>, is_error: bool) {
        self.messages.push_front((Instant::now(), text.into(), is_error));
        self.messages.truncate(KEPT_MESSAGES);
    }

    /// The message to show over the image, if one is new.
    pub fn new_message(&self) -> Option<&(Instant, String, bool)> {
        self.messages.front().filter(|m| m.0.elapsed() < MESSAGE_TIME)
    }

    /// Takes over what has happened since the last frame, before a frame of the user interface.
    pub fn begin_frame(&mut self, context: &egui::Context) {
        self.receive(context);
        self.watch_files(context);
        self.watch_renders(context);
        if let Some(preview) = &mut self.bake_preview {
            preview.watch(context);
        }
        self.advance(context);
        self.remember(context);
        self.layers.clear();
    }

    /// Requests of the renderer what a frame of the user interface has changed.
    pub fn end_frame(&mut self, context: &egui::Context) {
        if let Some(text) = self.copied.take() {
            context.copy_text(text);
        }
        self.send();
    }

    /// Images of the last frame, beneath the user interface.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The renderer has nothing left to do for what was requested last, or cannot do it.
    pub fn is_settled(&self) -> bool {
        self.failure.is_some() || self.loading.is_none() && self.idle >= self.sent_number
    }

    /// Samples of each pixel of the first image, if it is one of what was requested last; otherwise
    /// 0.
    pub fn shown_samples(&self) -> u32 {
        let progress =
            self.panes[0].progress.as_ref().filter(|p| self.loading.is_none() && p.request >= self.sent_number);
        progress.map_or(0, |p| p.step.samples)
    }

    /// Whether the truth is being rendered.
    pub fn compares_now(&self) -> bool {
        self.compares || self.needs_second() && matches!(self.second, Second::Truth | Second::HeatMap)
    }

    fn needs_second(&self) -> bool {
        self.shows_second || self.arrangement != Arrangement::Single
    }

    fn receive(&mut self, context: &egui::Context) {
        while let Ok(event) = self.events.try_recv() {
            match event {
                // what was cancelled may still report
                Event::Loading(text, share) => self.loading = self.loading.is_some().then_some((text, share)),
                Event::Loaded(summary) if summary.load != self.load => {}
                Event::Loaded(summary) => self.loaded(*summary),
                Event::LoadFailed(load, _) if load != self.load => {}
                Event::LoadFailed(load, text) => {
                    (self.loading, self.loaded) = (None, load);
                    self.report(text.clone(), true);
                    self.load_failures.push(text.clone());
                    if self.scene.is_none() {
                        self.failure = Some(text);
                    }
                }

                // the camera to start with, and the radius that suits what it sees
                Event::Camera(camera, openness) => {
                    if let (None, Some(scene)) = (&self.control, self.scene.clone()) {
                        // as `skylit render` does
                        self.followed = scene.cameras.iter().position(|c| *c == *camera);
                        let control = CameraControl::new(*camera, scene.bounds);
                        let ao = &mut self.settings.integrators.ao;
                        let radius = match ao.ao_radius {
                            Some(Length::Units(units)) => Some(units),
                            Some(share @ Length::OfDiagonal(_)) => share.units(control.scene_size()).map(round_length),
                            // in a closed room every ray hits something: without a radius it would
                            // be black
                            chosen => openness.and_then(|o| o.limit(chosen.is_some())),
                        };
                        let reason = match ao.ao_radius {
                            Some(Length::Units(_)) => None,
                            Some(share @ Length::OfDiagonal(_)) => Some(format!("{share} of the scene's diagonal")),
                            _ => Some("by what the camera sees".to_owned()),
                        };
                        ao.ao_radius = radius.map(Length::Units);
                        if let Some((reason, radius)) = reason.zip(radius) {
                            self.report(format!("AO radius {radius}, {reason}"), false);
                        }
                        self.control = Some(control);
                    }
                }

                // devices and images
                Event::Device(device) => self.device = device,
                Event::Devices(names) => self.devices = names,
                Event::Picture(progress) => {
                    self.failure = None;
                    let (pane, progress) = (progress.pane, Arc::new(*progress));
                    if pane == 0 && progress.request >= self.measured {
                        self.frames.push_back(progress.clone());
                        while self.frames.len() > KEPT_FRAMES {
                            self.frames.pop_front();
                        }
                    }
                    let black = self.panes[pane].black.take();
                    self.panes[pane] = PaneState { progress: Some(progress), error: None, black };
                }
                Event::PaneError(pane, error) => {
                    self.panes[pane].error = error;
                }
                Event::Idle(number) => self.idle = number,
                Event::Black(pane, reason) => self.panes[pane].black = reason,

                // of what was shown before
                Event::Compared(comparison) if comparison.request < self.comparable || !self.compares_now() => {}
                Event::Compared(comparison) => self.comparison = Some(comparison),

                // answers to what the user has done
                Event::Framed(cameras) => {
                    let [from, to] = *cameras;
                    if self.control.as_ref().is_some_and(|c| *c.camera() == from) {
                        self.set_camera(to, None);
                        self.report("framed what can be seen: from where the camera was everything is black", false);
                    }
                }
                Event::LightingRefused(lights, text) => {
                    let [refused, kept] = *lights;
                    self.report(format!("{text}; the light stays as it was"), true);
                    let file = refused.environment.clone();
                    self.remembered.iter_mut().for_each(|r| r.environments.retain(|e| Some(e) != file.as_ref()));
                    if self.lighting == refused {
                        self.lighting = kept;
                    }
                }
                Event::Outline(outline) => self.outline = Some(outline),
                Event::Picked(purpose, pick) => self.picked(purpose, *pick),
                Event::Hierarchy(found) => self.hierarchy.found = Some(*found),
                Event::Exposure(load, stops) if load == self.loaded => self.expose(stops),
                Event::Exposure(..) => {}

                // messages
                Event::Saved(Ok(path)) => self.report(format!("saved {}", path.display()), false),
                Event::Saved(Err(text)) => self.report(text, true),
                Event::Warning(text) => self.report(text, true),
                Event::Failed(text) => {
                    self.report(text.clone(), true);
                    (self.loading, self.failure) = (None, Some(text));
                }
            }
            context.request_repaint();
        }
    }

    fn loaded(&mut self, summary: SceneSummary) {
        // a model that was baked is seen as what it is made of was
        let baked = self.baked.take_if(|baked| baked.load == summary.load);
        let is_same = baked.is_some() || self.scene.as_ref().is_some_and(|s| s.source == summary.source);
        let is_same_load = self.scene.as_ref().is_some_and(|s| s.load == summary.load);
        let lacked_images = self.scene.as_ref().is_some_and(|s| s.load == summary.load && !s.is_complete);
        let what = if lacked_images && summary.is_complete {
            format!("loaded the images of {}", summary.source)
        } else {
            format!("loaded {}: {} primitives in {:.2} s", summary.source, summary.primitives, summary.seconds)
        };
        self.report(what, false);
        super::recent::add(&mut self.recent, &summary.source);

        // what belongs to the load before is dropped, and more if the scene is another one
        self.loaded = summary.load;
        self.loading = (!summary.is_complete).then(|| ("loading images".to_owned(), None));
        self.panes.iter_mut().for_each(|p| (p.error, p.black) = (None, None));
        if !is_same_load {
            // indices and names of what was there before
            (self.pick, self.outline, self.hierarchy.ray) = (None, None, None);
            let is_there = |selected: &Selection| match *selected {
                Selection::Object(k) => k < summary.objects.len(),
                Selection::Node(k) => k < summary.nodes.len(),
            };
            self.selected = self.selected.filter(|selected| is_same && is_there(selected));
        }
        if !is_same && self.scene.is_some() {
            // lengths and places of the scene before
            self.settings.camera = CameraSettings::default();
            let (ao, given) = (&mut self.settings.integrators.ao, &self.given.integrators.ao);
            (ao.ao_radius, ao.ao_falloff) = (given.ao_radius, given.ao_falloff);
            self.lighting.light.clone_from(&self.given.lighting.light);
            let file = &mut self.settings.scene;
            (file.material, file.hide, file.only) = (Vec::new(), Vec::new(), Vec::new());
            self.settings.image.ground_height = self.given.image.ground_height;
            if self.exposure.1.is_some() && self.settings.picture.exposure == self.exposure.1 {
                self.settings.picture.exposure = self.given.picture.exposure;
            }
        }
        if !is_same {
            (self.control, self.followed, self.pick, self.comparison) = (None, None, None, None);
            self.exposure = (false, None);
            self.playback = Playback { animation: None, runs: false, time: 0.0, ..self.playback };
            self.panes = Default::default();
            self.bookmarks.clear();
            self.turntable = 0.0;
            self.frames.clear();
            self.start_animation(&summary.animations);
        }

        // the file may have lost its animation, or have a shorter one
        let durations = |k: usize| summary.animations.get(k).map(|a| a.1);
        if let Some(k) = self.playback.animation {
            // the file has changed
            match durations(k) {
                Some(duration) => self.playback.time = self.playback.time.min(duration),
                None => (self.playback.animation, self.playback.runs) = (None, false),
            }
        }
        // nor are variants of another file those of this one
        let chosen = &mut self.settings.scene.variant;
        if chosen.as_deref().is_some_and(|text| variant_index(&summary.variants, text).is_none()) {
            *chosen = None;
        }
        self.forget_missing(&summary);
        self.list.renew(&summary, self.scene.as_ref());
        self.hidden = None;
        self.scene = Some(summary);
        if let Some(baked) = baked {
            self.show_baked(&baked);
        }
    }

    /// Shows the scene at the exposure that its own light needs, unless there is one already.
    fn expose(&mut self, stops: Option<f64>) {
        let is_open = !self.exposure.0 && self.settings.picture.exposure.is_none();
        self.exposure.0 = true;
        if let (true, Some(stops)) = (is_open, stops) {
            self.exposure.1 = Some(stops);
            self.settings.picture.exposure = Some(stops);
            let why = "for the light of the scene is far from a display's";
            self.report(format!("exposure {stops:+} stops, {why}; Picture has others"), false);
        }
    }

    fn picked(&mut self, purpose: PickPurpose, pick: Option<Pick>) {
        match (purpose, pick) {
            (PickPurpose::Describe, pick) => {
                self.selected = pick.as_ref().map(|pick| Selection::Object(pick.instance.0));
                if let (Some(pick), Some(scene)) = (&pick, &self.scene) {
                    self.list.reveal(scene, pick.instance.0);
                }
                self.pick = pick;
            }
            (PickPurpose::Focus, Some(pick)) => {
                self.leave_followed();
                if let Some(control) = &mut self.control {
                    control.focus(pick.position);
                }
            }
            (PickPurpose::Focus, None) => {}
            (PickPurpose::Nearness, pick) => {
                self.asked_how_near = None;
                self.control.iter_mut().for_each(|control| control.near = pick.as_ref().map(|pick| pick.distance));
            }
        }
    }

    /// Drops settings of materials and objects that a scene does not have, and says so.
    fn forget_missing(&mut self, scene: &SceneSummary) {
        let is_there = |text: &str, names: &mut dyn Iterator<Item = &str>| {
            names.enumerate().any(|(k, name)| name == text || text == k.to_string())
        };
        let [instances, _, materials, _] = scene.counts;
        let named = NamedObjects { objects: &scene.objects, nodes: &scene.nodes };
        let is_material = |text: &str| {
            scene.materials.len() < materials || is_there(text, &mut scene.materials.iter().map(|m| m.name.as_str()))
        };
        let file = &mut self.settings.scene;
        let mut missing = Vec::new();
        for (option, texts) in [("--hide", &mut file.hide), ("--only", &mut file.only)] {
            let found = named.find(texts).into_iter().map(|found| !found.is_empty() || scene.objects.len() < instances);
            let is_there: Vec<bool> = found.collect();
            let lost = texts.iter().zip(&is_there).filter(|(_, is_there)| !**is_there);
            missing.extend(lost.map(|(text, _)| format!("{option} {text}")));
            let mut each = is_there.iter();
            texts.retain(|_| each.next().copied().unwrap_or(true));
        }
        let edits = file.material.iter().map(|edit| edit.material.as_str());
        missing.extend(edits.filter(|text| !is_material(text)).map(|text| format!("--material {text}")));
        file.material.retain(|edit| is_material(&edit.material));
        missing.into_iter().for_each(|text| self.report(format!("{text}: the scene does not have it"), true));
    }

    /// Selects an object, a node, or nothing. What was clicked on is forgotten.
    pub fn select(&mut self, selected: Option<Selection>) {
        (self.selected, self.pick) = (selected, None);
    }

    /// The objects of a selection, indices.
    fn objects_of(&self, selection: Selection) -> Range<usize> {
        self.scene.as_ref().map_or(0..0, |scene| selection.objects(&scene.nodes))
    }

    /// The outline of what is selected, if it is that of what is shown.
    pub fn outline(&self) -> Option<&Outline> {
        let outline = self.outline.as_deref()?;
        let shown = self.panes[0].progress.as_ref().and_then(|p| p.camera.as_ref());
        let selected = self.selected.map(|selected| self.objects_of(selected));
        let is_shown = (Some(&outline.objects), outline.time, outline.size)
            == (selected.as_ref(), self.playback.time, self.size)
            && shown == Some(&outline.camera);
        is_shown.then_some(outline)
    }

    /// Hierarchy and influence areas of what was requested last, once the renderer has found them.
    pub fn found_hierarchy(&self) -> Option<&FoundHierarchy> {
        self.hierarchy.found.as_ref().filter(|found| found.key == HierarchyKey::of_request(&self.sent))
    }

    /// Notes the ray through a point of the view, from (0, 0) at the top left to (1, 1): the
    /// hierarchy shows what it visits.
    pub fn remember_ray(&mut self, at: [f64; 2]) {
        let aspect = f64::from(self.size[0].max(1)) / f64::from(self.size[1].max(1));
        self.hierarchy.ray = self.shown_camera().map(|camera| camera_ray(&camera, at, aspect));
    }

    /// Number of objects before each that are left out, and of all, last.
    pub fn hidden_before(&mut self) -> Arc<Vec<u32>> {
        let file = &self.settings.scene;
        if let Some(hidden) = self.hidden.as_ref().filter(|hidden| hidden.is_by(file)) {
            return hidden.before.clone();
        }
        let scene = self.scene.as_ref().map(|s| NamedObjects { objects: &s.objects, nodes: &s.nodes });
        let before = Arc::new(scene.map_or_else(|| vec![0], |scene| scene.hidden_before(file)));
        self.hidden = Some(HiddenObjects::new(file, before.clone()));
        before
    }

    /// Number of objects of a selection, and of those that are left out.
    pub fn hidden_count(&mut self, selection: Selection) -> [usize; 2] {
        let (range, before) = (self.objects_of(selection), self.hidden_before());
        let last = before.len() - 1;
        let [start, end] = [range.start, range.end].map(|k| before[k.min(last)] as usize);
        [range.len(), end - start]
    }

    /// Whether all objects of a selection are left out.
    pub fn is_hidden(&mut self, selection: Selection) -> bool {
        let [all, hidden] = self.hidden_count(selection);
        hidden == all
    }

    /// Leaves an object or all below a node out, or not any more.
    pub fn hide(&mut self, selection: Selection, hides: bool) {
        let range = self.objects_of(selection);
        if let Some(scene) = self.scene.as_ref().filter(|_| !range.is_empty()) {
            let scene = NamedObjects { objects: &scene.objects, nodes: &scene.nodes };
            hiding::set_hidden(&mut self.settings.scene, scene, &range, hides);
        }
    }

    /// Shows an object or what is below a node alone.
    pub fn isolate(&mut self, selection: Selection) {
        let range = self.objects_of(selection);
        if let Some(scene) = self.scene.as_ref().filter(|_| !range.is_empty()) {
            let text = NamedObjects { objects: &scene.objects, nodes: &scene.nodes }.text(&range);
            (self.settings.scene.hide, self.settings.scene.only) = (Vec::new(), vec![text]);
        }
    }

    /// Leaves no object out.
    pub fn show_all_objects(&mut self) {
        (self.settings.scene.hide, self.settings.scene.only) = (Vec::new(), Vec::new());
    }

    /// Looks at an object or a node from where the camera is.
    pub fn frame(&mut self, selection: Selection) {
        let objects = self.scene.as_ref().and_then(|s| s.objects.get(self.objects_of(selection)));
        let bounds = objects.into_iter().flatten().filter_map(|o| o.bounds);
        let aspect = f64::from(self.size[0].max(1)) / f64::from(self.size[1].max(1));
        let Some(bounds) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else { return };
        self.leave_followed();
        self.control.iter_mut().for_each(|control| control.frame(bounds, aspect));
    }

    /// The values of a material that are replaced, by the name that settings have for it.
    pub fn material_edit(&self, material: usize) -> MaterialEdit {
        let materials = self.scene.as_ref().map(|s| s.materials.as_slice()).unwrap_or_default();
        let name = materials.get(material).map_or("", |m| m.name.as_str());
        let name = key(materials.iter().map(|m| m.name.as_str()), material, name);
        let found = self.settings.scene.material.iter().find(|edit| edit.material == name);
        found.cloned().unwrap_or(MaterialEdit { material: name, ..MaterialEdit::default() })
    }

    /// Replaces values of a material, in place of those that were replaced before.
    pub fn edit_material(&mut self, edit: MaterialEdit) {
        let edits = &mut self.settings.scene.material;
        edits.retain(|other| other.material != edit.material);
        if !edit.is_empty() {
            edits.push(edit);
        }
    }

    /// Asks how far away what is ahead is, unless the answer is on its way.
    pub fn ask_how_near(&mut self) {
        const PATIENCE: Duration = Duration::from_secs(2);
        if self.asked_how_near.is_none_or(|asked| asked.elapsed() > PATIENCE) {
            self.asked_how_near = Some(Instant::now());
            self.task(Task::Pick { at: [0.5; 2], purpose: PickPurpose::Nearness });
        }
    }

    /// Notes that a hint is not needed any more.
    pub fn learn(&mut self, hint: Hint) {
        self.remembered.iter_mut().for_each(|remembered| remembered.learn(hint));
    }

    /// Puts the environment among those that are offered again, if it is a file.
    pub fn remember_environment(&mut self) {
        if let (Some(file), Some(remembered)) = (self.lighting.environment_file(), &mut self.remembered) {
            remembered.use_environment(&file.to_string_lossy());
        }
    }

    /// Takes over how the window was the last time, and notes how it is.
    fn remember(&mut self, context: &egui::Context) {
        let Some(remembered) = &mut self.remembered else { return };
        if !std::mem::replace(&mut self.recalled, true) {
            remembered.zoom.into_iter().for_each(|zoom| context.set_zoom_factor(zoom));
            let theme = |is_dark: bool| if is_dark { egui::Theme::Dark } else { egui::Theme::Light };
            remembered.is_dark.into_iter().for_each(|is_dark| context.set_theme(theme(is_dark)));
            self.shows_panel = !remembered.hides_panel;
            return;
        }
        remembered.zoom = Some(context.zoom_factor());
        remembered.is_dark = match context.options(|o| o.theme_preference) {
            egui::ThemePreference::System => None,
            preference => Some(preference == egui::ThemePreference::Dark),
        };
        remembered.hides_panel = !self.shows_panel;
    }

    /// Loads the scene anew when a file has changed that it was read from.
    fn watch_files(&mut self, context: &egui::Context) {
        const INTERVAL: Duration = Duration::from_secs(1);
        let Some(scene) = self.scene.as_ref().filter(|s| !s.files.is_empty() && self.loading.is_none()) else { return };
        context.request_repaint_after(INTERVAL);
        if self.modified.as_ref().is_some_and(|m| m.0.elapsed() < INTERVAL) {
            return;
        }
        let modified = |path: &PathBuf| std::fs::metadata(path).and_then(|m| m.modified()).ok();
        let now: Vec<_> = scene.files.iter().map(modified).collect();
        let before = self.modified.replace((Instant::now(), now.clone())).map(|m| m.1);
        // a file that is being replaced is gone for a moment
        if before.is_some_and(|before| before.iter().zip(&now).any(|(before, now)| now.is_some() && now != before)) {
            self.load_anew();
        }
    }

    /// Time passes: the animation, the turntable.
    fn advance(&mut self, context: &egui::Context) {
        let seconds = f64::from(context.input(|i| i.stable_dt.min(0.1)));
        if let (Some(k), true) = (self.playback.animation, self.playback.runs) {
            self.playback.time += seconds * self.playback.speed;
            let duration = self.scene.as_ref().and_then(|s| s.animations.get(k)).map_or(0.0, |a| a.1);
            if self.playback.time >= duration {
                (self.playback.time, self.playback.runs) = if self.playback.repeats && duration > 0.0 {
                    (self.playback.time.rem_euclid(duration), true)
                } else {
                    (duration, false)
                };
            }
            context.request_repaint();
        }
        if self.turntable != 0.0 {
            self.leave_followed();
            if let Some(control) = &mut self.control {
                control.turntable(self.turntable * seconds);
                context.request_repaint();
            }
        }
    }

    /// Moves the camera to another one; `followed`: the file's camera that it is.
    pub fn set_camera(&mut self, camera: Camera, followed: Option<usize>) {
        let centre = self.scene.as_ref().map(|s| (s.bounds.0 + s.bounds.1) * 0.5).unwrap_or_default();
        if let Some(control) = &mut self.control {
            control.set_camera(camera, centre);
            self.followed = followed;
        }
    }

    /// No longer follows a camera of the file: the user's goes on from where the animation has
    /// moved it.
    pub fn leave_followed(&mut self) {
        if self.followed.is_some() {
            let shown = self.shown_camera();
            shown.into_iter().for_each(|camera| self.set_camera(camera, None));
            self.followed = None;
        }
    }

    /// The camera of the image: where an animation has moved it, if it is followed.
    pub fn shown_camera(&self) -> Option<Camera> {
        let moved = self.panes[0].progress.as_ref().and_then(|p| p.camera.clone()).filter(|_| self.followed.is_some());
        moved.or_else(|| self.control.as_ref().map(|c| c.camera().clone()))
    }

    /// Returns the technique that the first image is compared with.
    pub fn truth(&self) -> Technique {
        match self.chosen_truth {
            Some((of, truth)) if of == self.first.integrator() => truth,
            _ => self.first.truth(),
        }
    }

    /// Whether the truth was chosen, and does not follow the first image.
    pub fn has_chosen_truth(&self) -> bool {
        self.chosen_truth.is_some_and(|(of, _)| of == self.first.integrator())
    }

    /// Chooses what images of the first image's integrator are compared with; `None`: what they
    /// approximate.
    pub fn choose_truth(&mut self, truth: Option<Technique>) {
        self.chosen_truth = truth.map(|truth| (self.first.integrator(), truth));
    }

    /// Settings of the truth that an image of these settings is compared with.
    fn truth_settings(&self, first: &RenderSettings) -> RenderSettings {
        let mut truth = self.truth().settings(&self.settings);
        // samples of its own: of the same ones a truth of the same integrator would be the same
        // image
        truth.image.seed = Some(truth.seed().wrapping_add(TRUTH_SEED));
        if first.realtime_setting().is_some() {
            // what differs shall not be the samples' place in the pixel
            let is_antialiased = frame_settings(first).is_ok_and(|s| s.antialias);
            if truth.realtime_setting().is_some() {
                truth.frames.antialias = Some(if is_antialiased { Antialias::On } else { Antialias::Off });
            } else if !is_antialiased {
                truth.image.pixel_filter = Some(PixelFilter::Centre);
            }
        }
        truth
    }

    /// Sends what has changed.
    fn send(&mut self) {
        // images on the screen, then the truth if something is compared with it
        let mut panes = vec![self.first.settings(&self.settings)];
        if let (Second::Technique(t), true) = (self.second, self.needs_second()) {
            panes.push(t.settings(&self.settings));
        }
        let shown = panes.len();
        if self.compares_now() {
            panes.push(self.truth_settings(&panes[0]));
        }
        // they change what is shown, not how it is rendered
        panes.iter_mut().for_each(|settings| settings.scene.material.clear());

        // a request like the last one changes nothing
        let request = Request {
            scene: self.source.clone(),
            gltf_scene: self.gltf_scene.clone(),
            geometry: self.geometry,
            load: self.load,
            device: self.device_settings.clone(),
            meaning: self.settings.scene.clone(),
            lighting: self.lighting.clone(),
            ground: (self.settings.image.ground.unwrap_or_default(), self.settings.image.ground_height),
            animation: self.playback.animation,
            time: self.playback.time,
            camera: self.control.as_ref().map(|c| c.camera().clone()),
            first_camera: self.settings.camera.clone(),
            followed_camera: self.followed,
            selected: self.selected.map(|selected| self.objects_of(selected)).filter(|objects| !objects.is_empty()),
            hierarchy: self.hierarchy.is_shown(),
            shown,
            panes,
            size: self.size,
            frame_rate: self.frame_rate,
            compares: self.compares_now(),
            is_paused: self.is_paused,
            tasks: Vec::new(),
            quits: false,
        };
        if request == self.sent && self.tasks.is_empty() {
            return;
        }

        // what is shown and measured may be of the request before
        let (before, first) = (std::mem::take(&mut self.sent), |r: &Request| r.panes.first().cloned());
        let is_another_view = !request.shows_same_view(&before);
        let is_another_image = is_another_view || first(&request) != first(&before);
        let compared = |r: &Request| r.panes.last().filter(|_| r.compares).cloned();
        let is_another_comparison = is_another_image || compared(&request) != compared(&before);
        let is_measured_anew = (request.load, request.size, &request.device)
            != (before.load, before.size, &before.device)
            || self.techniques[0].0 != self.first.label();
        if is_another_comparison {
            self.comparison = None;
        }
        if is_measured_anew {
            self.frames.clear();
        }
        if request.panes != before.panes {
            self.panes.iter_mut().for_each(|p| p.error = None);
        }

        // what is not requested is not kept up to date
        let requested: Vec<_> = (0..request.panes.len()).map(|k| request.pane(k)).collect();
        for (k, pane) in self.panes.iter_mut().enumerate() {
            if is_another_view && !requested.contains(&k) {
                *pane = PaneState::default();
            }
        }

        let tasks = std::mem::take(&mut self.tasks);
        self.sent = request.clone();
        self.sent_number = self.mailbox.change(|r| {
            // what was to be done with another scene is not done with this one
            let before = if r.load == request.load { std::mem::take(&mut r.tasks) } else { Vec::new() };
            *r = request;
            r.tasks = before.into_iter().chain(tasks).collect();
        });

        // answers to earlier requests do not count any more
        if is_another_comparison {
            self.comparable = self.sent_number;
        }
        if is_measured_anew {
            self.measured = self.sent_number;
        }
        for is_second in [false, true] {
            let (pane, name) = (self.pane(is_second), self.technique_of(is_second));
            if self.techniques[pane].0 != name {
                self.techniques[pane] = (name, self.sent_number);
            }
        }
    }

    /// Ends the thread that renders.
    pub fn quit(&mut self) {
        // renders that the user has started go on
        self.mailbox.change(|r| r.quits = true);
    }

    /// Adds work for the renderer.
    pub fn task(&mut self, task: Task) {
        self.tasks.push(task);
    }

    /// Sets the size of the images, physical pixels.
    pub fn set_size(&mut self, size: [u32; 2]) {
        self.size = size;
    }

    /// Size of the images, physical pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Adds an image beneath the user interface.
    pub fn add_layer(&mut self, layer: Layer) {
        self.layers.push(layer);
    }

    /// The picture of the first image, or of the second.
    pub fn picture(&self, is_second: bool) -> Option<Arc<ViewPicture>> {
        let shown = |k: usize| self.panes[k].progress.as_ref().map(|p| p.picture.clone());
        match (is_second, self.second) {
            (false, _) => shown(0),
            (true, Second::Technique(_)) => shown(1),
            (true, Second::Truth) => shown(TRUTH),
            (true, Second::HeatMap) => self.comparison.as_ref().map(|c| c.heat_map.clone()),
        }
    }

    /// Name of the first image, or of the second.
    pub fn title(&self, is_second: bool) -> String {
        match (is_second, self.second) {
            (false, _) => self.first.label(),
            (true, Second::Technique(t)) => t.label(),
            (true, Second::Truth) => format!("Truth: {}", self.truth().label()),
            (true, Second::HeatMap) => format!("FLIP against {}", self.truth().label()),
        }
    }

    /// Returns true while an image is not yet what its name says: another technique was chosen, and
    /// its first picture is to come.
    pub fn is_title_ahead(&self, is_second: bool) -> bool {
        let pane = self.pane(is_second);
        let (name, first) = &self.techniques[pane];
        let shown = self.panes[pane].progress.as_ref();
        shown.is_some_and(|p| p.request < *first || *name != self.technique_of(is_second))
    }

    /// The technique of the first image, or of the second; a heat map is of the truth's.
    fn technique_of(&self, is_second: bool) -> String {
        match (is_second, self.second) {
            (false, _) => self.first.label(),
            (true, Second::Technique(t)) => t.label(),
            (true, _) => self.truth().label(),
        }
    }

    /// Index of the first image, or of the second.
    fn pane(&self, is_second: bool) -> usize {
        match (is_second, self.second) {
            (false, _) => 0,
            (true, Second::Technique(_)) => 1,
            (true, _) => TRUTH,
        }
    }

    /// Why the first image, or the second, is black, if it is.
    pub fn black(&self, is_second: bool) -> Option<&String> {
        let has_picture = !(is_second && self.second == Second::HeatMap);
        self.panes[self.pane(is_second)].black.as_ref().filter(|_| has_picture)
    }

    /// Error of the first image, or of the second.
    pub fn error(&self, is_second: bool) -> Option<&String> {
        self.panes[self.pane(is_second)].error.as_ref()
    }

    /// Settings of the image in front, with the lights that apply to it.
    pub fn shown_settings(&self) -> RenderSettings {
        let technique = match (self.shows_second, self.second) {
            (true, Second::Technique(t)) => t,
            (true, _) => self.truth(),
            (false, _) => self.first,
        };
        let mut settings = technique.settings(&self.settings);
        let capabilities = settings.integrator().get().capabilities();
        if capabilities.contains(&Capability::AmbientOcclusion) {
            // without one `skylit render` would choose one in a closed room
            settings.integrators.ao.ao_radius.get_or_insert(Length::Units(f64::INFINITY));
        }
        settings.lighting = self.lighting.clone();
        let lit = settings.integrator().get().capabilities().contains(&crate::settings::Capability::SceneLights);
        if !lit {
            settings.lighting = LightingSettings::default();
        }
        settings
    }

    /// Settings of `skylit render` for what is shown: its camera, its moment of the animation, and
    /// samples of a still.
    ///
    /// # Errors
    /// [`Error::Usage`] before there is a camera.
    pub fn render_settings(&self, motion: RenderedMotion) -> Result<RenderSettings> {
        let none = || Error::Usage("there is no image to render yet".into());
        let (scene, control) = self.scene.as_ref().zip(self.control.as_ref()).ok_or_else(none)?;
        let mut settings = self.shown_settings();
        let is_still = settings.realtime_setting().is_none();
        let camera = control.camera();
        settings.camera = match (self.playback.animation, self.followed) {
            // by its index an animation would move it
            (Some(_), None) => camera_placement(camera),
            _ => camera_settings(&scene.cameras, camera),
        };

        // samples of a still, and the moment
        if is_still {
            settings.image.spp = Some(self.settings.image.spp.unwrap_or(STILL_SPP));
        }
        let frames = &mut settings.frames;
        if let (Some(k), false) = (self.playback.animation, motion == RenderedMotion::Animation) {
            (frames.animate, frames.time) = (Some(k.to_string()), Some(self.playback.time));
        }

        // what moves
        match motion {
            RenderedMotion::Nothing => {}
            RenderedMotion::Turntable => {
                (frames.orbit, frames.frames) =
                    (Some(TURNTABLE_FRAMES), Some(FrameRange { first: 0, end: TURNTABLE_FRAMES }));
                // the last frame leads to the first
                frames.lead_in = (!is_still).then_some(TURNTABLE_LEAD_IN);
            }
            RenderedMotion::Animation => {
                let animation = self.playback.animation.and_then(|k| Some((k, scene.animations.get(k)?.1)));
                let (k, duration) = animation.ok_or_else(|| Error::Usage("no animation is chosen".into()))?;
                let end = (ANIMATION_FPS * duration).ceil().max(1.0) as u32;
                (frames.animate, frames.frames) = (Some(k.to_string()), Some(FrameRange { first: 0, end }));
            }
        }
        Ok(settings)
    }

    /// The command that renders what is shown.
    ///
    /// # Errors
    /// Those of [`App::render_settings`].
    pub fn command(&self) -> Result<String> {
        let settings = self.render_settings(RenderedMotion::Nothing)?;
        let source = self.scene.as_ref().map_or("", |s| s.source.as_str());
        Ok(render_command(
            source,
            &self.load_flags(),
            &RenderSettings { image: ImageSettings { size: Some(self.size), ..settings.image }, ..settings },
        ))
    }

    /// The options by which the scene is loaded, as words of the command line.
    fn load_flags(&self) -> Vec<String> {
        LoadOptions { scene: self.gltf_scene.as_deref(), geometry: self.geometry, ..LoadOptions::default() }.flags()
    }

    /// The frame rate to hold unless another is chosen.
    pub fn default_frame_rate(&self) -> f64 {
        self.default_frame_rate
    }

    /// Numbers of a render unless the user says otherwise: the size is that of the window.
    pub fn default_render(&self, motion: RenderedMotion) -> RenderWanted {
        RenderWanted {
            motion,
            size: self.size,
            spp: self.settings.image.spp.unwrap_or(STILL_SPP),
            frames: TURNTABLE_FRAMES,
            fps: ANIMATION_FPS,
        }
    }

    /// The settings of a render that is asked for.
    ///
    /// # Errors
    /// Those of [`App::render_settings`].
    pub fn wanted_settings(&self, wanted: &RenderWanted) -> Result<RenderSettings> {
        let mut settings = self.render_settings(wanted.motion)?;
        settings.image.size = Some(wanted.size);
        if settings.image.spp.is_some() {
            settings.image.spp = Some(wanted.spp);
        }
        let frames = &mut settings.frames;
        match wanted.motion {
            RenderedMotion::Nothing => return Ok(settings),
            RenderedMotion::Turntable => {
                frames.orbit = Some(wanted.frames);
                frames.frames = Some(FrameRange { first: 0, end: wanted.frames });
            }
            RenderedMotion::Animation => {
                let seconds = f64::from(frames.range().end) / ANIMATION_FPS;
                let end = (wanted.fps * seconds).ceil().max(1.0) as u32;
                frames.frames = Some(FrameRange { first: 0, end });
            }
        }
        frames.fps = Some(wanted.fps);
        Ok(settings)
    }

    /// Runs `skylit render` with what is shown and this output, as a program of its own.
    pub fn render(&mut self, output: &str, wanted: &RenderWanted) {
        let settings = match self.wanted_settings(wanted) {
            Ok(settings) => settings,
            Err(e) => return self.report(e.to_string(), true),
        };
        let source = self.scene.as_ref().map_or("", |s| s.source.as_str()).to_owned();
        // defaults are among the settings already
        let fixed = [source, "--no-config".into(), "-o".into(), output.to_owned()];
        let arguments: Vec<String> = fixed.into_iter().chain(self.load_flags()).chain(settings.flags()).collect();
        self.start("render", &arguments, output, None);
    }

    /// Runs `skylit export` with the scene as it is shown, as a program of its own.
    pub fn export(&mut self, output: &str) {
        let Some(scene) = &self.scene else { return };
        let settings = RenderSettings { scene: self.settings.scene.clone(), ..RenderSettings::default() };
        let fixed = [scene.source.clone(), "-o".into(), output.to_owned()];
        let arguments: Vec<String> = fixed.into_iter().chain(self.load_flags()).chain(settings.flags()).collect();
        self.start("export", &arguments, output, None);
    }

    /// Numbers of baking unless the user says otherwise: the radius is that of the view.
    pub fn default_bake(&self) -> BakeWanted {
        BakeWanted {
            place: BakePlace::Texture,
            image_map: BakedMap::Ao,
            size: BAKE_SIZE,
            spp: BAKE_SPP,
            radius: self.settings.integrators.ao.radius(),
            share: None,
            is_atlas: false,
            is_denoised: false,
            has_ground: false,
            is_shown: true,
        }
    }

    /// The arguments of `skylit bake` for the scene as it is shown.
    fn bake_arguments(&self, source: &str, output: &str, wanted: &BakeWanted) -> Vec<String> {
        // what the view has of radius, falloff and light
        let mut settings = RenderSettings { scene: self.settings.scene.clone(), ..RenderSettings::default() };
        let falloff = self.settings.integrators.ao.ao_falloff;
        settings.integrators.ao.ao_radius = wanted.length();
        if wanted.map().has_radius() {
            settings.integrators.ao.ao_falloff = falloff;
        }
        if wanted.map() == BakedMap::Light {
            settings.lighting = self.lighting.clone();
            settings.integrators.path.max_depth = self.settings.integrators.path.max_depth;
        }

        let fixed = [source.to_owned(), "-o".into(), output.to_owned()];
        fixed.into_iter().chain(self.load_flags()).chain(wanted.flags()).chain(settings.flags()).collect()
    }

    /// Runs `skylit bake` with the scene as it is shown, as a program of its own.
    pub fn bake(&mut self, output: &str, wanted: &BakeWanted) {
        let Some(scene) = &self.scene else { return };
        let source = scene.source.clone();
        let arguments = self.bake_arguments(&source, output, wanted);
        let ao = (Length::Units(wanted.radius), self.settings.integrators.ao.ao_falloff);
        let baked = BakedModel { source, output: output.to_owned(), place: wanted.place, ao, load: 0 };
        let is_shown = wanted.is_shown && wanted.place != BakePlace::Image;
        self.start("bake", &arguments, output, is_shown.then_some(baked));
    }

    /// Starts the preview of a bake, in place of the one before.
    pub fn preview_bake(&mut self, wanted: &BakeWanted) {
        let Some(scene) = &self.scene else { return };
        let (source, size, spp) = (scene.source.clone(), Some(self.preview_size()), Some(PREVIEW_SPP));
        let settings = match self.render_settings(RenderedMotion::Nothing) {
            Ok(settings) => settings,
            Err(e) => return self.report(e.to_string(), true),
        };
        let arguments = |model: &str, picture: &str| {
            let baked = BakedModel {
                source: source.clone(),
                output: model.to_owned(),
                place: wanted.place,
                ao: (Length::Auto, None),
                load: 0,
            };
            // the file of an amended model says what that of the source says
            let (scene, load) =
                if baked.is_amended() { (settings.scene, self.load_flags()) } else { Default::default() };
            let integrator = IntegratorName::find(baked.integrator());
            let image = ImageSettings { size, spp, ..ImageSettings::default() };
            let view =
                RenderSettings { camera: settings.camera, scene, integrator, image, ..RenderSettings::default() };
            let fixed = [model.to_owned(), "--no-config".into(), "-o".into(), picture.to_owned()];
            let render = fixed.into_iter().chain(load).chain(view.flags()).collect();
            [self.bake_arguments(&source, model, &quick(wanted)), render]
        };
        match BakePreview::start(self.program.clone(), wanted, arguments) {
            Ok(preview) => self.bake_preview = Some(preview),
            Err(e) => self.report(format!("no preview can be made: {e}"), true),
        }
    }

    /// Width and height of the picture of a preview, which shows as much as the view does.
    fn preview_size(&self) -> [u32; 2] {
        let [size, most] = [self.size(), PREVIEW_SIZE].map(|size| size.map(|n| f64::from(n.max(1))));
        let scale = (most[0] / size[0]).min(most[1] / size[1]);
        size.map(|n| (scale * n).round().max(1.0) as u32)
    }

    /// Opens a model that was baked, unless another scene was opened meanwhile.
    fn open_baked(&mut self, mut baked: BakedModel) {
        if self.source.as_ref() != Some(&baked.source) {
            return;
        }
        let gltf_scene = self.gltf_scene.clone();
        if baked.is_amended() {
            self.open(&baked.output);
            self.gltf_scene = gltf_scene;
        } else {
            // the file has what settings made of the scene
            (self.geometry, self.settings.scene) = Default::default();
            self.open(&baked.output);
        }
        baked.load = self.load;
        self.baked = Some(baked);
    }

    /// Shows what was baked on the left, and traced ambient occlusion on the right.
    fn show_baked(&mut self, baked: &BakedModel) {
        self.first = IntegratorName::find(baked.integrator()).map_or(self.first, Technique::Still);
        self.second = if baked.place == BakePlace::Texture {
            self.choose_truth(Some(Technique::Converged));
            Second::Truth
        } else {
            // colours are not the same quantity, and have no error
            Second::Technique(Technique::Converged)
        };
        (self.arrangement, self.shows_second) = (Arrangement::Split(0.5), false);
        let ao = &mut self.settings.integrators.ao;
        (ao.ao_radius, ao.ao_falloff) = (Some(baked.ao.0), baked.ao.1);
        // the rest pose is baked
        self.playback = Playback { animation: None, runs: false, time: 0.0, ..self.playback };
    }

    /// Starts this program with a command, of which the status line tells.
    fn start(&mut self, command: &'static str, arguments: &[String], output: &str, baked: Option<BakedModel>) {
        match Render::start(&self.program, command, arguments, output) {
            Ok(mut render) => {
                render.baked = baked;
                self.report(format!("{command}: {output}"), false);
                self.renders.push(render);
            }
            Err(e) => self.report(format!("cannot start skylit {command}: {e}"), true),
        }
    }

    /// Tells of renders that have ended.
    fn watch_renders(&mut self, context: &egui::Context) {
        let (mut messages, mut baked) = (Vec::new(), None);
        self.renders.retain_mut(|render| {
            let ended = render.ended();
            let goes_on = ended.is_none();
            messages.extend(ended);
            if render.has_succeeded() {
                baked = render.baked.take().or(baked.take());
            }
            goes_on
        });
        messages.into_iter().for_each(|(text, is_error)| self.report(text, is_error));
        if let Some(baked) = baked {
            self.open_baked(baked);
        }
        if !self.renders.is_empty() {
            context.request_repaint_after(Duration::from_millis(200));
        }
    }

    /// Frames per second, median and 95th percentile of frame times in milliseconds, and rays per
    /// second, of the last frames of the first image.
    pub fn figures(&self) -> Option<Figures> {
        let ms: Vec<f64> = self.frames.iter().map(|p| 1e3 * p.time.as_secs_f64()).collect();
        let median = crate::measure::stats::median(&ms)?;
        let p95 = crate::measure::stats::percentile(&ms, 0.95)?;
        let rays: u64 = self.frames.iter().map(|p| p.step.rays[0] + p.step.rays[1]).sum();
        let seconds = ms.iter().sum::<f64>() * 1e-3;
        Some(Figures { median, p95, rays_per_second: rays as f64 / seconds.max(1e-9) })
    }
}

/// How settings name one of several: by its name, unless it has none, others have it, it is a
/// number, or it could be taken for a value; else by its number.
fn key<'a>(names: impl Iterator<Item = &'a str>, index: usize, name: &str) -> String {
    let is_unique = || names.filter(|other| *other == name).take(2).count() == 1;
    if hiding::is_plain(name) && is_unique() { name.to_owned() } else { index.to_string() }
}

/// Figures of the last frames.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    /// Median of the wall-clock time of a frame, milliseconds.
    pub median: f64,
    /// 95th percentile of the same.
    pub p95: f64,
    /// Rays per second of wall-clock time.
    pub rays_per_second: f64,
}
