//! The state of the viewer, and how events of the renderer and input of the user change it. `panels/` show it.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::process::Child;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use super::browse::Browsing;
use super::camera::CameraControl;
use super::layer::Layer;
use super::request::{Comparison, DeviceSummary, Event, Mailbox, PickPurpose, Progress, Request, SceneSummary, TRUTH, Task};
use super::technique::Technique;
use super::{ViewOptions, panels};
use crate::integrators::IntegratorName;
use crate::integrators::lighting::LightingSettings;
use crate::interface::PixelFilter;
use crate::realtime::Preset;
use crate::realtime::frame_settings::Antialias;
use crate::renderer::RenderSettings;
use crate::renderer::frames::frame_settings;
use crate::renderer::interactive::{Pick, ViewPicture, render_flags};
use crate::scene::Camera;
use crate::settings::Length;
use crate::tracer::DeviceSettings;

/// Frames whose times are kept for the plot and the figures.
const KEPT_FRAMES: usize = 120;
/// Messages that are kept.
const KEPT_MESSAGES: usize = 100;
/// Time for which a new message is shown over the image.
const MESSAGE_TIME: Duration = Duration::from_secs(8);

/// What the second image shows.
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
}

/// A window that asks for something.
#[derive(Clone, Debug, PartialEq)]
pub enum Dialog {
    /// For a scene: a file or `builtin:NAME`.
    Open(String),
    /// For the name of an image file.
    Save(String),
    /// For a file of settings to read.
    LoadSettings(String),
    /// For a file of settings to write.
    SaveSettings(String),
    /// For the output of `skylit render`, with these options besides.
    Render(String, Vec<String>),
}

impl Dialog {
    /// What is typed into it.
    pub fn text_mut(&mut self) -> &mut String {
        match self {
            Self::Open(text)
            | Self::Save(text)
            | Self::LoadSettings(text)
            | Self::SaveSettings(text)
            | Self::Render(text, _) => text,
        }
    }
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

/// The viewer.
pub struct App {
    mailbox: Arc<Mailbox>,
    events: Receiver<Event>,
    sent: Request,
    /// Number of the last request, and of the last one for which nothing is left to do.
    sent_number: u64,
    idle: u64,
    /// The technique of each image in the last request with it, by name, and the number of the first such request.
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
    /// What is known of the scene.
    pub scene: Option<SceneSummary>,
    /// What is known of the device.
    pub device: DeviceSummary,
    /// Settings of device and tracer.
    pub device_settings: DeviceSettings,
    /// Settings of all images, of which each takes those that apply to it.
    pub settings: RenderSettings,
    /// Lights beside the scene's.
    pub lighting: LightingSettings,
    /// What the first image shows.
    pub first: Technique,
    /// What the second image shows.
    pub second: Second,
    /// What the first image is compared with.
    pub truth: Technique,
    /// Whether it is compared.
    pub compares: bool,
    /// Where the images are.
    pub arrangement: Arrangement,
    /// With one image at a time: whether it is the second.
    pub shows_second: bool,
    /// The images: first, second, truth.
    pub panes: [PaneState; 3],
    /// The last comparison.
    pub comparison: Option<Box<Comparison>>,
    /// The camera, once the scene is loaded.
    pub control: Option<CameraControl>,
    /// Index of the file's camera that is followed while an animation moves it.
    pub followed: Option<usize>,
    /// Cameras that the user has kept.
    pub bookmarks: Vec<(String, Camera)>,
    /// Speed of the turntable, radians per second; 0 at rest.
    pub turntable: f64,
    /// Frame rate to hold; `None`: full resolution always.
    pub frame_rate: Option<f64>,
    /// Whether rendering is paused.
    pub is_paused: bool,
    /// The animation.
    pub playback: Playback,
    /// What was clicked on.
    pub pick: Option<Pick>,
    /// What is being loaded.
    pub loading: Option<(String, Option<f32>)>,
    /// Names of the Vulkan devices, by index.
    pub devices: Vec<String>,
    /// Why there are no images.
    pub failure: Option<String>,
    /// Messages, the last one first.
    pub messages: VecDeque<(Instant, String, bool)>,
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
    /// Text to be put on the clipboard.
    pub copied: Option<String>,
    /// The window is to be closed.
    pub closes: bool,
    default_frame_rate: f64,
    last_load: u64,
    tasks: Vec<Task>,
    size: [u32; 2],
    layers: Vec<Layer>,
    renders: Vec<(String, Child)>,
}

impl App {
    /// The viewer as it starts.
    pub fn new(options: &ViewOptions, mailbox: Arc<Mailbox>, events: Receiver<Event>) -> Self {
        let preset = options.settings.frames.preset.unwrap_or(Preset::Balanced);
        let first = match options.settings.integrator {
            Some(integrator) if options.settings.realtime_setting().is_none() => Technique::Still(integrator),
            Some(integrator) if integrator != IntegratorName::default() && options.settings.frames.show.is_none() => {
                Technique::Frames(integrator)
            }
            _ => options.settings.frames.show.map_or(Technique::Preset(preset), Technique::Buffer),
        };
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
            settings: options.settings.clone(),
            lighting: options.settings.lighting.clone(),
            first,
            second: Second::Truth,
            truth: Technique::Converged,
            compares: false,
            arrangement: Arrangement::Single,
            shows_second: false,
            panes: Default::default(),
            comparison: None,
            control: None,
            followed: None,
            bookmarks: Vec::new(),
            turntable: 0.0,
            frame_rate: options.frame_rate,
            is_paused: false,
            playback: Playback { animation: None, runs: false, time: 0.0, speed: 1.0, repeats: true },
            pick: None,
            loading: None,
            devices: Vec::new(),
            failure: None,
            messages: VecDeque::new(),
            dialog: None,
            browsing: None,
            shows_help: false,
            shows_panel: true,
            frames: VecDeque::new(),
            copied: None,
            closes: false,
            default_frame_rate: options.frame_rate.unwrap_or(super::CPU_FRAME_RATE),
            tasks: Vec::new(),
            size: [0; 2],
            layers: Vec::new(),
            renders: Vec::new(),
        };
        if let Some(scene) = &options.scene {
            app.open(scene);
        }
        app
    }

    /// Opens a scene.
    pub fn open(&mut self, source: &str) {
        self.last_load += 1;
        self.load = self.last_load;
        self.source = Some(source.to_owned());
        (self.modified, self.failure) = (None, None);
        self.loading = Some((format!("loading {source}"), None));
    }

    /// Stops loading: the scene before stays.
    pub fn cancel_loading(&mut self) {
        self.loading = None;
        self.load = self.loaded;
        self.source = self.scene.as_ref().map(|s| s.source.clone());
        self.modified = None;
        self.report("loading was cancelled", false);
    }

    /// Returns true if a scene is being loaded that can be cancelled: not the images of one that is shown.
    pub fn can_cancel_loading(&self) -> bool {
        self.loading.is_some() && self.load != self.loaded
    }

    /// Loads the scene anew; the camera stays.
    pub fn reload(&mut self) {
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

    /// A frame of the user interface, and what it requests of the renderer.
    pub fn frame(&mut self, context: &egui::Context) {
        self.receive(context);
        self.watch_files(context);
        self.watch_renders(context);
        self.advance(context);
        self.layers.clear();
        panels::show(self, context);
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
                    if self.scene.is_none() {
                        self.failure = Some(text);
                    }
                }
                Event::Camera(camera, openness) => {
                    if let (None, Some(scene)) = (&self.control, self.scene.clone()) {
                        let control = CameraControl::new(*camera, scene.bounds);
                        let ao = &mut self.settings.integrators.ao;
                        let radius = match ao.ao_radius {
                            Some(Length::Units(units)) => Some(units),
                            Some(share @ Length::OfDiagonal(_)) => share.units(control.scene_size()).map(panels::round),
                            // in a closed room every ray hits something: without a radius it would be black
                            chosen => openness.and_then(|o| o.limit(chosen.is_some())),
                        };
                        let is_chosen = !matches!(ao.ao_radius, Some(Length::Units(_)));
                        ao.ao_radius = radius.map(Length::Units);
                        if let (true, Some(radius)) = (is_chosen, radius) {
                            self.report(format!("AO radius {radius}, by what the camera sees"), false);
                        }
                        self.control = Some(control);
                    }
                }
                Event::Device(device) => self.device = device,
                Event::Devices(names) => self.devices = names,
                Event::Picture(progress) => {
                    self.failure = None;
                    let (pane, progress) = (progress.pane, Arc::new(*progress));
                    if pane == 0 {
                        self.frames.push_back(progress.clone());
                        while self.frames.len() > KEPT_FRAMES {
                            self.frames.pop_front();
                        }
                    }
                    self.panes[pane] = PaneState { progress: Some(progress), error: None };
                }
                Event::PaneError(pane, error) => {
                    self.panes[pane].error = error;
                }
                Event::Idle(number) => self.idle = number,
                Event::Compared(comparison) => self.comparison = Some(comparison),
                Event::Picked(purpose, pick) => self.picked(purpose, *pick),
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
        let is_same = self.scene.as_ref().is_some_and(|s| s.source == summary.source);
        let lacked_images = self.scene.as_ref().is_some_and(|s| s.load == summary.load && !s.is_complete);
        let what = match lacked_images && summary.is_complete {
            true => format!("loaded the images of {}", summary.source),
            false => format!("loaded {}: {} primitives in {:.2} s", summary.source, summary.primitives, summary.seconds),
        };
        self.report(what, false);
        super::recent::add(&mut self.recent, &summary.source);
        self.loaded = summary.load;
        self.loading = (!summary.is_complete).then(|| ("loading images".to_owned(), None));
        self.panes.iter_mut().for_each(|p| p.error = None);
        if !is_same {
            (self.control, self.followed, self.pick, self.comparison) = (None, None, None, None);
            self.playback = Playback { animation: None, runs: false, time: 0.0, ..self.playback };
            self.panes = Default::default();
            self.bookmarks.clear();
            self.turntable = 0.0;
            self.sent.camera = None;
        }
        self.scene = Some(summary);
    }

    fn picked(&mut self, purpose: PickPurpose, pick: Option<Pick>) {
        match (purpose, pick) {
            (PickPurpose::Describe, pick) => self.pick = pick,
            (PickPurpose::Focus, Some(pick)) => {
                if let Some(control) = &mut self.control {
                    control.focus(pick.position);
                    self.followed = None;
                }
            }
            (PickPurpose::Focus, None) => {}
        }
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
            self.reload();
        }
    }

    /// Time passes: the animation, the turntable.
    fn advance(&mut self, context: &egui::Context) {
        let seconds = f64::from(context.input(|i| i.stable_dt.min(0.1)));
        if let (Some(k), true) = (self.playback.animation, self.playback.runs) {
            self.playback.time += seconds * self.playback.speed;
            let duration = self.scene.as_ref().and_then(|s| s.animations.get(k)).map_or(0.0, |a| a.1);
            if self.playback.time >= duration {
                (self.playback.time, self.playback.runs) = match self.playback.repeats && duration > 0.0 {
                    true => (self.playback.time.rem_euclid(duration), true),
                    false => (duration, false),
                };
            }
            context.request_repaint();
        }
        if let (Some(control), true) = (&mut self.control, self.turntable != 0.0) {
            control.turntable(self.turntable * seconds);
            self.followed = None;
            context.request_repaint();
        }
    }

    /// Sends what has changed.
    fn send(&mut self) {
        let mut panes = vec![self.first.settings(&self.settings)];
        if let (Second::Technique(t), true) = (self.second, self.needs_second()) {
            panes.push(t.settings(&self.settings));
        }
        let shown = panes.len();
        if self.compares_now() {
            let mut truth = self.truth.settings(&self.settings);
            if panes[0].realtime_setting().is_some() {
                // what differs shall not be the samples' place in the pixel
                let is_antialiased = frame_settings(&panes[0]).is_ok_and(|s| s.antialias);
                if truth.realtime_setting().is_some() {
                    truth.frames.antialias = Some(if is_antialiased { Antialias::On } else { Antialias::Off });
                } else if !is_antialiased {
                    truth.image.pixel_filter = Some(PixelFilter::Centre);
                }
            }
            panes.push(truth);
        }
        let request = Request {
            scene: self.source.clone(),
            load: self.load,
            device: self.device_settings.clone(),
            meaning: self.settings.scene.clone(),
            lighting: self.lighting.clone(),
            animation: self.playback.animation,
            time: self.playback.time,
            camera: self.control.as_ref().map(|c| c.camera().clone()),
            first_camera: self.settings.camera.clone(),
            followed_camera: self.followed,
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
        let panes_changed = request.panes != self.sent.panes;
        if panes_changed || request.camera != self.sent.camera || request.size != self.sent.size {
            self.comparison = None;
        }
        if panes_changed {
            self.panes.iter_mut().for_each(|p| p.error = None);
        }
        let tasks = std::mem::take(&mut self.tasks);
        self.sent = request.clone();
        self.sent_number = self.mailbox.change(|r| {
            // what was to be done with another scene is not done with this one
            let before = if r.load == request.load { std::mem::take(&mut r.tasks) } else { Vec::new() };
            *r = request;
            r.tasks = before.into_iter().chain(tasks).collect();
        });
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
        let of = |k: usize| self.panes[k].progress.as_ref().map(|p| p.picture.clone());
        match (is_second, self.second) {
            (false, _) => of(0),
            (true, Second::Technique(_)) => of(1),
            (true, Second::Truth) => of(TRUTH),
            (true, Second::HeatMap) => self.comparison.as_ref().map(|c| c.heat_map.clone()),
        }
    }

    /// Name of the first image, or of the second.
    pub fn title(&self, is_second: bool) -> String {
        match (is_second, self.second) {
            (false, _) => self.first.label(),
            (true, Second::Technique(t)) => t.label(),
            (true, Second::Truth) => format!("Truth: {}", self.truth.label()),
            (true, Second::HeatMap) => format!("FLIP against {}", self.truth.label()),
        }
    }

    /// Returns true while an image is not yet what its name says: another technique was chosen, and its first picture is to come.
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
            (true, _) => self.truth.label(),
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

    /// Error of the first image, or of the second.
    pub fn error(&self, is_second: bool) -> Option<&String> {
        self.panes[self.pane(is_second)].error.as_ref()
    }

    /// Settings of the image in front, with the lights that apply to it.
    pub fn shown_settings(&self) -> RenderSettings {
        let technique = match (self.shows_second, self.second) {
            (true, Second::Technique(t)) => t,
            (true, _) => self.truth,
            (false, _) => self.first,
        };
        let mut settings = technique.settings(&self.settings);
        settings.lighting = self.lighting.clone();
        let lit = settings.integrator().get().capabilities().contains(&crate::settings::Capability::SceneLights);
        if !lit {
            settings.lighting = LightingSettings::default();
        }
        settings
    }

    /// The command that renders what is shown.
    pub fn command(&self) -> Option<String> {
        let (scene, control) = (self.scene.as_ref()?, self.control.as_ref()?);
        Some(render_flags(&scene.source, &self.shown_settings(), &scene.cameras, control.camera(), self.size))
    }

    /// The frame rate to hold unless another is chosen.
    pub fn default_frame_rate(&self) -> f64 {
        self.default_frame_rate
    }

    /// Runs `skylit render` with what is shown, these options and this output, as a program of its own.
    pub fn render(&mut self, output: &str, options: &[String]) {
        let (Some(scene), Some(control)) = (&self.scene, &self.control) else { return };
        let mut settings = self.shown_settings();
        settings.image.size = Some(self.size);
        settings.camera = crate::renderer::interactive::camera_settings(&scene.cameras, control.camera());
        if settings.realtime_setting().is_none() && settings.image.spp.is_none() {
            settings.image.spp = Some(self.settings.image.spp.unwrap_or(64));
        }
        let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("skylit"));
        let child = std::process::Command::new(program)
            .arg("render")
            .arg(&scene.source)
            // defaults are among the settings already
            .args(["--quiet", "--no-config", "-o", output])
            .args(settings.flags())
            .args(options)
            .stdin(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped())
            .spawn();
        match child {
            Ok(child) => {
                self.report(format!("rendering {output}"), false);
                self.renders.push((output.to_owned(), child));
            }
            Err(e) => self.report(format!("cannot start skylit render: {e}"), true),
        }
    }

    /// Renders that are under way.
    pub fn renders(&self) -> impl Iterator<Item = &str> {
        self.renders.iter().map(|(output, _)| output.as_str())
    }

    fn watch_renders(&mut self, context: &egui::Context) {
        let (mut messages, mut running) = (Vec::new(), Vec::new());
        for (output, mut child) in std::mem::take(&mut self.renders) {
            match child.try_wait() {
                Ok(None) => running.push((output, child)),
                Ok(Some(status)) if status.success() => messages.push((format!("rendered {output}"), false)),
                Ok(Some(_)) => {
                    let mut text = String::new();
                    if let Some(mut stderr) = child.stderr.take() {
                        // without it there is the exit code
                        let _ = std::io::Read::read_to_string(&mut stderr, &mut text);
                    }
                    messages.push((format!("{output}: {}", text.trim().trim_start_matches("skylit: error: ")), true));
                }
                Err(e) => messages.push((format!("{output}: {e}"), true)),
            }
        }
        self.renders = running;
        messages.into_iter().for_each(|(text, is_error)| self.report(text, is_error));
        if !self.renders.is_empty() {
            context.request_repaint_after(Duration::from_millis(200));
        }
    }

    /// Frames per second, median and 95th percentile of frame times in milliseconds, and rays per second, of the last frames of the first image.
    pub fn figures(&self) -> Option<Figures> {
        let ms: Vec<f64> = self.frames.iter().map(|p| 1e3 * p.time.as_secs_f64()).collect();
        let median = crate::measure::stats::median(&ms)?;
        let p95 = crate::measure::stats::percentile(&ms, 0.95)?;
        let rays: u64 = self.frames.iter().map(|p| p.step.rays[0] + p.step.rays[1]).sum();
        let seconds = ms.iter().sum::<f64>() * 1e-3;
        Some(Figures { median, p95, rays_per_second: rays as f64 / seconds.max(1e-9) })
    }
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
