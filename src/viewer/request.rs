//! Messages between the window and the thread that renders: requests, of which the latest counts,
//! and events.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use glam::DVec3;

use super::hierarchy::FoundHierarchy;
use crate::integrators::lighting::LightingSettings;
use crate::renderer::RenderSettings;
use crate::renderer::interactive::{Pick, ViewPicture, ViewStep};
use crate::renderer::settings::CameraSettings;
use crate::renderer::survey::radius::Openness;
use crate::scene::load::GeometryOptions;
use crate::scene::{Camera, Ground, Material, NodeTree, SceneSettings};
use crate::tracer::DeviceSettings;

/// Index of an image: the first, the second or the truth ([`TRUTH`]).
pub type Pane = usize;

/// Index of the truth.
pub const TRUTH: Pane = 2;

/// Scene, settings and size of what is to be rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// The scene, a file or `builtin:NAME`; none before one is opened.
    pub scene: Option<String>,
    /// Which scene of a glTF file; none: the one that the file names.
    pub gltf_scene: Option<String>,
    /// Normals and texture coordinates that are not the file's.
    pub geometry: GeometryOptions,
    /// Incremented to load the scene anew.
    pub load: u64,
    /// Device and tracer.
    pub device: DeviceSettings,
    /// Meaning of the scene's file.
    pub meaning: SceneSettings,
    /// Lights beside the scene's.
    pub lighting: LightingSettings,
    /// The ground under the scene, and its height.
    pub ground: (Ground, Option<f64>),
    /// The animation to play, an index.
    pub animation: Option<usize>,
    /// Time of the animation, seconds.
    pub time: f64,
    /// The camera; `None` until the scene has been loaded.
    pub camera: Option<Camera>,
    /// Settings of the camera to start with.
    pub first_camera: CameraSettings,
    /// Index of the file's camera that the animation moves, if the view follows it.
    pub followed_camera: Option<usize>,
    /// The instances whose outline is wanted, indices.
    pub selected: Option<Range<usize>>,
    /// Hierarchy and influence areas are wanted.
    pub hierarchy: bool,
    /// Images to render: those on the screen, then the truth.
    pub panes: Vec<RenderSettings>,
    /// Number of images on the screen, which are rendered while something moves.
    pub shown: usize,
    /// Width and height of the view, in pixels.
    pub size: [u32; 2],
    /// Frame rate to hold while something moves, frames per second; `None`: full resolution always.
    pub frame_rate: Option<f64>,
    /// Compare the first image with the last.
    pub compares: bool,
    /// Render nothing.
    pub is_paused: bool,
    /// Work to be done once.
    pub tasks: Vec<Task>,
    /// End the thread.
    pub quits: bool,
}

impl Request {
    /// Which image the entry `k` of [`Request::panes`] is.
    pub fn pane(&self, k: usize) -> Pane {
        if k < self.shown { k } else { TRUTH }
    }

    /// Returns true if another request is of the same scene in the same pose and light, seen by the
    /// same camera at the same size on the same device.
    pub fn shows_same_view(&self, other: &Self) -> bool {
        let view = |r: &Self| (r.load, r.animation, r.time, r.followed_camera, r.size, r.ground);
        let lit =
            |r: &Self| (r.scene.clone(), r.meaning.clone(), r.device.clone(), r.lighting.clone(), r.camera.clone());
        view(self) == view(other) && lit(self) == lit(other)
    }

    /// Width over height of the view.
    pub fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }
}

/// Work to be done once.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Find what is at a point of the view, from (0, 0) at the top left to (1, 1).
    Pick {
        /// The point.
        at: [f64; 2],
        /// Purpose of the pick.
        purpose: PickPurpose,
    },
    /// Find a camera that sees something, if this one sees nothing or all of it is black.
    CheckView {
        /// Whether it is to show the scene from its front, too: it was framed, not chosen.
        frames: bool,
    },
    /// Save an image with all its channels.
    Save {
        /// The image.
        pane: Pane,
        /// A file of one of the kinds of [`crate::output::ImageFormat`].
        path: PathBuf,
    },
}

/// Purpose that a point was picked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PickPurpose {
    /// The point is described.
    Describe,
    /// The camera looks at the point.
    Focus,
    /// The camera flies at a speed that suits the distance of the point.
    Nearness,
}

/// Report of the renderer to the window.
#[derive(Debug)]
pub enum Event {
    /// A scene is being loaded: what is being done, and the share that is done, if that is known.
    Loading(String, Option<f32>),
    /// A scene was loaded.
    Loaded(Box<SceneSummary>),
    /// The camera to start with was chosen, and whether it is inside a room.
    Camera(Box<Camera>, Option<Openness>),
    /// The first camera sees nothing but black, the second shows something.
    Framed(Box<[Camera; 2]>),
    /// These lights could not be had: those that are in effect instead, and why.
    LightingRefused(Box<[LightingSettings; 2]>, String),
    /// Why an image that is black is black; `None` once it is not.
    Black(Pane, Option<String>),
    /// Exposure at which the scene of this [`Request::load`] shows in its own light, in stops;
    /// `None` where it does so without one.
    Exposure(u64, Option<f64>),
    /// The scene of this [`Request::load`] could not be loaded; the previous one stays.
    LoadFailed(u64, String),
    /// Names of the Vulkan devices, by index.
    Devices(Vec<String>),
    /// A tracer was built or replaced.
    Device(DeviceSummary),
    /// A step of an image.
    Picture(Box<Progress>),
    /// An image cannot be rendered, or can again.
    PaneError(Pane, Option<String>),
    /// The first image was compared with the last.
    Compared(Box<Comparison>),
    /// Nothing is left to do for the request of this number.
    Idle(u64),
    /// A point was picked.
    Picked(PickPurpose, Box<Option<Pick>>),
    /// The outline of what is selected was found, seen by a camera at rest.
    Outline(Arc<Outline>),
    /// The scene's hierarchy, if it is wanted.
    Hierarchy(Box<FoundHierarchy>),
    /// A file was written, or an error.
    Saved(Result<PathBuf, String>),
    /// A message for the user.
    Warning(String),
    /// No further images: the reason.
    Failed(String),
}

/// Figures of a scene that the window shows.
#[derive(Clone, Debug, Default)]
pub struct SceneSummary {
    /// [`Request::load`] that it answers.
    pub load: u64,
    /// The scene's images are there, too; else they follow.
    pub is_complete: bool,
    /// The file, or `builtin:NAME`.
    pub source: String,
    /// The files that it was read from.
    pub files: Vec<PathBuf>,
    /// Bounds in world space, scene units.
    pub bounds: (DVec3, DVec3),
    /// Cameras of the scene.
    pub cameras: Vec<Camera>,
    /// Names and durations, in seconds, of its animations.
    pub animations: Vec<(String, f64)>,
    /// Names of the scenes of its file, if it is a glTF file.
    pub scenes: Vec<String>,
    /// Names of variants of its materials.
    pub variants: Vec<String>,
    /// Names of textures.
    pub textures: Vec<String>,
    /// Instances of the scene, by index.
    pub objects: Arc<Vec<ObjectSummary>>,
    /// The nodes that they are below.
    pub nodes: Arc<NodeTree>,
    /// Names of lights, or their kinds.
    pub lights: Vec<String>,
    /// Materials of the scene as they are without edits, by index.
    pub materials: Arc<Vec<Material>>,
    /// Number of triangles and spheres over all instances.
    pub primitives: u64,
    /// Number of instances, meshes, materials and lights.
    pub counts: [usize; 4],
    /// Seconds that loading took.
    pub seconds: f64,
}

/// An instance of a mesh, as the window lists it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectSummary {
    /// Name of its node; may be empty.
    pub name: String,
    /// Index of its mesh, and the mesh's name.
    pub mesh: (usize, Arc<str>),
    /// Index of its material.
    pub material: usize,
    /// Triangles or spheres.
    pub primitives: usize,
    /// Bounds in world space, scene units; `None` where it has no geometry.
    pub bounds: Option<(DVec3, DVec3)>,
    /// It is not there until an animation shows it.
    pub is_hidden: bool,
}

/// Where objects end in the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// The instances, indices.
    pub objects: Range<usize>,
    /// The camera that it is seen by.
    pub camera: Camera,
    /// Time of the animation, seconds.
    pub time: f64,
    /// Size of the view, pixels.
    pub size: [u32; 2],
    /// Points of lines, from (0, 0) at the top left of the view to (1, 1).
    pub lines: Vec<Vec<[f32; 2]>>,
}

/// Figures of the device that the window shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceSummary {
    /// Name of the device and its driver.
    pub name: String,
    /// Index among the devices.
    pub index: usize,
    /// The tracer, and why it was chosen.
    pub tracer: (String, String),
    /// Tracers that the device lacks something for, and what.
    pub unavailable: Vec<(String, String)>,
    /// Bytes of scene and structures in device memory.
    pub bytes: u64,
    /// Seconds of building structures.
    pub build_seconds: f64,
}

/// A step of an image.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// The image.
    pub pane: Pane,
    /// Picture to show.
    pub picture: Arc<ViewPicture>,
    /// The camera that it was rendered with: an animation may have moved it.
    pub camera: Option<Camera>,
    /// The step's work.
    pub step: ViewStep,
    /// Wall-clock time of the step.
    pub time: Duration,
    /// Time from the request that the image answers to the image.
    pub latency: Duration,
    /// Number of that request.
    pub request: u64,
}

/// An image compared with the truth.
#[derive(Clone, Debug, Default)]
pub struct Comparison {
    /// Number of the request whose images were compared.
    pub request: u64,
    /// Root of the mean squared difference over pixels that show the scene.
    pub rmse: f64,
    /// Mean difference.
    pub bias: f64,
    /// Mean FLIP, 0 (looks the same) to 1.
    pub flip: f64,
    /// Standard error of the truth per value, root mean square; `None` if it is not known.
    pub truth_error: Option<f64>,
    /// Samples per pixel of the truth.
    pub truth_samples: u32,
    /// FLIP of each pixel as a heat map.
    pub heat_map: Arc<ViewPicture>,
}

struct Latest {
    request: Request,
    number: u64,
    changed: std::time::Instant,
}

/// The latest request, shared between threads.
pub struct Mailbox {
    latest: Mutex<Latest>,
    arrived: Condvar,
}

impl Default for Mailbox {
    fn default() -> Self {
        let latest = Latest { request: Request::default(), number: 0, changed: std::time::Instant::now() };
        Self { latest: Mutex::new(latest), arrived: Condvar::new() }
    }
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Latest> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the request and wakes who waits for it. Returns its number.
    pub fn change(&self, change: impl FnOnce(&mut Request)) -> u64 {
        let mut latest = self.lock();
        change(&mut latest.request);
        latest.number += 1;
        latest.changed = std::time::Instant::now();
        self.arrived.notify_all();
        latest.number
    }

    /// The latest request.
    pub fn peek(&self) -> Request {
        self.lock().request.clone()
    }

    /// The latest request, its number and when it arrived.
    pub fn latest(&self) -> (Request, u64, std::time::Instant) {
        let latest = self.lock();
        (latest.request.clone(), latest.number, latest.changed)
    }

    /// Takes out a task that is done. Others stay, whatever is requested besides, until they are.
    pub fn done(&self, task: &Task) {
        let tasks = &mut self.lock().request.tasks;
        if let Some(k) = tasks.iter().position(|t| t == task) {
            tasks.remove(k);
        }
    }

    /// Number of the latest request.
    pub fn number(&self) -> u64 {
        self.lock().number
    }

    /// Returns true if this holds of the latest request.
    pub fn is(&self, holds: impl FnOnce(&Request) -> bool) -> bool {
        holds(&self.lock().request)
    }

    /// Waits for a request after `number`, at most so long.
    pub fn wait(&self, number: u64, most: Duration) {
        let latest = self.lock();
        let _unused = self.arrived.wait_timeout_while(latest, most, |l| l.number <= number);
    }
}

/// Sends events and wakes the window.
#[derive(Clone)]
pub struct EventSender {
    sender: Sender<Event>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl EventSender {
    /// A sender; `wake` is called after every event.
    pub fn new(sender: Sender<Event>, wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        Self { sender, wake }
    }

    /// Sends an event. A window that is gone is no error.
    pub fn send(&self, event: Event) {
        let _ = self.sender.send(event);
        (self.wake)();
    }
}
