//! The thread that loads scenes and renders what the window requests.

mod black;
mod compare;
mod loader;
mod outline;
mod pane;
mod summary;

use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use loader::{Loaded, Loader};
use pane::{Pacing, Pane};
use summary::summary;

use super::hierarchy::{self, FoundHierarchy, HierarchyKey, SceneHierarchy};
use super::request::{
    Comparison, DeviceSummary, Event, EventSender, Mailbox, Outline, Progress, Request, SceneSummary, TRUTH, Task,
};
use crate::error::{Error, Result};
use crate::film::{Control, NoControl};
use crate::gpu::{self, Device};
use crate::integrators::lighting::LightingSettings;
use crate::output::{self, ImageFormat};
use crate::renderer::interactive::View;
use crate::renderer::survey::Survey;
use crate::renderer::{Interactive, Renderer, brightness};
use crate::scene::load::LoadOptions;
use crate::scene::{Camera, Scene, SceneSettings};
use crate::settings::Capability;
use crate::terminal::panic;
use crate::tracer::{DeviceSettings, TracerKind};

/// Time without motion after which the view rests.
const REST: Duration = Duration::from_millis(150);
/// Share of a frame's time, at the frame rate to hold, in which it is to be rendered: an input
/// waits for half of the previous frame on average, and the window takes its part.
const SHARE: f64 = 0.6;
/// Least time between two comparisons.
const COMPARISON: Duration = Duration::from_millis(700);
/// Time after which geometry is shown whose images are still being loaded.
const PATIENCE: Duration = Duration::from_millis(500);
/// Samples per pixel from which an exposure is chosen: fewer leave many pixels black.
const EXPOSURE_SAMPLES: u32 = 4;
/// Panes that are kept when they are no longer shown.
const PARKED: usize = 2;
/// A comparison may take this share of the time.
const COMPARISON_SHARE: u32 = 5;

/// Starts the thread. `load`: how scenes are loaded.
///
/// # Errors
/// [`Error::OutOfMemory`] when there can be no further thread.
pub fn spawn(mailbox: Arc<Mailbox>, events: EventSender, load: LoadOptions<'static>) -> Result<JoinHandle<()>> {
    let run = move || {
        let reporter = events.clone();
        let worker = Worker {
            mailbox,
            events,
            load,
            open: None,
            device_losses: 0,
            listed_devices: false,
            lighting: LightingSettings::default(),
        };
        // the window stays open and says so
        if let Err(bug) = panic::catch(move || worker.run()) {
            reporter.send(Event::Failed(bug));
        }
    };
    std::thread::Builder::new()
        .name("renderer".into())
        .spawn(run)
        .map_err(|e| Error::OutOfMemory(format!("the thread that renders cannot be started: {e}")))
}

struct Worker {
    mailbox: Arc<Mailbox>,
    events: EventSender,
    load: LoadOptions<'static>,
    open: Option<OpenScene>,
    device_losses: u32,
    listed_devices: bool,
    /// Lights that could be had last.
    lighting: LightingSettings,
}

/// A loaded scene on a device.
struct OpenScene {
    renderer: Renderer,
    load: u64,
    device: DeviceSettings,
    /// Loader of its images, if they are still missing.
    loader: Option<Loader>,
    /// The hierarchy that was shown last, and of what it is.
    hierarchy: KnownHierarchy,
}

/// A hierarchy for the window, or why there is none; with what it depends on.
type KnownHierarchy = Option<(HierarchyKey, Result<Arc<SceneHierarchy>, String>)>;

impl Worker {
    fn run(mut self) {
        loop {
            let number = self.mailbox.number();
            let request = self.mailbox.peek();
            if request.quits {
                return;
            }
            let outcome = match self.prepare(&request) {
                Ok(false) => {
                    self.mailbox.wait(number, Duration::from_secs(60));
                    continue;
                }
                Ok(true) => self.session(&request),
                Err(e) => Err(e),
            };
            match outcome {
                Ok(()) | Err(Error::Interrupted) => self.device_losses = 0,
                Err(Error::DeviceLost(text)) if self.device_losses < 3 => {
                    self.device_losses += 1;
                    self.events.send(Event::Warning(format!("the Vulkan device was lost ({text}): started again")));
                    self.open = None;
                }
                Err(e) => {
                    self.events.send(Event::Failed(crate::terminal::console::one_line(&e.to_string())));
                    // what failed is tried again only if something else is requested
                    self.mailbox.wait(number, Duration::from_secs(3600));
                }
            }
        }
    }

    /// Loads the requested scene and opens the device, unless both are there. Returns false if
    /// there is nothing to render.
    fn prepare(&mut self, request: &Request) -> Result<bool> {
        let Some(source) = &request.scene else { return Ok(false) };
        if self.open.as_ref().is_some_and(|open| open.load == request.load) {
            self.take_images(source)?;
            return self.set_device(&request.device).map(|()| true);
        }
        self.events.send(Event::Loading(format!("loading {source}"), None));
        let start = Instant::now();
        let kept = self.open.as_ref().filter(|o| o.device == request.device).map(|o| o.renderer.device().clone());
        match self.load(source, request, kept) {
            Ok((device, scene, loader)) => {
                let summary = SceneSummary { load: request.load, ..summary(source, &scene, start.elapsed()) };
                // they come again with the images
                for warning in scene.report.warnings.iter().filter(|_| loader.is_none()) {
                    self.events.send(Event::Warning(warning.clone()));
                }
                // before the new one is uploaded: memory
                self.open = None;
                let renderer = Renderer::new(device, scene, &request.device)?.with_name(source);
                let (load, device, hierarchy) = (request.load, request.device.clone(), None);
                self.open = Some(OpenScene { renderer, load, device, loader, hierarchy });
                self.events.send(Event::Loaded(Box::new(summary)));
                self.list_devices();
                Ok(true)
            }
            Err(Error::Interrupted) => Err(Error::Interrupted),
            Err(e) => {
                self.events.send(Event::LoadFailed(request.load, crate::terminal::console::one_line(&e.to_string())));
                let Some(open) = &mut self.open else {
                    // nothing to go back to
                    self.wait_for(|r| r.load != request.load || r.quits || r.device != request.device);
                    return Err(Error::Interrupted);
                };
                // the old scene answers this request
                open.load = request.load;
                Ok(true)
            }
        }
    }

    /// Loads a scene while the device opens; without its images, if they take long: then what loads
    /// them is returned, too. [`Error::Interrupted`] if another one is requested meanwhile.
    fn load(
        &self,
        source: &str,
        request: &Request,
        device: Option<Arc<Device>>,
    ) -> Result<(Arc<Device>, Scene, Option<Loader>)> {
        let options = LoadOptions { geometry: request.geometry, ..self.load };
        let mut loader = Loader::start(source, request.gltf_scene.as_deref(), options, &self.mailbox, &self.events)?;
        let device = match device {
            Some(device) => Ok(device),
            None => Device::open(&request.device.options()),
        };
        let mut geometry: Option<(Instant, Scene)> = None;
        loop {
            if self.mailbox.is(|r| r.load != request.load || r.scene != request.scene || r.quits) || loader.has_ended()
            {
                return Err(Error::Interrupted);
            }
            match loader.next(Duration::from_millis(10)).transpose()? {
                Some(Loaded::Scene(scene)) => return Ok((device?, scene, None)),
                Some(Loaded::Geometry(scene)) => geometry = Some((Instant::now(), scene)),
                None => {}
            }
            geometry = match geometry {
                Some((since, scene)) if since.elapsed() > PATIENCE => return Ok((device?, scene, Some(loader))),
                geometry => geometry,
            };
        }
    }

    /// Puts the scene with its images in place of its geometry alone, if they have been loaded.
    fn take_images(&mut self, source: &str) -> Result<()> {
        let Some(OpenScene { renderer, load, device, loader: Some(mut loader), hierarchy }) =
            self.open.take_if(|o| o.loader.is_some())
        else {
            return Ok(());
        };
        let start = Instant::now();
        match loader.next(Duration::ZERO) {
            Some(Ok(Loaded::Scene(scene))) => {
                let summary = SceneSummary { load, ..summary(source, &scene, start.elapsed()) };
                for warning in &scene.report.warnings {
                    self.events.send(Event::Warning(warning.clone()));
                }
                let open = renderer.device().clone();
                drop(renderer);
                let renderer = Renderer::new(open, scene, &device)?.with_name(source);
                // masks may leave surfaces out
                self.open = Some(OpenScene { renderer, load, device, loader: None, hierarchy: None });
                self.events.send(Event::Loaded(Box::new(summary)));
                return Ok(());
            }
            Some(Err(e)) => {
                let text = crate::terminal::console::one_line(&e.to_string());
                self.events.send(Event::LoadFailed(load, format!("images: {text}")));
                self.open = Some(OpenScene { renderer, load, device, loader: None, hierarchy });
                return Ok(());
            }
            Some(Ok(Loaded::Geometry(_))) | None => {}
        }
        let loader = (!loader.has_ended()).then_some(loader);
        self.open = Some(OpenScene { renderer, load, device, loader, hierarchy });
        Ok(())
    }

    /// Tells the window which devices there are, once.
    fn list_devices(&mut self) {
        if !std::mem::replace(&mut self.listed_devices, true) {
            let devices = gpu::Instance::new(false).and_then(|instance| gpu::enumerate(&instance)).unwrap_or_default();
            self.events
                .send(Event::Devices(devices.into_iter().map(|d| format!("{} ({})", d.name, d.driver)).collect()));
        }
    }

    /// Changes the tracer, or the device. Settings that the device does not support leave both as
    /// they were.
    fn set_device(&mut self, settings: &DeviceSettings) -> Result<()> {
        let Some(OpenScene { renderer, load, device: before, loader, hierarchy }) =
            self.open.take_if(|o| o.device != *settings)
        else {
            return Ok(());
        };
        let device = renderer.device().clone();
        let name = renderer.name().to_owned();
        let scene = renderer.into_scene();
        let opened =
            if before.options() == settings.options() { Ok(device.clone()) } else { Device::open(&settings.options()) };
        let chosen = opened.and_then(|device| settings.choose(&device.info).map(|(kind, _, _)| (device, kind)));
        let chosen = chosen.and_then(|(device, kind)| {
            if kind.is_supported_by(&device.info) {
                Ok(device)
            } else {
                Err(Error::Device(format!("tracer '{kind}' is not available on {}", device.info.name)))
            }
        });
        let renderer = match chosen {
            Ok(chosen) => Renderer::new(chosen, scene, settings)?,
            Err(e) => {
                self.events.send(Event::Warning(e.to_string()));
                Renderer::new(device, scene, &before)?
            }
        };
        let (renderer, device) = (renderer.with_name(&name), settings.clone());
        self.open = Some(OpenScene { renderer, load, device, loader, hierarchy });
        Ok(())
    }

    fn wait_for(&self, holds: impl Fn(&Request) -> bool) {
        loop {
            let number = self.mailbox.number();
            if self.mailbox.is(&holds) {
                return;
            }
            self.mailbox.wait(number, Duration::from_secs(60));
        }
    }

    /// Renders until something is requested for which the session must be prepared anew.
    fn session(&mut self, first: &Request) -> Result<()> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let tracer_reason = open.renderer.tracer_kind().1.to_owned();
        let loader = open.loader.as_ref();

        // an animation of the scene before, until the window knows of this one
        let animations = open.renderer.scene().rig.as_ref().map_or(0, |rig| rig.animations().len());
        let animation = first.animation.filter(|k| *k < animations);
        let (mailbox, events) = (&self.mailbox, &self.events);

        // a variant that the scene before had may not exist in this one
        let applied = open.renderer.apply_scene_settings(&first.meaning);
        let is_edited = applied.is_ok();
        if let Err(e) = applied {
            let without = SceneSettings { mtl_dissolve: first.meaning.mtl_dissolve, ..SceneSettings::default() };
            open.renderer.apply_scene_settings(&without)?;
            events.send(Event::Warning(e.to_string()));
        }
        // the light may be a file that cannot be read: then there is the one before
        let (mut first, mut refused) = (first.clone(), None);
        open.renderer.want_ground(first.ground.0, first.ground.1);
        let interactive = match open.renderer.interactive(&first.lighting, animation) {
            Ok(interactive) => {
                self.lighting = first.lighting.clone();
                interactive
            }
            Err(e @ (Error::Usage(_) | Error::Input { .. })) => {
                let lights = [first.lighting.clone(), self.lighting.clone()];
                events
                    .send(Event::LightingRefused(Box::new(lights), crate::terminal::console::one_line(&e.to_string())));
                refused = Some(std::mem::replace(&mut first.lighting, self.lighting.clone()));
                open.renderer.interactive(&first.lighting, animation)?
            }
            Err(e) => return Err(e),
        };

        // the session runs until another scene or device is requested
        let mut session = ViewerSession {
            mailbox,
            events,
            interactive,
            tracer_reason,
            loader,
            panes: Vec::new(),
            parked: Vec::new(),
            camera: None,
            time: 0.0,
            last_motion: Instant::now() - REST,
            compared: None,
            device: DeviceSummary::default(),
            chose_camera: false,
            first,
            refused,
            black: [Blackness::Unknown; TRUTH + 1],
            knows_exposure: false,
            outlined: None,
            is_edited,
            hierarchy: &mut open.hierarchy,
            has_sent_hierarchy: false,
        };
        session.run()
    }
}

/// Views of a scene, until another scene, device, light or animation is requested.
struct ViewerSession<'a> {
    mailbox: &'a Mailbox,
    events: &'a EventSender,
    interactive: Interactive<'a>,
    tracer_reason: String,
    loader: Option<&'a Loader>,
    panes: Vec<Pane>,
    /// Panes that were shown before in this view, the last one last.
    parked: Vec<Pane>,
    camera: Option<Camera>,
    time: f64,
    last_motion: Instant,
    /// When images were last compared, how long it took, and how many steps they had.
    compared: Option<(Instant, Duration, u64)>,
    device: DeviceSummary,
    /// The camera to start with was sent.
    chose_camera: bool,
    first: Request,
    /// Lights that were requested and could not be had.
    refused: Option<LightingSettings>,
    /// Knowledge whether each image at rest is black.
    black: [Blackness; TRUTH + 1],
    /// The exposure of the scene's own light was sent.
    knows_exposure: bool,
    /// Settings of materials and objects are in effect: the scene has all that they name.
    is_edited: bool,
    /// The instance whose outline was sent since the view has moved.
    outlined: Option<std::ops::Range<usize>>,
    /// The hierarchy that was shown last.
    hierarchy: &'a mut KnownHierarchy,
    /// It was sent, with the influence areas of these lights.
    has_sent_hierarchy: bool,
}

/// Whether an image at rest is black.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Blackness {
    Unknown,
    Black,
    Visible,
}

impl ViewerSession<'_> {
    fn run(&mut self) -> Result<()> {
        loop {
            let (request, number, changed) = self.mailbox.latest();
            if request.quits || !self.serves(&request) || self.loader.is_some_and(Loader::is_ready) {
                return Ok(());
            }
            self.move_to(&request)?;
            if !self.edit_materials(&request)? {
                return Ok(());
            }
            self.match_panes(&request);
            let Some(camera) = self.camera.clone().filter(|_| request.size != [0; 2]) else {
                self.choose_camera(&request)?;
                self.mailbox.wait(number, Duration::from_millis(50));
                continue;
            };
            for task in &request.tasks {
                let outcome = self.perform(task, &camera, &request);
                if !matches!(outcome, Ok(false) | Err(Error::DeviceLost(_))) {
                    self.mailbox.done(task);
                }
                outcome?;
            }

            // what goes with a view at rest, and the next step of an image
            let moves = self.last_motion.elapsed() < REST;
            if !moves {
                self.outline(&request, &camera)?;
                self.send_hierarchy(&request);
            }
            match self.next_pane(moves, &request) {
                Some(k) => self.step(k, &request, number, changed, &camera, moves)?,
                // what was moving comes to rest
                None if moves => self.mailbox.wait(number, REST),
                None => {
                    self.compare(&request, number, true)?;
                    self.events.send(Event::Idle(number));
                    self.mailbox.wait(number, Duration::from_secs(60));
                }
            }
            self.compare(&request, number, false)?;
        }
    }

    /// Returns true if this session can do what is requested.
    fn serves(&self, request: &Request) -> bool {
        // materials may be edited meanwhile
        let meaning = |r: &Request| SceneSettings { material: Vec::new(), ..r.meaning.clone() };
        let source = |r: &Request| (r.scene.clone(), r.load, r.device.clone(), meaning(r), r.animation, r.ground);
        let is_lit = request.lighting == self.first.lighting || Some(&request.lighting) == self.refused.as_ref();
        is_lit && source(request) == source(&self.first)
    }

    /// Moves the scene and the camera to where they are requested to be.
    fn move_to(&mut self, request: &Request) -> Result<()> {
        let has_moved = request.time != self.time && self.interactive.set_time(request.time)?;
        self.time = request.time;
        let followed = request.followed_camera.and_then(|k| self.interactive.animated_camera(k));
        let camera = followed.or_else(|| request.camera.clone());
        if has_moved || camera != self.camera {
            if self.camera.is_some() {
                self.last_motion = Instant::now();
            }
            self.restart();
        }
        self.camera = camera;
        Ok(())
    }

    /// Begins anew: all that was rendered before is of another view.
    fn restart(&mut self) {
        self.panes.iter_mut().for_each(Pane::restart);
        self.parked.clear();
        (self.compared, self.outlined) = (None, None);
        self.black = [Blackness::Unknown; TRUTH + 1];
    }

    /// Shows materials as they are requested. Returns false if the scene has to be prepared anew
    /// for them.
    fn edit_materials(&mut self, request: &Request) -> Result<bool> {
        let edits = &request.meaning.material;
        if self.interactive.edits() == edits || !self.is_edited {
            return Ok(true);
        }
        if !self.interactive.edit_materials(edits)? {
            return Ok(false);
        }
        self.last_motion = Instant::now();
        self.restart();
        Ok(true)
    }

    /// Sends the outline of what is selected, once for each view at rest.
    fn outline(&mut self, request: &Request, camera: &Camera) -> Result<()> {
        let Some(objects) = request.selected.clone().filter(|_| self.outlined != request.selected) else {
            self.outlined.take_if(|_| request.selected.is_none());
            return Ok(());
        };
        // before the first image there is nothing to be hit
        if self.interactive.build_stats().is_empty() {
            return Ok(());
        }
        let scene = self.interactive.scene();
        let bounds = request.animation.is_none().then(|| summary::bounds(scene, objects.clone())).flatten();
        let (size, time) = (request.size, request.time);
        let lines = outline::lines(&self.interactive, camera, &objects, bounds, size)?;
        self.outlined = Some(objects.clone());
        self.events.send(Event::Outline(Arc::new(Outline { objects, camera: camera.clone(), time, size, lines })));
        Ok(())
    }

    /// Sends the hierarchy, if it is wanted, once: it is built once for each scene and build.
    fn send_hierarchy(&mut self, request: &Request) {
        if !request.hierarchy || std::mem::replace(&mut self.has_sent_hierarchy, true) {
            return;
        }
        let key = HierarchyKey::of_request(request);
        let scene = self.interactive.scene();
        // poses refit the trees, and may move lights
        let is_at_rest = request.animation.is_none();
        let known = self.hierarchy.take().filter(|(of, _)| *of == key).map(|(_, tree)| tree);
        let tree = known.unwrap_or_else(|| {
            if is_at_rest {
                SceneHierarchy::build(scene, &request.device).map(Arc::new)
            } else {
                Err("The hierarchy is not shown while an animation is chosen: its poses refit the trees.".into())
            }
        });
        *self.hierarchy = Some((key.clone(), tree.clone()));
        let areas = if is_at_rest { hierarchy::areas(scene, request.aspect()) } else { Vec::new() };
        self.events.send(Event::Hierarchy(Box::new(FoundHierarchy { key, tree, areas })));
    }

    /// Creates the panes that are requested and keeps those that are there.
    fn match_panes(&mut self, request: &Request) {
        let size = request.size;
        for (k, settings) in request.panes.iter().enumerate() {
            match self.panes.get_mut(k) {
                Some(pane) if pane.is_of(settings, size) => {}
                Some(pane) => {
                    let kept = self.parked.iter().position(|parked| parked.is_of(settings, size));
                    let mut new = kept.map_or_else(|| Pane::new(settings, size), |at| self.parked.remove(at));
                    new.inherit_pace(pane);
                    self.parked.push(std::mem::replace(pane, new));
                    self.compared = None;
                    self.black[request.pane(k)] = Blackness::Unknown;
                }
                None => {
                    let kept = self.parked.iter().position(|parked| parked.is_of(settings, size));
                    self.panes.push(kept.map_or_else(|| Pane::new(settings, size), |at| self.parked.remove(at)));
                }
            }
        }

        // samples of what is not shown any more are kept, as long as the view does not change
        let most = request.panes.len().min(self.panes.len());
        self.parked.extend(self.panes.drain(most..));
        self.parked.retain(|pane| pane.is_of_size(size) && !pane.has_failed());
        let forgotten = self.parked.len().saturating_sub(PARKED);
        self.parked.drain(..forgotten);
    }

    /// The pane to step next: while something moves those on the screen in turn, else the one that
    /// was given the least time.
    fn next_pane(&self, moves: bool, request: &Request) -> Option<usize> {
        let due = self.panes.iter().enumerate().filter(|(_, p)| !p.has_failed() && !request.is_paused);
        if moves {
            due.filter(|(k, _)| *k < request.shown).min_by_key(|(_, p)| p.steps()).map(|(k, _)| k)
        } else {
            due.filter(|(_, p)| !p.is_idle()).min_by_key(|(_, p)| p.spent()).map(|(k, _)| k)
        }
    }

    fn step(
        &mut self,
        k: usize,
        request: &Request,
        number: u64,
        changed: Instant,
        camera: &Camera,
        moves: bool,
    ) -> Result<()> {
        // one step, which a change of the request ends early
        let frame_time = request.frame_rate.map(|rate| Duration::from_secs_f64(SHARE / rate.max(0.1)));
        let mut control = StopOnChange { mailbox: self.mailbox, request, moves };
        let pane = &mut self.panes[k];
        let pacing = Pacing { moves, frame_time };

        // what it showed goes to the window; an error is shown in its place
        match pane.step(&mut self.interactive, camera, &pacing, &mut control) {
            Ok((step, time)) => {
                let Some(picture) = pane.shown().map(|v| v.picture()).transpose()?.flatten() else { return Ok(()) };
                let is_black = !moves && black::is_black(&picture);
                let samples = step.samples;
                let progress = Progress {
                    pane: request.pane(k),
                    picture: Arc::new(picture),
                    camera: Some(camera.clone()),
                    step,
                    time,
                    latency: changed.elapsed(),
                    request: number,
                };
                self.events.send(Event::Picture(Box::new(progress)));
                if !moves {
                    self.explain_black(k, request, camera, is_black)?;
                    self.choose_exposure(k, request, samples)?;
                }
                if self.panes[k].steps() == 1 {
                    self.events.send(Event::PaneError(request.pane(k), None));
                    self.interactive.device().save_pipeline_cache();
                }
            }
            Err(Error::Interrupted) => {}
            Err(e @ (Error::DeviceLost(_) | Error::OutOfMemory(_))) => return Err(e),
            Err(e) => {
                pane.fail();
                self.events
                    .send(Event::PaneError(request.pane(k), Some(crate::terminal::console::one_line(&e.to_string()))));
            }
        }

        let messages = self.interactive.device().validation_messages().into_iter().map(|m| format!("validation: {m}"));
        for warning in self.interactive.take_warnings().into_iter().chain(messages) {
            self.events.send(Event::Warning(warning));
        }
        self.describe_device();
        Ok(())
    }

    /// Says why an image at rest is black, once for each place; and that it is no longer.
    fn explain_black(&mut self, k: usize, request: &Request, camera: &Camera, is_black: bool) -> Result<()> {
        let pane = request.pane(k);
        let now = if is_black { Blackness::Black } else { Blackness::Visible };
        if std::mem::replace(&mut self.black[pane], now) == now {
            return Ok(());
        }
        let reason = if is_black {
            let values = self.panes[k].shown().map(View::values).transpose()?.unwrap_or_default().values;
            let brightest = values.into_iter().fold(0.0, f32::max);
            black::reason(&self.interactive, camera, request.aspect(), &request.panes[k], brightest)?
        } else {
            None
        };
        self.events.send(Event::Black(pane, reason));
        Ok(())
    }

    /// Sends the exposure that the scene's own light needs, once a view of it has some samples.
    fn choose_exposure(&mut self, k: usize, request: &Request, samples: u32) -> Result<()> {
        let is_lit = request.panes[k].integrator().get().capabilities().contains(&Capability::SceneLights);
        let is_due = !self.knows_exposure && k == 0 && is_lit && samples >= EXPOSURE_SAMPLES;
        // without its images the scene has other colours
        if !is_due || !self.interactive.shows_own_light() || self.loader.is_some() {
            return Ok(());
        }
        let Some(values) = self.panes[k].shown().map(View::values).transpose()? else { return Ok(()) };
        if values.channels == 3 {
            self.knows_exposure = true;
            let stops = brightness::exposure(&values.values, &values.coverage);
            self.events.send(Event::Exposure(request.load, stops));
        }
        Ok(())
    }

    /// Finds another camera if this one sees nothing but black.
    fn check_view(&mut self, camera: &Camera, request: &Request, frames: bool) -> Result<()> {
        let Some(settings) = request.panes.first() else { return Ok(()) };
        let (aspect, scene) = (request.aspect(), self.interactive.scene());
        let automatic = self.interactive.automatic_camera(aspect, &mut NoControl)?;
        let framed = scene.bounds().map(|(lo, hi)| Camera::framing(lo, hi, aspect));
        let cameras =
            [camera.clone(), automatic].into_iter().chain(scene.cameras.first().cloned()).chain(framed).collect();
        let visible = black::first_visible(&mut self.interactive, settings, aspect, cameras, frames, &mut NoControl)?;
        if let Some(visible) = visible.filter(|visible| visible != camera) {
            self.events.send(Event::Framed(Box::new([camera.clone(), visible])));
        }
        Ok(())
    }

    fn describe_device(&mut self) {
        let info = &self.interactive.device().info;
        let stats = self.interactive.build_stats();
        let lacks = |kind: &TracerKind| {
            (!kind.is_supported_by(info)).then(|| (kind.name().to_owned(), kind.needs(info).missing.join(", ")))
        };
        let summary = DeviceSummary {
            name: format!("{} ({})", info.name, info.driver),
            index: info.index,
            tracer: (self.interactive.tracer_kind().name().to_owned(), self.tracer_reason.clone()),
            unavailable: TracerKind::ALL.iter().filter_map(lacks).collect(),
            bytes: stats.iter().map(|s| s.structure_bytes + s.scene_bytes).sum(),
            build_seconds: stats.iter().map(|s| s.build_seconds + s.upload_seconds).sum(),
        };
        if summary != self.device {
            self.device = summary.clone();
            self.events.send(Event::Device(summary));
        }
    }

    /// Chooses the camera to start with, by what it would see.
    fn choose_camera(&mut self, request: &Request) -> Result<()> {
        if self.chose_camera || request.camera.is_some() || request.size == [0; 2] {
            return Ok(());
        }
        let aspect = request.aspect();
        let given = &request.first_camera;
        let chosen = match given.chooses().then(|| given.choose(&Survey::new(self.interactive.scene()), aspect)) {
            Some(Err(e)) => {
                self.events.send(Event::Warning(e.to_string()));
                None
            }
            given => given.transpose()?,
        };
        let camera = match chosen {
            Some(camera) => camera,
            None => self.interactive.choose_camera(aspect, &mut NoControl)?,
        };
        self.chose_camera = true;
        let openness = self.interactive.openness(&camera, aspect, &mut NoControl)?;
        self.events.send(Event::Camera(Box::new(camera), openness));
        Ok(())
    }

    /// Performs a task, unless it has to wait for an image: then it returns false.
    fn perform(&mut self, task: &Task, camera: &Camera, request: &Request) -> Result<bool> {
        match task {
            Task::CheckView { frames } => match self.check_view(camera, request, *frames) {
                // the settings cannot be rendered, which the image says
                Err(Error::Usage(_)) => {}
                outcome => outcome?,
            },
            // of a scene that is being rebuilt, say for another environment
            Task::Pick { .. } if !self.interactive.is_traced() && self.next_pane(false, request).is_some() => {
                return Ok(false);
            }
            Task::Pick { at, purpose } => {
                self.interactive.trace(&mut NoControl)?;
                let pick = self.interactive.pick(camera, *at, request.aspect())?;
                self.events.send(Event::Picked(*purpose, Box::new(pick)));
            }
            // of a new tracer, say
            Task::Save { pane, .. } if !request.is_paused && self.panes.get(*pane).is_some_and(Pane::is_to_come) => {
                return Ok(false);
            }
            Task::Save { pane, path } => {
                let saved = match self.save(*pane, path) {
                    Err(e @ Error::DeviceLost(_)) => return Err(e),
                    saved => saved.map(|()| path.clone()).map_err(|e| e.to_string()),
                };
                self.events.send(Event::Saved(saved));
            }
        }
        Ok(true)
    }

    fn save(&self, pane: usize, path: &Path) -> Result<()> {
        let none = || Error::Usage("there is no image to save yet".into());
        let view = self.panes.get(pane).and_then(Pane::shown).ok_or_else(none)?;
        match ImageFormat::from_path(path)? {
            ImageFormat::Exr => output::save(&view.image(&self.interactive, &mut NoControl)?, path),
            _ => view.picture()?.ok_or_else(none)?.save(path),
        }
    }

    /// Compares the first image with the last, if that is requested and both have changed; not too
    /// often unless it is the `last` time.
    fn compare(&mut self, request: &Request, number: u64, last: bool) -> Result<()> {
        if !request.compares || self.panes.len() < 2 || self.last_motion.elapsed() < REST {
            return Ok(());
        }
        let (Some(image), Some(truth)) = (self.panes[0].rest(), self.panes[self.panes.len() - 1].rest()) else {
            return Ok(());
        };
        let steps = self.panes[0].steps() + self.panes[self.panes.len() - 1].steps();
        let is_due = match self.compared {
            None => true,
            Some((_, _, before)) if before == steps => false,
            Some((at, took, _)) => last || at.elapsed() > COMPARISON.max(took * COMPARISON_SHARE),
        };
        if !is_due || image.size() != truth.size() {
            return Ok(());
        }
        let start = Instant::now();
        let comparison = compare::compare(&image.values()?, &truth.values()?, truth.samples())?;
        self.events.send(Event::Compared(Box::new(Comparison { request: number, ..comparison })));
        self.compared = Some((Instant::now(), start.elapsed(), steps));
        Ok(())
    }
}

/// Stops a step when it would be of no use any more. While something moves frames are short and are
/// finished: else a fast motion would show none.
struct StopOnChange<'a> {
    mailbox: &'a Mailbox,
    request: &'a Request,
    moves: bool,
}

impl Control for StopOnChange<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        let target = |r: &Request| (r.load, r.size, r.quits);
        let moved = |r: &Request| r.camera != self.request.camera || r.time != self.request.time;
        let other = |r: &Request| {
            target(r) != target(self.request) || r.device != self.request.device || r.panes != self.request.panes
        };
        let is_useless = self.mailbox.is(|r| other(r) || !self.moves && moved(r));
        if is_useless { Err(Error::Interrupted) } else { Ok(false) }
    }
}
