//! A sudden change, after which everything rests: the environment map is turned or a box appears
//! (lag, ghosting), the camera steps aside (disocclusion).

use glam::DVec3;

use super::args::FramesSession;
use super::candidates::Candidate;
use super::frame_log::FrameLog;
use super::scenes::CameraView;
use super::signal::EqualTime;
use super::stage::{SceneStage, turned};
use crate::bench::record::{Better, Quantity, REFERENCE, plain, quantity};
use crate::error::{Error, Result};
use crate::film::camera::CameraRecord;
use crate::measure::displayed::{Displayed, FrameReference};
use crate::measure::plain_time::{PlainClock, is_plain_timed};
use crate::measure::stale::FreshImages;
use crate::measure::temporal::{Ghosting, LagCurve, recovery};
use crate::realtime::{Preset, Realtime, surface_masks};
use crate::scene::builtin::moving_box::Mover;
use crate::scene::{Camera, EnvironmentMap};
use crate::tracer::MovedBounds;

/// How far the environment map is turned at once, degrees.
const TURN: f64 = 30.0;
/// How far the camera steps aside, distances to what it goes round.
const STEP: f64 = 0.25;
/// Pixels below which an error over them says nothing.
const MIN_PIXELS: usize = 8;
/// How much more than the settled error still counts as recovered.
const RECOVERED: f64 = 1.1;
/// Frames that are looked at after a change, at least.
const MIN_FRAMES: u32 = 16;
/// Frames after which no pixel of ambient occlusion may keep what is wrong.
const STALE_AFTER: u32 = 8;
/// Runs that never saw the old, which say how much chance does to a pixel.
const FRESH_RUNS: u32 = 8;
const AXIS: &str = "frame after the change";
/// Error of the first frame after a change.
const FIRST_RMSE: Quantity = Quantity { name: "RMSE of the first frame", unit: "", better: Better::Less };
/// Preset whose memory and recovery others are held against.
const LARSEN: &str = "larsen";

/// A change: before and after it, in which pixels it is looked at.
struct ChangeScene {
    part: &'static str,
    /// Before it, from where the scene is seen.
    camera_before: CameraRecord,
    /// The camera after it.
    camera: CameraRecord,
    reference: FrameReference,
    /// The reference before it; `None` where another camera saw it.
    old: Option<FrameReference>,
    mask: Option<Vec<f32>>,
}

/// The images of a preset after a change.
struct ChangeRun {
    preset: &'static str,
    rmse: Vec<f64>,
    memory_half_life: Option<f64>,
    /// Whether it stands for how errors recover.
    recovers: bool,
}

/// Measures all changes that the scene can have.
pub fn measure(
    session: &mut FramesSession,
    view: &CameraView,
    stage: &mut SceneStage,
    mover: Option<Mover>,
) -> Result<()> {
    if let Some(map) = stage.map() {
        turn(session, &view.name, stage, map)?;
    }
    if let Some(mover) = mover {
        appear(session, &view.name, stage, mover)?;
    }
    sidestep(session, view, stage)
}

/// The environment map is turned at once.
fn turn(session: &mut FramesSession, scene: &str, stage: &mut SceneStage, map: &EnvironmentMap) -> Result<()> {
    session.phase(format!("{scene}, turn: references"));
    let (camera, paths) = (stage.still_camera(), session.args.reference_paths());
    let after = turned(map, TURN);
    let old = Some(stage.reference(&camera, paths)?);
    stage.turn_environment(&after)?;
    let reference = stage.reference(&camera, paths)?;
    let change = ChangeScene { part: "turn", camera_before: camera, camera, reference, old, mask: None };
    let outcome = measure_presets(session, scene, stage, &change, |realtime, _, is_after| {
        realtime.turn_environment(if is_after { after } else { map.to_map });
        Ok((Vec::new(), None))
    });
    stage.turn_environment(&map.to_map)?;
    outcome
}

/// A box appears.
fn appear(session: &mut FramesSession, scene: &str, stage: &mut SceneStage, mover: Mover) -> Result<()> {
    session.phase(format!("{scene}, appear: references"));
    let (camera, paths) = (stage.still_camera(), session.args.reference_paths());
    stage.place(mover.away())?;
    let (old, before) = (stage.reference(&camera, paths)?, stage.surfaces(&camera)?);
    stage.place(mover.at_home())?;
    let reference = stage.reference(&camera, paths)?;
    let mask = Some(surface_masks::unchanged(&stage.surfaces(&camera)?, &before, stage.reach));
    let change = ChangeScene { part: "appear", camera_before: camera, camera, reference, old: Some(old), mask };
    let outcome = measure_presets(session, scene, stage, &change, |_, stage, is_after| {
        let update = stage.place(if is_after { mover.at_home() } else { mover.away() })?;
        Ok((update.moved, Some(1e3 * (update.mesh_seconds + update.top_seconds))))
    });
    stage.place(mover.at_home())?;
    stage.rest()?;
    outcome
}

/// The camera steps aside, once; nothing where that shows nothing new.
fn sidestep(session: &mut FramesSession, view: &CameraView, stage: &mut SceneStage) -> Result<()> {
    let scene = &view.name;
    session.phase(format!("{scene}, sidestep: reference"));
    let from = stage.still_camera();
    let mut to_world = view.camera.camera_to_world;
    let step = STEP * to_world.translation.distance(view.middle);
    to_world.translation += to_world.transform_vector3(DVec3::X).normalize_or_zero() * step;
    let camera = stage.camera_record(&Camera { camera_to_world: to_world, ..view.camera.clone() });
    let mask = surface_masks::newly_seen(&stage.surfaces(&camera)?, &stage.surfaces(&from)?, &from, stage.size);
    if mask.iter().filter(|m| **m > 0.0).count() < MIN_PIXELS {
        session.note(format!("{scene}, sidestep: the step shows next to nothing new at this size"));
        return Ok(());
    }
    let reference = stage.reference(&camera, session.args.reference_paths())?;
    let change = ChangeScene { part: "sidestep", camera_before: from, camera, reference, old: None, mask: Some(mask) };
    measure_presets(session, scene, stage, &change, |_, _, _| Ok((Vec::new(), None)))
}

/// Measures presets in turn, while time is left. `apply` changes the scene or changes it back, and
/// returns what moved and the milliseconds of updating the tracer.
fn measure_presets(
    session: &mut FramesSession,
    scene: &str,
    stage: &mut SceneStage,
    change: &ChangeScene,
    mut apply: impl FnMut(&mut Realtime, &mut SceneStage, bool) -> Result<(Vec<MovedBounds>, Option<f64>)>,
) -> Result<()> {
    let part = change.part;
    let mut runs = Vec::new();
    for candidate in session.args.candidates() {
        // one without a past has nothing to forget
        if candidate.preset == Preset::Reference {
            continue;
        }
        if !session.has_time_for(format!("{scene}, {part}: {}", candidate.name)) {
            continue;
        }
        runs.push(measure_preset(session, scene, stage, change, candidate, &mut apply)?);
    }
    if runs.is_empty() {
        return Ok(());
    }
    let pixels = change.mask.as_ref().map(|mask| mask.iter().filter(|m| **m > 0.0).count() as f64);
    let mut row = session.record.row(scene, part, REFERENCE);
    row.exact(quantity::RMSE.not_compared(), change.reference.rmse).exact(plain("pixels", ""), pixels);

    // what says something only beside Larsen's pipeline
    let Some(larsen) = runs.iter().find(|r| r.preset == LARSEN) else { return Ok(()) };
    let end = larsen.rmse.last().copied().filter(|_| larsen.recovers);
    for run in &runs {
        let mut row = session.record.row(scene, part, run.preset);
        let quick = larsen.memory_half_life.zip(run.memory_half_life).map(|(theirs, ours)| theirs / ours);
        row.exact(plain("times as quick", ""), quick.filter(|x| !x.is_nan()));
        let recovered = end.and_then(|end| recovery(&run.rmse, end, RECOVERED));
        row.exact(plain("recovered to larsen", "frames"), recovered.map(|n| n as f64));
    }
    Ok(())
}

fn measure_preset(
    session: &mut FramesSession,
    scene: &str,
    stage: &mut SceneStage,
    change: &ChangeScene,
    candidate: &'static Candidate,
    apply: &mut impl FnMut(&mut Realtime, &mut SceneStage, bool) -> Result<(Vec<MovedBounds>, Option<f64>)>,
) -> Result<ChangeRun> {
    // frames before the change, and after it
    let frames = (session.args.frames() * 2 / 3).max(MIN_FRAMES);
    let mask = change.mask.as_deref();
    let mut realtime = stage.realtime(candidate)?;
    apply(&mut realtime, stage, false)?;
    stage.rest()?;
    let mut log = FrameLog::default();
    for _ in 0..frames {
        log.render_frame(&mut realtime, &stage.tracer, &change.camera_before, &[])?;
    }
    let shown_before = stage.displayed(&realtime.result()?);
    let (moved, update_ms) = apply(&mut realtime, stage, true)?;
    let (mut log, mut rmse, mut images) = (FrameLog::default(), Vec::new(), Vec::new());
    let mut clock = PlainClock::default();
    for frame in 0..frames {
        let moved = if frame == 0 { moved.as_slice() } else { &[] };
        log.render_frame(&mut realtime, &stage.tracer, &change.camera, moved)?;
        if frame == 0 {
            stage.rest()?;
        }
        if is_plain_timed(frame, 0, frames) {
            stage.time_plain(&change.camera, &mut clock)?;
        }
        let image = stage.displayed(&realtime.result()?);
        rmse.push(change.reference.rmse_over(&image, mask)?);
        images.push(image);
    }

    // plain accumulation that starts with the change, after 1, 2, 4, ... frames
    let time = EqualTime::new(clock.time(), log.typical(0));
    let mut plains = Vec::new();
    for frame in (0..).map(|k| 1u32 << k).take_while(|f| *f <= frames) {
        let image = stage.plain(&change.camera, time.paths(frame), stage.seed)?;
        plains.push((frame, change.reference.rmse_over(&stage.displayed(&image), mask)?));
    }

    // how much of the old shows, or how long what was not seen takes
    let mut row = session.record.row(scene, change.part, candidate.name);
    row.exact(FIRST_RMSE, rmse.first().copied()).exact(plain("RMSE at the end", ""), rmse.last().copied());
    row.exact(quantity::UPDATE_TIME.not_compared(), update_ms);
    for (frame, error) in (1..).zip(&rmse) {
        row.at(AXIS, f64::from(frame)).exact(quantity::RMSE.not_compared(), *error);
    }
    for (frame, error) in &plains {
        row.at(AXIS, f64::from(*frame)).exact(quantity::PLAIN_RMSE, *error);
    }
    let mut run = ChangeRun { preset: candidate.name, rmse, memory_half_life: None, recovers: change.old.is_none() };
    let Some(old) = &change.old else {
        let settled = run.rmse.last().copied().unwrap_or(f64::NAN);
        row.exact(plain("recovered", "frames"), recovery(&run.rmse, settled, RECOVERED).map(|n| n as f64));
        return Ok(run);
    };
    let fresh = stage.frames_afresh(&mut realtime, &change.camera, frames)?;
    let fresh: Vec<Displayed> = fresh.iter().map(|image| stage.displayed(image)).collect();
    let lag = Lag::new(&change.reference, old, mask, &shown_before, &images, &fresh);
    row.exact(plain("left", ""), lag.left.residuals().first().copied());
    row.exact(plain("half-life", "frames"), lag.left.fitted_half_life());
    row.exact(plain("memory", ""), lag.memory.residuals().first().copied());
    row.exact(plain("half-life of memory", "frames"), lag.memory.fitted_half_life());
    row.exact(plain("gone", "frames"), lag.left.gone().map(|n| n as f64));
    row.exact(plain("ghosting", ""), lag.ghosting);
    for (frame, (left, memory)) in (1..).zip(lag.left.residuals().iter().zip(lag.memory.residuals())) {
        row.at(AXIS, f64::from(frame)).exact(plain("left", ""), *left).exact(plain("memory", ""), *memory);
    }
    run.memory_half_life = Some(lag.memory.fitted_half_life());
    if let (Some(mask), true) = (mask, stage.channels() == 1) {
        // the sampler goes on: each run is another
        let camera = &change.camera;
        let mut run_afresh = || Ok::<_, Error>(stage.frames_afresh(&mut realtime, camera, STALE_AFTER)?.pop());
        let mut fresh = FreshImages::new(stage.size);
        for _ in 0..FRESH_RUNS {
            run_afresh()?.iter().for_each(|image| fresh.add(image));
        }
        let chance = run_afresh()?.unwrap_or_default();
        let truths = [&change.reference, old].map(|r| r.displayed.coded.as_slice());
        let shown = images.get(STALE_AFTER as usize - 1).map(|d| d.coded.as_slice()).unwrap_or_default();
        let counts = [shown, &chance].map(|image| fresh.stale_pixels(image, mask, truths) as f64);
        row.exact(plain("stale pixels", ""), counts[0]).exact(plain("stale by chance", ""), counts[1]);
    }
    Ok(run)
}

/// The traces of the old in frames after a change.
struct Lag {
    /// Beside what the preset itself ends at.
    left: LagCurve,
    /// Lag beyond that of frames of the same age without a past, which are as blurred and as noisy.
    memory: LagCurve,
    ghosting: f64,
}

impl Lag {
    fn new(
        reference: &FrameReference,
        old: &FrameReference,
        mask: Option<&[f32]>,
        shown_before: &Displayed,
        images: &[Displayed],
        fresh: &[Displayed],
    ) -> Self {
        let references = (&reference.displayed.coded[..], &old.displayed.coded[..]);
        let share = |image: &Displayed, beside: &Displayed, ghosting: &mut Ghosting| {
            let added = ghosting.add_beside((&image.coded, &beside.coded), references, mask);
            added.map_or(f64::NAN, |r| r.share)
        };
        let Some(settled) = fresh.last() else {
            let none = || LagCurve::new(Vec::new());
            return Self { left: none(), memory: none(), ghosting: f64::NAN };
        };
        // what it showed before is all of it, also where that is not what was right
        let all = share(shown_before, settled, &mut Ghosting::default());
        let mut ghosting = Ghosting::default();
        let left = images.iter().map(|image| share(image, settled, &mut ghosting) / all).collect();
        let of_that_age =
            |(image, fresh): (&Displayed, &Displayed)| share(image, fresh, &mut Ghosting::default()) / all;
        let memory = images.iter().zip(fresh).map(of_that_age).collect();
        Self { left: LagCurve::new(left), memory: LagCurve::new(memory), ghosting: ghosting.energy() }
    }
}
