//! The numerical stress suite: checks that try to break tracers, sampling, films and filters, on built-in scenes or on a scene of the user's.
//!
//! [`SECTIONS`] is the only list of sections, a file each; the command line, reports and tests reach them through it. A section measures figures and holds each against
//! a bound: that is a [`Check`]. What is measured is in functions that tests call too, with scenes and answers that are wrong on purpose.
//!
//! ```no_run
//! use skylit::stress::{self, Options, Quiet};
//! use skylit::tracer::DeviceSettings;
//!
//! let summary = stress::run(&Options::default(), &DeviceSettings::default(), &mut Quiet)?;
//! for check in summary.failures() {
//!     println!("{}: {}", check.name, check.sentence);
//! }
//! # Ok::<(), skylit::Error>(())
//! ```

pub mod closed_forms;
pub mod contact;
pub mod counters;
pub mod degenerate;
pub mod determinism;
pub mod direct_light;
pub mod display;
pub mod hot_pixel;
#[cfg(feature = "report")]
pub mod html;
pub mod lengths;
pub mod long_runs;
pub mod overlaps;
pub mod sampling;
pub mod scale;
pub mod scene;
pub mod transparency;
pub mod watertight;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Device, DeviceInfo, Options as GpuOptions};
use crate::scene::Scene;
use crate::scene::load::{self, Confine, LoadOptions};
use crate::tracer::{DeviceSettings, Needs, Tracer, TracerChoice, TracerKind};

/// Version of the JSON record; it changes when a key changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// Pipelines that stay compiled: scenes of the suite share most of them.
const KEPT_PIPELINES: usize = 256;

/// How much is traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Less than a minute on a CPU driver.
    #[default]
    Quick,
    /// Hours: a hundred times the rays, and cases that are left out otherwise.
    Full,
}

impl Effort {
    /// `quick` or `full`.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Effort::Quick => quick,
            Effort::Full => full,
        }
    }
}

/// The outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The figure is within its bound.
    Holds,
    /// The figure is beyond its bound, or could not be measured.
    Fails,
    /// The device or the scene lacks what the check is about.
    NotApplicable,
    /// A figure without a bound.
    Reported,
}

/// The side of a bound on which figures hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// The largest figure that holds.
    AtMost(f64),
    /// The smallest figure that holds.
    AtLeast(f64),
}

impl Bound {
    /// Whether a figure is within it. A figure that is not a number is not.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(bound) => value <= bound,
            Bound::AtLeast(bound) => value >= bound,
        }
    }
}

/// A figure, its bound, and what they mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the section, in [`SECTIONS`].
    pub section: &'static str,
    /// What was measured, in a few words.
    pub name: String,
    /// The tracer; `None` for what the CPU does alone.
    pub tracer: Option<TracerKind>,
    /// The figure; not a number if it could not be measured.
    pub value: f64,
    /// Unit of the figure and its bound; may be empty.
    pub unit: &'static str,
    /// The bound; `None` for figures that are reported only.
    pub bound: Option<Bound>,
    /// The outcome.
    pub verdict: Verdict,
    /// What it means, a sentence; may be empty.
    pub sentence: String,
    /// Seconds that it took.
    pub seconds: f64,
}

impl Check {
    fn new(name: impl Into<String>, value: f64, unit: &'static str, bound: Option<Bound>) -> Self {
        let verdict = match bound {
            None => Verdict::Reported,
            Some(bound) if bound.holds(value) => Verdict::Holds,
            Some(_) => Verdict::Fails,
        };
        Self {
            section: "",
            name: name.into(),
            tracer: None,
            value,
            unit,
            bound,
            verdict,
            sentence: String::new(),
            seconds: 0.0,
        }
    }

    /// A check that holds for figures up to `bound`.
    pub fn at_most(name: impl Into<String>, value: f64, unit: &'static str, bound: f64) -> Self {
        Self::new(name, value, unit, Some(Bound::AtMost(bound)))
    }

    /// A check that holds for figures from `bound` on.
    pub fn at_least(name: impl Into<String>, value: f64, unit: &'static str, bound: f64) -> Self {
        Self::new(name, value, unit, Some(Bound::AtLeast(bound)))
    }

    /// A figure without a bound.
    pub fn reported(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self::new(name, value, unit, None)
    }

    /// A count that must be 0; what is the affair of a driver (`is_ours` is false) is reported only.
    pub fn none_of(name: impl Into<String>, count: u64, unit: &'static str, is_ours: bool) -> Self {
        Self::new(name, count as f64, unit, is_ours.then_some(Bound::AtMost(0.0)))
    }

    /// What cannot be measured here, and why.
    pub fn not_applicable(name: impl Into<String>, why: impl Into<String>) -> Self {
        Self { verdict: Verdict::NotApplicable, ..Self::new(name, f64::NAN, "", None) }.says(why)
    }

    /// What should have been measured and could not be.
    pub fn failed(name: impl Into<String>, error: impl std::fmt::Display) -> Self {
        Self { verdict: Verdict::Fails, ..Self::new(name, f64::NAN, "", None) }.says(error.to_string())
    }

    /// The check with a sentence about it.
    pub fn says(self, sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), ..self }
    }

    /// The check as that of a tracer.
    pub fn of(self, tracer: TracerKind) -> Self {
        Self { tracer: Some(tracer), ..self }
    }

    /// `compute`, or `cpu` for what no tracer does.
    pub fn tracer_name(&self) -> &'static str {
        self.tracer.map_or("cpu", TracerKind::name)
    }

    /// The figure with its unit: `1.2e-5 of radiance`; a dash if there is none.
    pub fn figure(&self) -> String {
        with_unit(self.value, self.unit)
    }

    /// The bound in words: `at most 0 leaks`; empty if there is none.
    pub fn bound_text(&self) -> String {
        match self.bound {
            None => String::new(),
            Some(Bound::AtMost(b)) => format!("at most {}", number(b)),
            Some(Bound::AtLeast(b)) => format!("at least {}", number(b)),
        }
    }
}

/// A number in at most three digits after the first; whole numbers below ten million in full.
pub fn number(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "-".to_owned(),
        a if a == a.trunc() && a < 1e7 => format!("{}", value.trunc() as i64),
        a if (1e-2..1e5).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{value:.digits$}")
        }
        _ => format!("{value:.2e}"),
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    if unit.is_empty() || value.is_nan() { number(value) } else { format!("{} {unit}", number(value)) }
}

/// A section of the suite.
pub struct Section {
    /// Name on the command line.
    pub name: &'static str,
    /// Title in reports.
    pub title: &'static str,
    /// What it tries, a sentence.
    pub about: &'static str,
    /// Whether it is about the user's scene; the others are about built-in scenes.
    pub of_scene: bool,
    /// Measures all of it.
    pub run: fn(&mut Session) -> Result<()>,
}

/// All sections, in the order in which they run.
pub static SECTIONS: &[Section] = &[
    scene::SECTION,
    scale::SECTION,
    watertight::SECTION,
    degenerate::SECTION,
    contact::SECTION,
    lengths::SECTION,
    transparency::SECTION,
    sampling::SECTION,
    long_runs::SECTION,
    display::SECTION,
    determinism::SECTION,
];

/// What is run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// A file or `builtin:NAME` that is examined; `None`: the built-in scenes of the suite.
    pub scene: Option<String>,
    /// How much is traced.
    pub effort: Effort,
    /// Names of the sections that run; empty: all.
    pub sections: Vec<String>,
    /// Only checks whose name contains one of these texts are made; empty: all.
    pub checks: Vec<String>,
    /// The program, which determinism starts again; `None`: what needs it is not applicable.
    pub program: Option<PathBuf>,
    /// The scene may refer to files below its own folder alone.
    pub confine: bool,
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

/// All checks of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The scene, if it was one of the user's.
    pub scene: Option<String>,
    /// How much was traced.
    pub effort: Effort,
    /// The device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// The checks, in order.
    pub checks: Vec<Check>,
    /// Warnings of the scene's loader, a sentence each.
    pub warnings: Vec<String>,
    /// Seconds of all.
    pub seconds: f64,
}

impl Summary {
    /// The checks that fail.
    pub fn failures(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|c| c.verdict == Verdict::Fails)
    }

    /// How many checks have an outcome.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.checks.iter().filter(|c| c.verdict == verdict).count()
    }

    /// Success if no check fails.
    ///
    /// # Errors
    /// [`Error::CheckFailed`], naming the first checks that fail.
    pub fn verdict(&self) -> Result<()> {
        let failed: Vec<String> = self.failures().map(|c| format!("{} ({})", c.name, c.tracer_name())).collect();
        if failed.is_empty() {
            return Ok(());
        }
        let more = if failed.len() > 5 { format!(", and {} more", failed.len() - 5) } else { String::new() };
        let checks = if failed.len() == 1 { "check fails" } else { "checks fail" };
        Err(Error::CheckFailed(format!("{} {checks}: {}{more}", failed.len(), failed[..failed.len().min(5)].join(", "))))
    }
}

/// What sections measure with.
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
    /// [`Error::Device`] for a tracer that the device lacks; those of opening it and of loading the scene.
    fn open(options: &Options, settings: &DeviceSettings) -> Result<Self> {
        let confine = if options.confine { Confine::SceneFolder } else { Confine::Nowhere };
        let load = |scene: &str| load::load_with(scene, &LoadOptions { confine, ..LoadOptions::default() });
        let scene = options.scene.as_deref().map(load).transpose()?;
        let device = Device::open(&GpuOptions { keep_pipelines: KEPT_PIPELINES, ..settings.options() })?;
        let tracers = tracers(&device.info, settings)?;
        let (device_settings, program) = (settings.clone(), options.program.clone());
        Ok(Self { device, tracers, device_settings, effort: options.effort, program, scene })
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The tracers under test.
    pub fn tracers(&self) -> Vec<TracerKind> {
        self.tracers.clone()
    }

    /// The tracers that render what no tracer changes, and whose kernels take long to compile: in a quick run one, that which the device would choose if it is under test.
    pub fn shading_tracers(&self) -> Vec<TracerKind> {
        let auto = TracerKind::auto(&self.device.info).0;
        match self.effort {
            Effort::Quick if self.tracers.contains(&auto) => vec![auto],
            Effort::Quick => self.tracers.iter().copied().take(1).collect(),
            Effort::Full => self.tracers(),
        }
    }

    /// How much is traced.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// The user's scene.
    pub fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// Builds a tracer for a scene, for geometry alone.
    ///
    /// # Errors
    /// Those of [`Tracer::new`].
    pub fn tracer(&self, kind: TracerKind, scene: &Scene) -> Result<Tracer> {
        Tracer::new(&self.device, kind, &FlatScene::new(scene), Needs::default())
    }
}

/// A run under way: sections leave their checks here.
pub struct Session<'a> {
    setup: Setup,
    observer: &'a mut dyn Observer,
    section: &'static str,
    /// Parts of names, as in [`Options::checks`].
    wanted: Vec<String>,
    checks: Vec<Check>,
}

impl<'a> Session<'a> {
    /// A session that makes all checks, and has made none.
    pub fn new(setup: Setup, observer: &'a mut dyn Observer) -> Self {
        Self { setup, observer, section: "", wanted: Vec::new(), checks: Vec::new() }
    }

    fn is_wanted(&self, name: &str) -> bool {
        self.wanted.is_empty() || self.wanted.iter().any(|text| name.contains(text.as_str()))
    }

    /// What it measures with.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Runs a section and returns its checks.
    ///
    /// # Errors
    /// Interruption, and those after which nothing else can be measured; what goes wrong with a check is its outcome.
    pub fn run(&mut self, section: &Section) -> Result<Vec<Check>> {
        self.section = section.name;
        (section.run)(self)?;
        Ok(std::mem::take(&mut self.checks))
    }

    /// Makes checks whose names are only known then, and keeps those that are wanted. An error of `measure` is a check with this name that fails.
    ///
    /// # Errors
    /// Interruption, and a device that was lost.
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
        let checks = match measure(&self.setup, &mut Watch::new(self.observer)) {
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
    ///
    /// # Errors
    /// Those of [`Session::measure_all`].
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
    ///
    /// # Errors
    /// Those of [`Session::measure_all`].
    pub fn measure(
        &mut self,
        name: &str,
        tracer: Option<TracerKind>,
        measure: impl FnOnce(&Setup, &mut Watch) -> Result<Check>,
    ) -> Result<()> {
        self.measure_these(&[name], tracer, |setup, watch| Ok(vec![measure(setup, watch)?]))
    }

    /// Makes a check of each of these tracers.
    ///
    /// # Errors
    /// Those of [`Session::measure_all`].
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
    match all.contains(&kind) {
        true => Ok(vec![kind]),
        false => {
            Err(Error::Device(format!("'{}' has no tracer '{kind}': leave --tracer out, or see `skylit doctor`", info.name)))
        }
    }
}

/// Runs the sections that options name.
///
/// # Errors
/// [`Error::Usage`] for a section that does not exist or that is about the other kind of scene, and where no check has a name that is wanted; those of loading the scene and opening the device; interruption.
pub fn run(options: &Options, settings: &DeviceSettings, observer: &mut dyn Observer) -> Result<Summary> {
    let start = Instant::now();
    let sections = sections(options)?;
    let mut session = Session::new(Setup::open(options, settings)?, observer);
    session.wanted.clone_from(&options.checks);
    let mut checks = Vec::new();
    for (k, section) in sections.iter().enumerate() {
        session.observer.section(section, k, sections.len());
        checks.extend(session.run(section)?);
        session.setup.device.check_validation()?;
    }
    session.setup.device.save_pipeline_cache();
    if checks.is_empty() && !options.checks.is_empty() {
        let texts: Vec<_> = options.checks.iter().map(|text| format!("'{text}'")).collect();
        return Err(Error::Usage(format!("--checks: no check of these sections has {} in its name", texts.join(" or "))));
    }
    let info = &session.setup.device.info;
    Ok(Summary {
        schema: SCHEMA,
        scene: options.scene.clone(),
        effort: options.effort,
        device: info.name.clone(),
        driver: info.driver.clone(),
        warnings: session.setup.scene.as_ref().map_or_else(Vec::new, |s| s.report.warnings.clone()),
        checks,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// The sections that options name, in the suite's order.
fn sections(options: &Options) -> Result<Vec<&'static Section>> {
    let about_scene = options.scene.is_some();
    for name in &options.sections {
        let Some(section) = SECTIONS.iter().find(|s| s.name == *name) else {
            let names: Vec<_> = SECTIONS.iter().map(|s| s.name).collect();
            return Err(Error::Usage(format!("--sections: there is no section '{name}'; there are {}", names.join(", "))));
        };
        if section.of_scene != about_scene {
            return Err(Error::Usage(match about_scene {
                true => format!("--sections {name}: it is about built-in scenes: leave SCENE out"),
                false => format!("--sections {name}: it is about a scene of yours: name one"),
            }));
        }
    }
    let is_wanted = |s: &&Section| {
        s.of_scene == about_scene && (options.sections.is_empty() || options.sections.iter().any(|n| n == s.name))
    };
    Ok(SECTIONS.iter().filter(is_wanted).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_held_against_bounds() {
        let verdict = |c: Check| c.verdict;
        assert_eq!(verdict(Check::at_most("a", 1.0, "", 1.0)), Verdict::Holds);
        assert_eq!(verdict(Check::at_most("a", 1.1, "", 1.0)), Verdict::Fails);
        assert_eq!(verdict(Check::at_most("a", f64::NAN, "", 1.0)), Verdict::Fails);
        assert_eq!(verdict(Check::at_least("a", 0.9, "", 1.0)), Verdict::Fails);
        assert_eq!(verdict(Check::reported("a", f64::NAN, "")), Verdict::Reported);
        assert_eq!(verdict(Check::none_of("a", 1, "leaks", true)), Verdict::Fails);
        assert_eq!(verdict(Check::none_of("a", 1, "leaks", false)), Verdict::Reported);
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (-3.0, "-3"),
            (1e6, "1000000"),
            (0.25, "0.2500"),
            (1234.5, "1234"),
            (1.234e-5, "1.23e-5"),
            (4e38, "4.00e38"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn sections_fit_what_is_examined() {
        let of = |scene: Option<&str>, names: &[&str]| {
            let names = names.iter().map(|n| (*n).to_owned()).collect();
            let options = Options { scene: scene.map(str::to_owned), sections: names, ..Default::default() };
            sections(&options).map(|s| s.iter().map(|s| s.name).collect::<Vec<_>>())
        };
        assert_eq!(of(Some("a.glb"), &[]).unwrap(), ["scene"]);
        assert_eq!(of(None, &[]).unwrap().len(), SECTIONS.len() - 1);
        assert_eq!(of(None, &["watertight", "scale"]).unwrap(), ["scale", "watertight"]);
        for (scene, name) in [(None, "scene"), (Some("a.glb"), "scale"), (None, "nothing")] {
            assert_eq!(of(scene, &[name]).unwrap_err().exit_code(), 64, "{name}");
        }
        let mut names: Vec<_> = SECTIONS.iter().map(|s| s.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SECTIONS.len());
    }

    #[test]
    fn a_failed_check_fails_the_run() {
        let summary = |checks: Vec<Check>| Summary {
            schema: SCHEMA,
            scene: None,
            effort: Effort::Quick,
            device: String::new(),
            driver: String::new(),
            warnings: Vec::new(),
            checks,
            seconds: 0.0,
        };
        let good = [Check::at_most("a", 0.0, "", 1.0), Check::reported("b", 9.0, ""), Check::not_applicable("c", "no")];
        assert!(summary(good.to_vec()).verdict().is_ok());
        let bad = summary(vec![Check::at_most("leaks of a box", 2.0, "", 0.0).of(TracerKind::Compute)]).verdict().unwrap_err();
        assert_eq!((bad.exit_code(), bad.to_string().as_str()), (1, "1 check fails: leaks of a box (compute)"));
    }
}
