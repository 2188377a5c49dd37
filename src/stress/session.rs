//! A run under way: what sections measure with, and where they leave their checks.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::check::Check;
use super::options::{Effort, Options};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Device, DeviceInfo, Options as GpuOptions};
use crate::scene::Scene;
use crate::scene::load::{self, Confine, LoadOptions};
use crate::tracer::{DeviceSettings, Needs, Tracer, TracerChoice, TracerKind};

/// Pipelines that stay compiled: scenes of the suite share most of them.
const KEPT_PIPELINES: usize = 256;

pub struct Section {
    /// Name on the command line.
    pub name: &'static str,
    pub title: &'static str,
    /// A sentence on what the section tries.
    pub about: &'static str,
    /// True if the section is about the user's scene; the others are about built-in scenes.
    pub of_scene: bool,
    pub run: fn(&mut StressSession) -> Result<()>,
}

/// Learns of checks as they are made.
pub trait Observer: Control {
    /// A check was made.
    ///
    /// # Errors
    /// An error ends the run.
    fn check(&mut self, check: &Check) -> Result<()>;

    /// A section begins, the `done`-th of `total`.
    fn section(&mut self, section: &'static Section, done: usize, total: usize) {
        let _ = (section, done, total);
    }
}

/// An observer that shows nothing.
pub struct Quiet;

impl Control for Quiet {}

impl Observer for Quiet {
    fn check(&mut self, _: &Check) -> Result<()> {
        Ok(())
    }
}

/// The device, tracers and options that sections measure with.
pub struct Setup {
    device: Arc<Device>,
    tracers: Vec<TracerKind>,
    /// Options of the device, for a program that is started again.
    pub device_settings: DeviceSettings,
    effort: Effort,
    /// The program, which determinism starts again.
    pub program: Option<PathBuf>,
    scene: Option<Scene>,
}

impl Setup {
    /// A quick setup with all tracers of a device.
    pub fn new(device: Arc<Device>) -> Self {
        let tracers = TracerKind::ALL.into_iter().filter(|k| k.is_supported_by(&device.info)).collect();
        let device_settings = DeviceSettings::default();
        Self { device, tracers, device_settings, effort: Effort::Quick, program: None, scene: None }
    }

    /// The same setup about a scene.
    pub fn with_scene(self, scene: Scene) -> Self {
        Self { scene: Some(scene), ..self }
    }

    /// The same setup for one tracer.
    pub fn with_tracer(self, kind: TracerKind) -> Self {
        Self { tracers: vec![kind], ..self }
    }

    /// The setup that options describe.
    ///
    /// # Errors
    /// [`Error::Device`] for a tracer that the device lacks; errors of the device and the scene.
    pub(super) fn open(options: &Options, settings: &DeviceSettings) -> Result<Self> {
        let confine = if options.confine { Confine::SceneFolder } else { Confine::Nowhere };
        let load_options = LoadOptions { confine, geometry: options.geometry, ..LoadOptions::default() };
        let load = |scene: &str| load::load_with(scene, &load_options);
        let scene = options.scene.as_deref().map(load).transpose()?;
        let device = Device::open(&GpuOptions { keep_pipelines: KEPT_PIPELINES, ..settings.options() })?;
        let tracers = tracers(&device.info, settings)?;
        let (device_settings, program) = (settings.clone(), options.program.clone());
        Ok(Self { device, tracers, device_settings, effort: options.effort, program, scene })
    }

    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    pub fn tracers(&self) -> Vec<TracerKind> {
        self.tracers.clone()
    }

    /// The tracers that render what no tracer changes, and whose kernels take long to compile: in a
    /// quick run one, that which the device would choose if it is under test.
    pub fn shading_tracers(&self) -> Vec<TracerKind> {
        let auto = TracerKind::auto(&self.device.info).0;
        match self.effort {
            Effort::Quick if self.tracers.contains(&auto) => vec![auto],
            Effort::Quick => self.tracers.iter().copied().take(1).collect(),
            Effort::Full => self.tracers(),
        }
    }

    pub fn effort(&self) -> Effort {
        self.effort
    }

    pub fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// Builds a tracer for a scene, for geometry alone.
    pub fn tracer(&self, kind: TracerKind, scene: &Scene) -> Result<Tracer> {
        Tracer::new(&self.device, kind, &FlatScene::new(scene), Needs::default())
    }
}

/// A run under way: sections leave their checks here.
pub struct StressSession<'a> {
    pub(super) setup: Setup,
    pub(super) observer: &'a mut dyn Observer,
    section: &'static str,
    /// Parts of names, as in [`Options::checks`].
    pub(super) wanted: Vec<String>,
    checks: Vec<Check>,
}

impl<'a> StressSession<'a> {
    /// A session that makes all checks, and has made none.
    pub fn new(setup: Setup, observer: &'a mut dyn Observer) -> Self {
        Self { setup, observer, section: "", wanted: Vec::new(), checks: Vec::new() }
    }

    fn is_wanted(&self, name: &str) -> bool {
        self.wanted.is_empty() || self.wanted.iter().any(|text| name.contains(text.as_str()))
    }

    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Runs a section and returns its checks.
    ///
    /// # Errors
    /// Interruption, and errors after which nothing can be measured; others are a check's outcome.
    pub fn run(&mut self, section: &Section) -> Result<Vec<Check>> {
        self.section = section.name;
        (section.run)(self)?;
        Ok(std::mem::take(&mut self.checks))
    }

    /// Makes checks whose names are only known then, and keeps those that are wanted. An error of
    /// `measure` is a check with this name that fails.
    pub fn measure_all(
        &mut self,
        name: &str,
        tracer: Option<TracerKind>,
        measure: impl FnOnce(&Setup, &mut Watch) -> Result<Vec<Check>>,
    ) -> Result<()> {
        let start = Instant::now();
        if self.observer.should_stop()? {
            return Err(Error::Interrupted);
        }
        let measured = measure(&self.setup, &mut Watch::new(self.observer));
        self.keep(name, tracer, start, measured)
    }

    /// Keeps the checks that are wanted of those measured since `start`.
    fn keep(
        &mut self,
        name: &str,
        tracer: Option<TracerKind>,
        start: Instant,
        measured: Result<Vec<Check>>,
    ) -> Result<()> {
        let checks = match measured {
            Ok(checks) => checks,
            // nothing else can be measured either
            Err(e @ (Error::Interrupted | Error::DeviceLost(_))) => return Err(e),
            Err(e) => vec![Check::failed(name, e)],
        };
        let seconds = start.elapsed().as_secs_f64() / checks.len().max(1) as f64;
        for check in checks {
            if !self.is_wanted(&check.name) {
                continue;
            }
            let check = Check { section: self.section, tracer, seconds, ..check };
            self.observer.check(&check)?;
            self.checks.push(check);
        }
        Ok(())
    }

    /// Makes checks with these names together, if one of them is wanted.
    pub fn measure_these(
        &mut self,
        names: &[&str],
        tracer: Option<TracerKind>,
        measure: impl FnOnce(&Setup, &mut Watch) -> Result<Vec<Check>>,
    ) -> Result<()> {
        match names.iter().find(|name| self.is_wanted(name)) {
            Some(name) => self.measure_all(name, tracer, measure),
            None => Ok(()),
        }
    }

    /// Makes one check, which has this name, if it is wanted.
    pub fn measure(
        &mut self,
        name: &str,
        tracer: Option<TracerKind>,
        measure: impl FnOnce(&Setup, &mut Watch) -> Result<Check>,
    ) -> Result<()> {
        self.measure_these(&[name], tracer, |setup, watch| Ok(vec![measure(setup, watch)?]))
    }

    /// Makes a check of each of these tracers.
    pub fn measure_each(
        &mut self,
        name: &str,
        kinds: &[TracerKind],
        measure: impl Fn(&Setup, TracerKind, &mut Watch) -> Result<Check>,
    ) -> Result<()> {
        kinds.iter().try_for_each(|&kind| self.measure(name, Some(kind), |setup, watch| measure(setup, kind, watch)))
    }
}

/// The control of a measurement: the observer stops it, and learns of whole checks alone.
pub struct Watch<'a>(&'a mut dyn Observer);

impl<'a> Watch<'a> {
    /// The control of a measurement that an observer may stop.
    pub fn new(observer: &'a mut dyn Observer) -> Self {
        Self(observer)
    }
}

impl Control for Watch<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop()
    }
}

fn tracers(info: &DeviceInfo, settings: &DeviceSettings) -> Result<Vec<TracerKind>> {
    let all = TracerKind::ALL.into_iter().filter(|k| k.is_supported_by(info)).collect();
    let kind = match settings.tracer {
        None | Some(TracerChoice::Auto) => return Ok(all),
        Some(choice) => choice.on(info).0,
    };
    if all.contains(&kind) {
        Ok(vec![kind])
    } else {
        Err(Error::Device(format!(
            "'{}' has no tracer '{kind}': leave --tracer out, or see `skylit doctor`",
            info.name
        )))
    }
}
