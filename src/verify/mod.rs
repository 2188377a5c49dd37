//! `skylit verify`: renders the frames of a manifest and compares each with its golden image.
//!
//! [`manifest`] reads `frames.toml`, [`selection`] chooses frames, [`session`] renders them,
//! [`judge`] compares by a [`tolerance`], [`bless`] makes [`golden`] images; [`junit`] writes
//! results for CI servers, [`html`] for people. docs/guide/ci.md is for users.

pub mod baked;
pub mod bless;
pub mod golden;
pub mod html;
pub mod judge;
pub mod junit;
pub mod manifest;
pub mod selection;
pub mod session;
mod text;
pub mod tolerance;

use std::collections::BTreeSet;
use std::time::Instant;

use bless::Change;
use golden::Golden;
use judge::Judgement;
use manifest::{Frame, Manifest, Tracers};
use selection::Selection;
use session::VerifySession;
pub use text::plural;

use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::film::Control;
use crate::output::Image;
use crate::renderer::CHOSEN;
use crate::tracer::{DeviceSettings, TracerKind};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Action {
    /// They are compared with their golden images.
    #[default]
    Verify,
    /// Golden images are made.
    Bless {
        /// Only those that are missing.
        missing: bool,
        /// On whatever driver.
        force: bool,
    },
}

/// The choice of frames, and how they are rendered.
#[derive(Clone, Debug, Default)]
pub struct Options {
    pub selection: Selection,
    pub action: Action,
    /// Tracers in place of the manifest's; one that the device lacks is then a failure.
    pub tracers: Option<Tracers>,
    /// Seed of frames whose verdict is independent of it
    /// ([`tolerance::Tolerance::allows_other_seeds`]).
    pub seed: Option<u32>,
    /// Keep the images of frames that differ.
    pub keep_images: bool,
}

#[derive(Clone, Debug, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    Holds(Judgement),
    Differs(Judgement),
    /// It is not for this device; why.
    Skipped(String),
    /// It could not be rendered or judged; why.
    Failed(String),
    Blessed(Change),
}

/// The result of a frame with one tracer.
#[derive(Clone, Debug, serde::Serialize)]
pub struct FrameResult {
    pub frame: String,
    /// The tracer; `None` if it did not come to that.
    pub tracer: Option<TracerKind>,
    pub outcome: Outcome,
    pub seconds: f64,
    /// Options of `skylit render` that the settings leave open and the golden image chose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chosen: Option<String>,
    /// A remark, in a sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The image of a frame that differs, and its golden image, if they are kept.
    #[serde(skip)]
    pub images: Option<Box<(Image, Golden)>>,
}

/// The device of all frames, and their results.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Summary {
    pub device: String,
    pub driver: String,
    /// Whether the manifest names the driver among those that golden images are made on; `None`
    /// where it names none.
    pub pinned: Option<bool>,
    /// Results in the order in which frames were rendered.
    pub frames: Vec<FrameResult>,
    pub seconds: f64,
}

/// Follows a run.
pub trait Observer: Control {
    /// A frame is done; `done` of `total` are.
    ///
    /// # Errors
    /// An error ends the run.
    fn result(&mut self, result: &FrameResult, done: usize, total: usize) -> Result<()>;
}

impl FrameResult {
    fn new(frame: &str, tracer: Option<TracerKind>, done: Done, seconds: f64) -> Self {
        let Done { outcome, images, chosen, note } = done;
        Self { frame: frame.to_owned(), tracer, outcome, seconds, chosen, note, images }
    }
}

impl Summary {
    /// The results of a run that ended before frames could be judged.
    pub fn of_failure(why: &str) -> Self {
        let result = FrameResult::new(manifest::NAME, None, Outcome::Failed(why.to_owned()).into(), 0.0);
        Self { device: String::new(), driver: String::new(), pinned: None, frames: vec![result], seconds: 0.0 }
    }

    /// Number of results for which `is` is true.
    pub fn count(&self, is: impl Fn(&Outcome) -> bool) -> usize {
        self.frames.iter().filter(|f| is(&f.outcome)).count()
    }

    /// The verdict on all frames.
    ///
    /// # Errors
    /// [`Error::CheckFailed`] if a frame differs, else [`Error::NotVerified`] without a verdict.
    pub fn verdict(&self) -> Result<()> {
        // how many frames, and their names; one that several tracers rendered is one
        let frames = |is: fn(&Outcome) -> bool| {
            let mut seen = BTreeSet::new();
            let named = self.frames.iter().filter(|f| is(&f.outcome)).map(|f| f.frame.as_str());
            let names: Vec<&str> = named.filter(|name| seen.insert(*name)).collect();
            let more = names.len().saturating_sub(5);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            (names.len(), names[..names.len().min(5)].join(", ") + &more)
        };
        let (differ, names) = frames(|o| matches!(o, Outcome::Differs(_)));
        if differ > 0 {
            return Err(Error::CheckFailed(format!(
                "{} from golden images: {names}",
                plural(differ, "frame differs", "frames differ")
            )));
        }
        let (failed, names) = frames(|o| matches!(o, Outcome::Failed(_)));
        if failed > 0 {
            return Err(Error::NotVerified(format!(
                "{} could not be judged: {names}",
                plural(failed, "frame", "frames")
            )));
        }
        if !self.frames.is_empty() && self.count(|o| matches!(o, Outcome::Skipped(_))) == self.frames.len() {
            return Err(Error::NotVerified("no frame is for this device: nothing was compared".into()));
        }
        Ok(())
    }
}

/// Does what the options say with the frames of a manifest.
///
/// # Errors
/// [`Error::Usage`] for no frames, or a driver that makes no golden images; errors of the device;
/// interruption. Other errors with one frame are its outcome.
pub fn run(
    manifest: &Manifest,
    options: &Options,
    device: &DeviceSettings,
    observer: &mut dyn Observer,
) -> Result<Summary> {
    let start = Instant::now();
    let frames = options.selection.frames(manifest)?;

    // Frames with problems have their result at once.
    let (broken, mut frames): (Vec<&Frame>, Vec<&Frame>) = frames.into_iter().partition(|f| f.problem.is_some());
    let mut results = Vec::new();
    for frame in &broken {
        let outcome = Outcome::Failed(frame.problem.clone().unwrap_or_default());
        let result = FrameResult::new(&frame.name, None, outcome.into(), 0.0);
        observer.result(&result, results.len() + 1, broken.len() + frames.len())?;
        results.push(result);
    }

    // a device is for frames that can be rendered
    if frames.is_empty() {
        let (device, driver) = (String::new(), String::new());
        let seconds = start.elapsed().as_secs_f64();
        return Ok(Summary { device, driver, pinned: None, frames: results, seconds });
    }
    let mut session = VerifySession::open(manifest, device)?;
    if let Action::Bless { missing, force } = options.action {
        if missing {
            frames.retain(|f| !manifest.golden(f).exists());
        }
        if !force && !frames.is_empty() {
            bless::check_driver(manifest, session.info())?;
        }
    }

    // Renders and judges, or blesses.
    let jobs = jobs(&session, &frames, options);
    for (k, (frame, job)) in jobs.iter().enumerate() {
        let begin = Instant::now();
        let (tracer, done): (Option<TracerKind>, Done) = match job {
            Job::Skip(kind, why) => (*kind, Outcome::Skipped(why.clone()).into()),
            Job::Fail(kind, why) => (*kind, Outcome::Failed(why.clone()).into()),
            Job::Do(kind) => {
                let done = match process_frame(&mut session, manifest, frame, *kind, options, observer) {
                    Ok(done) => done,
                    // nothing else can be done either
                    Err(e @ (Error::Interrupted | Error::DeviceLost(_) | Error::Output { .. })) => return Err(e),
                    Err(e) => Outcome::Failed(e.to_string()).into(),
                };
                (Some(*kind), done)
            }
        };
        let result = FrameResult::new(&frame.name, tracer, done, begin.elapsed().as_secs_f64());
        observer.result(&result, broken.len() + k + 1, broken.len() + jobs.len())?;
        results.push(result);
    }
    let info = session.info();
    Ok(Summary {
        device: info.name.clone(),
        driver: info.driver.clone(),
        pinned: (!manifest.pinned.is_empty()).then(|| manifest::names_driver(&manifest.pinned, &info.driver)),
        frames: results,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// A frame to be rendered with a tracer, or why it is not.
enum Job {
    Do(TracerKind),
    Skip(Option<TracerKind>, String),
    Fail(Option<TracerKind>, String),
}

/// All frames with their tracers; those of one scene with one tracer follow one another.
fn jobs<'m>(session: &VerifySession, frames: &[&'m Frame], options: &Options) -> Vec<(&'m Frame, Job)> {
    let driver = &session.info().driver;
    let mut jobs = Vec::new();
    for group in frames.chunk_by(|a, b| a.scene == b.scene) {
        let mut of_scene = Vec::new();
        for frame in group {
            if !frame.is_for(driver) {
                let why = format!("it is for {}, and this is {driver}", frame.drivers.join(" and "));
                of_scene.push((None, *frame, Job::Skip(None, why)));
                continue;
            }
            if let Action::Bless { .. } = options.action {
                let job = bless::tracer(session, frame).map_or_else(|e| Job::Skip(None, e.to_string()), Job::Do);
                of_scene.push((None, *frame, job));
                continue;
            }
            for (kind, supported) in session.tracers(options.tracers.as_ref().unwrap_or(&frame.tracers)) {
                let why = || format!("{driver} has no tracer {} (`skylit doctor` says what is missing)", kind.name());
                let job = match (supported, options.tracers.is_some()) {
                    (true, _) => Job::Do(kind),
                    (false, true) => Job::Fail(Some(kind), why()),
                    (false, false) => Job::Skip(Some(kind), why()),
                };
                of_scene.push((Some(kind.name()), *frame, job));
            }
        }
        of_scene.sort_by_key(|j| j.0);
        jobs.extend(of_scene.into_iter().map(|(_, frame, job)| (frame, job)));
    }
    jobs
}

/// The outcome of a frame, and remarks on it.
struct Done {
    outcome: Outcome,
    images: Option<Box<(Image, Golden)>>,
    chosen: Option<String>,
    note: Option<String>,
}

impl From<Outcome> for Done {
    fn from(outcome: Outcome) -> Self {
        Self { outcome, images: None, chosen: None, note: None }
    }
}

fn process_frame(
    session: &mut VerifySession,
    manifest: &Manifest,
    frame: &Frame,
    kind: TracerKind,
    options: &Options,
    observer: &mut dyn Observer,
) -> Result<Done> {
    if let Action::Bless { .. } = options.action {
        let mut plan = FilePlan::default();
        manifest.add_inputs(&mut plan, false);
        plan.writes("its golden image", manifest.golden(frame));
        plan.check()?;
        manifest.check_golden(frame)?;
        session.load(frame, kind)?;
        plan.check_scene(session.scene_files())?;
        let golden = bless::render(session, manifest, frame, kind, observer)?;
        session.check_validation()?;
        let outcome = Outcome::Blessed(bless::update(&golden)?);
        return Ok(Done { chosen: golden.chosen().map(str::to_owned), ..outcome.into() });
    }

    // Finds the golden image, which has to be one of this frame.
    let path = manifest.golden(frame);
    if !path.exists() {
        let file = path.display();
        return Ok(Outcome::Failed(format!("{file}: no golden image yet; make it with --update-missing")).into());
    }
    let golden = Golden::load(&path)?;
    if let Some(misfit) = golden.misfit(frame) {
        return Ok(Outcome::Failed(format!("{misfit}; make it again with --bless --filter {}", frame.name)).into());
    }

    // Renders and judges.
    let seed = options.seed.filter(|_| frame.tolerance.allows_other_seeds());
    let image = session.render(frame, kind, seed, Some(&golden), observer)?;
    session.check_validation()?;
    let judgement = judge::judge(frame, &image, &golden)?;
    let chosen = golden.chosen().map(str::to_owned);
    // what was not frozen: it followed the scene
    let note = image.metadata(CHOSEN).map(|now| {
        format!("its golden image does not say what was chosen for it, and now {now} is chosen; make it again with --bless --filter {}", frame.name)
    });
    if judgement.holds() {
        return Ok(Done { chosen, note, ..Outcome::Holds(judgement).into() });
    }
    let images = options.keep_images.then(|| Box::new((image, golden)));
    Ok(Done { outcome: Outcome::Differs(judgement), images, chosen, note })
}
