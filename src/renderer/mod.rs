//! The renderer: a device, a scene, the tracer that was built for it and the pipelines that were
//! compiled, behind two functions: [`Renderer::still`] and [`Renderer::frames`].
//!
//! Later calls reuse what earlier ones have built: the tracer, if the settings need the same scene
//! data, and all pipelines.
//!
//! ```
//! use skylit::film::NoControl;
//! use skylit::renderer::{RenderSettings, Renderer};
//! use skylit::tracer::DeviceSettings;
//!
//! let mut renderer = Renderer::open("builtin:cornell-box", &DeviceSettings::default())?;
//! let mut settings = RenderSettings::default();
//! settings.image.size = Some([16, 16]);
//! settings.image.spp = Some(4);
//! let ao = renderer.still(&settings, &mut NoControl)?;
//! settings.integrator = Some("path".parse()?);
//! let path = renderer.still(&settings, &mut NoControl)?;
//! println!("{:.3} of the hemisphere is open; radiance {:.3}", ao.report.mean, path.report.mean);
//! # Ok::<(), skylit::Error>(())
//! ```

mod ambient;
pub(crate) mod brightness;
pub mod camera_numbers;
mod complete;
#[cfg(feature = "cli")]
pub mod defaults;
mod denoising;
pub mod film_file;
pub mod frames;
pub mod interactive;
mod laps;
pub mod memory_estimate;
mod quality;
pub mod report;
pub mod settings;
mod shell;
pub mod still;
pub mod still_sequence;
pub mod survey;

use std::sync::Arc;
use std::thread::ScopedJoinHandle;
use std::time::Instant;

use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Device, KeptPipelines};
use crate::integrators::lighting::LightingSettings;
use crate::output::Image;
use crate::scene::load::{self, LoadOptions};
use crate::scene::{Camera, Environment, Ground, LaidGround, Scene, SceneSettings};
use crate::shaders::StreamShaders;
use crate::tracer::{ComputeOptions, DeviceSettings, Needs, Tracer, TracerKind};
use survey::own_light::OwnLight;

pub use complete::{CHOSEN, Completed, SCENE_OPTIONS};
pub use frames::{FrameOutput, Frames};
pub use interactive::{Interactive, View};
pub use quality::Quality;
pub use report::{FramesReport, StillReport};
pub use settings::RenderSettings;
pub use still::Still;

/// A device, a scene, and the tracer and pipelines that were built for it.
pub struct Renderer {
    device: Arc<Device>,
    name: String,
    scene: Scene,
    lighting: Lighting,
    /// The ground that is wanted, and its height, and the one that the tracer has.
    ground: (Ground, Option<f64>),
    traced_ground: Option<LaidGround>,
    settings: DeviceSettings,
    kind: TracerKind,
    kind_reason: String,
    compute: ComputeOptions,
    tracer: Option<ReadyTracer>,
    /// Pipelines of all images so far, kept so that they are not compiled again.
    pipelines: KeptPipelines,
    open_seconds: OpenSeconds,
}

/// Seconds of opening a renderer. Loading and starting the device overlap.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenSeconds {
    /// Loading the scene.
    pub load: f64,
    /// Starting the device.
    pub device: f64,
    /// Both, by the clock.
    pub wall: f64,
}

/// A tracer, and the requirements that it was built for.
struct ReadyTracer {
    tracer: Tracer,
    blend: Blend,
    needs: Needs,
}

/// The lights that settings added to a scene, and how to remove them again.
#[derive(Default)]
struct Lighting {
    settings: LightingSettings,
    /// Lengths of the scene's own lists before: lights, materials, meshes, instances and warnings.
    own: [usize; 5],
    environment: Option<Environment>,
    /// It was chosen because the scene has none that shows it.
    is_automatic: bool,
    /// How much of a view the scene's own light shows, of the first camera, once that is known.
    own_light: Option<OwnLight>,
}

impl Renderer {
    /// Loads a scene (a file, or `builtin:NAME`) while the driver starts.
    ///
    /// # Errors
    /// Those of [`load::load`] and [`Device::open`].
    pub fn open(scene: &str, settings: &DeviceSettings) -> Result<Self> {
        Self::open_with(scene, &LoadOptions::default(), settings)
    }

    /// As [`Renderer::open`], errors included, with options of loading.
    pub fn open_with(scene: &str, options: &LoadOptions, settings: &DeviceSettings) -> Result<Self> {
        let timed = |start: Instant| start.elapsed().as_secs_f64();
        let open = Instant::now();
        let (loaded, opened, seconds) = std::thread::scope(|scope| {
            let open_device = || {
                let start = Instant::now();
                (Device::open(&settings.options()), timed(start))
            };
            // one after the other where there can be no further thread
            let device = std::thread::Builder::new().spawn_scoped(scope, open_device);
            let start = Instant::now();
            let loaded = load::load_with(scene, options);
            let load = timed(start);
            let (opened, device) = match device.map(ScopedJoinHandle::join) {
                Ok(Ok(done)) => done,
                Ok(Err(panic)) => std::panic::resume_unwind(panic),
                Err(_) => open_device(),
            };
            (loaded, opened, OpenSeconds { load, device, wall: 0.0 })
        });
        let mut renderer = Self::new(opened?, loaded?, settings)?;
        (renderer.name, renderer.open_seconds) = (scene.to_owned(), OpenSeconds { wall: timed(open), ..seconds });
        Ok(renderer)
    }

    /// Creates a renderer for a loaded scene and an open device.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for settings that contradict each other.
    pub fn new(device: Arc<Device>, scene: Scene, settings: &DeviceSettings) -> Result<Self> {
        let (kind, kind_reason, compute) = settings.choose(&device.info)?;
        Ok(Self {
            device,
            name: scene.name.clone(),
            lighting: Lighting::default(),
            ground: (Ground::None, None),
            traced_ground: None,
            scene,
            settings: settings.clone(),
            kind,
            kind_reason,
            compute,
            tracer: None,
            pipelines: KeptPipelines::default(),
            open_seconds: OpenSeconds::default(),
        })
    }

    /// Names the scene, a file or `builtin:NAME`, in metadata and messages.
    pub fn with_name(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Name of the scene: a file, or `builtin:NAME`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The scene, including the lights of the last settings.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Which ground images have from the next view or image on, and its height (y): by default
    /// that of the scene's lowest point.
    pub fn want_ground(&mut self, kind: Ground, height: Option<f64>) {
        self.ground = (kind, height);
    }

    /// Puts the ground that is wanted under the scene.
    fn lay_ground(&mut self) {
        let (kind, height) = self.ground;
        self.scene.lay_ground(kind, height);
        if self.scene.ground != self.traced_ground {
            // the traced scene changes
            self.tracer = None;
            self.traced_ground = self.scene.ground;
        }
    }

    /// The scene without the lights and the ground that settings have added; all else goes.
    pub fn into_scene(mut self) -> Scene {
        self.scene.take_ground();
        // removing lights cannot fail
        let _ = self.light(&LightingSettings::default());
        self.scene
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The tracer in use, and why it was chosen.
    pub fn tracer_kind(&self) -> (TracerKind, &str) {
        (self.kind, &self.kind_reason)
    }

    /// Renders an image: a still, or the last of the real-time frames, as the settings describe.
    ///
    /// # Errors
    /// Those of [`Renderer::still`] and [`Renderer::frames`].
    pub fn image(&mut self, settings: &RenderSettings, control: &mut dyn Control) -> Result<Image> {
        if settings.is_still_sequence() {
            let mut stills = self.still_sequence(settings)?;
            let last = stills.range().end - 1;
            return Ok(stills.render(last, control)?.image);
        }
        if settings.realtime_setting().is_none() {
            return Ok(self.still(settings, control)?.image);
        }
        let mut frames = self.frames(settings, false, control)?;
        let (mut done, all) = (0, u64::from(frames.count()));
        while frames.advance()?.is_some() {
            done += 1;
            control.progress(done, all);
            if control.should_stop()? {
                return Err(Error::Interrupted);
            }
        }
        frames.image(control)
    }

    /// Keeps all live pipelines, and saves the driver's pipeline cache to disk.
    fn keep_pipelines(&mut self) {
        self.pipelines = self.device.live_pipelines();
        self.device.save_pipeline_cache();
    }

    /// Applies settings that the scene's file leaves open; a change of them builds the tracer anew.
    pub(crate) fn apply_scene_settings(&mut self, settings: &SceneSettings) -> Result<()> {
        if settings.apply(&mut self.scene)? {
            // the traced scene changes
            self.tracer = None;
        }
        Ok(())
    }

    /// Adds the lights of the settings to the scene, and removes those of the previous settings.
    fn light(&mut self, settings: &LightingSettings) -> Result<()> {
        if self.lighting.settings == *settings {
            return Ok(());
        }
        // the ground comes after lights
        self.scene.take_ground();
        let s = &mut self.scene;
        let before = std::mem::take(&mut self.lighting);
        if before.settings != LightingSettings::default() {
            let [lights, materials, meshes, instances, warnings] = before.own;
            s.lights.truncate(lights);
            s.materials.truncate(materials);
            s.meshes.truncate(meshes);
            s.instances.truncate(instances);
            s.report.warnings.truncate(warnings);
            s.environment = before.environment.unwrap_or_default();
        }
        // the traced scene changes
        self.tracer = None;
        let own = [s.lights.len(), s.materials.len(), s.meshes.len(), s.instances.len(), s.report.warnings.len()];
        let environment = Some(s.environment.clone());
        settings.apply(s)?;
        let settings = settings.clone();
        self.lighting = Lighting { settings, own, environment, is_automatic: false, own_light: before.own_light };
        Ok(())
    }
}

/// The requirements of a new tracer.
struct TracerRequest<'a> {
    needs: Needs,
    streams: Vec<&'static StreamShaders>,
    /// Approximate number of rays that will be traced.
    rays: u64,
    /// The camera of the images; `None` if it will move.
    camera: Option<&'a Camera>,
    control: &'a mut dyn Control,
    warnings: &'a mut Vec<String>,
}

impl TracerRequest<'_> {
    /// The tracer at hand, if it was built for the same scene data, or else a new one.
    fn reuse_or_build(
        self,
        ready: Option<ReadyTracer>,
        device: &Arc<Device>,
        kind: TracerKind,
        flat: &FlatScene,
        compute: ComputeOptions,
        settings: &DeviceSettings,
    ) -> Result<ReadyTracer> {
        let (blend, needs) = (flat.blend, self.needs);
        match ready.filter(|r| r.blend == blend && r.needs == needs) {
            Some(ready) => Ok(ready),
            None => Ok(ReadyTracer { tracer: self.build(device, kind, flat, compute, settings)?, blend, needs }),
        }
    }

    fn build(
        self,
        device: &Arc<Device>,
        kind: TracerKind,
        flat: &FlatScene,
        compute: ComputeOptions,
        settings: &DeviceSettings,
    ) -> Result<Tracer> {
        let mut build = settings.build_options(self.rays)?;
        build.streams.extend(self.streams);
        if let Some(local) = &mut build.local {
            local.camera = self.camera.cloned();
        }
        let tracer = Tracer::with_build(device, kind, flat, self.needs, compute, &build)?;
        for warning in build.take_warnings() {
            self.control.warning(&warning);
            self.warnings.push(warning);
        }
        Ok(tracer)
    }
}
