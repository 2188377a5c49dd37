//! A sudden change, after which everything rests: the environment map is turned (lag, ghosting), the camera steps aside (disocclusion).

use glam::DVec3;

use super::FramesSession;
use super::displayed::{Displayed, FrameReference};
use super::scenes::FramesScene;
use super::signal::{EqualTime, PlainClock};
use super::stage::{Stage, is_plain_timed, turned};
use crate::bench::frame_log::FrameLog;
use crate::bench::lag::add_ghost;
use crate::bench::masks;
use crate::bench::record::frames::{ChangedFrames, FramesChange, PlainPoint};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::{Ghosting, LagCurve, recovery};
use crate::raster::Primary;
use crate::realtime::{Preset, Realtime, Settings, Surface};
use crate::scene::{Camera, EnvironmentMap};

/// How far the environment map is turned at once, degrees.
const TURN: f64 = 30.0;
/// How far the camera steps aside, distances to what it goes round.
const STEP: f64 = 0.25;
/// Pixels below which an error over them says nothing.
const MIN_PIXELS: usize = 8;
/// How much more than the settled error still counts as recovered.
const RECOVERED: f64 = 1.1;

/// Measures all changes that the scene can have.
///
/// # Errors
/// Those of the device; Ctrl-C.
pub fn measure(session: &mut FramesSession, loaded: &FramesScene, stage: &mut Stage) -> Result<Vec<FramesChange>> {
    let mut records = Vec::new();
    if let Some(map) = stage.map() {
        records.push(turn(session, &loaded.name, stage, map)?);
    }
    records.extend(sidestep(session, loaded, stage)?);
    Ok(records)
}

/// Presets in turn; those for which no time is left are left out.
fn presets(
    session: &mut FramesSession,
    name: &str,
    record: &mut FramesChange,
    mut one: impl FnMut(Preset) -> Result<ChangedFrames>,
) -> Result<()> {
    for preset in session.args.presets() {
        if session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{name}: {preset}"));
            continue;
        }
        session.phase(format!("{name}: {preset}"));
        record.results.push(one(preset)?);
    }
    Ok(())
}

/// The environment map is turned at once.
fn turn(session: &mut FramesSession, name: &str, stage: &mut Stage, map: &EnvironmentMap) -> Result<FramesChange> {
    let name = format!("{name}, turn");
    session.phase(format!("{name}: references"));
    let (camera, paths) = (stage.still_camera(), session.args.reference_paths());
    let after = turned(map, TURN);
    let wrong = stage.reference(&camera, paths)?;
    stage.turn_environment(&after)?;
    let reference = stage.reference(&camera, paths)?;
    let frames = frames_after(session);
    let pixels = u64::from(stage.size[0]) * u64::from(stage.size[1]);
    let mut record =
        FramesChange { change: "turn".into(), frames, pixels, reference_rmse: reference.rmse, results: Vec::new() };
    let outcome = presets(session, &name, &mut record, |preset| {
        let mut realtime = stage.realtime(preset)?;
        realtime.turn_environment(map.to_map);
        let mut log = FrameLog::default();
        for _ in 0..frames {
            log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        }
        let old = Displayed::new(&realtime.result()?, stage.channels());
        realtime.turn_environment(after);
        let run = run(&mut realtime, stage, &camera, frames, (&reference, None))?;
        // what it ends at without any past
        realtime.reset();
        for _ in 0..frames {
            log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        }
        let settled = Displayed::new(&realtime.result()?, stage.channels());
        let share = |image: &Displayed, ghosting: &mut Ghosting| {
            let references = (&reference.displayed.coded[..], &wrong.displayed.coded[..]);
            add_ghost(ghosting, (&image.coded, &settled.coded), references, None).map_or(f64::NAN, |r| r.share)
        };
        // what it showed before is all of it, also where that is not what was right
        let all = share(&old, &mut Ghosting::default());
        let mut ghosting = Ghosting::default();
        let lag = LagCurve::new(run.images.iter().map(|image| share(image, &mut ghosting) / all).collect());
        Ok(ChangedFrames {
            preset: preset.to_string(),
            plain: plain(stage, &camera, &run.time, frames, (&reference, None))?,
            rmse: run.rmse,
            half_life: Some(lag.fitted_half_life()),
            gone: lag.gone(),
            ghosting: Some(ghosting.energy()),
            residuals: lag.residuals().to_vec(),
            recovery: None,
        })
    });
    stage.turn_environment(&map.to_map)?;
    outcome.map(|()| record)
}

/// The camera steps aside, once. `None` where that shows nothing new.
fn sidestep(session: &mut FramesSession, loaded: &FramesScene, stage: &mut Stage) -> Result<Option<FramesChange>> {
    let name = format!("{}, sidestep", loaded.name);
    session.phase(format!("{name}: reference"));
    let from = stage.still_camera();
    let mut to_world = loaded.camera.camera_to_world;
    let step = STEP * to_world.translation.distance(loaded.middle);
    to_world.translation += to_world.transform_vector3(DVec3::X).normalize_or_zero() * step;
    let camera = stage.camera_record(&Camera { camera_to_world: to_world, ..loaded.camera.clone() });
    let mask = masks::newly_seen(&surfaces(stage, &camera)?, &surfaces(stage, &from)?, &from, stage.size);
    let pixels = mask.iter().filter(|m| **m > 0.0).count();
    if pixels < MIN_PIXELS {
        session.note(format!("{name}: the step shows next to nothing new at this size"));
        return Ok(None);
    }
    let reference = stage.reference(&camera, session.args.reference_paths())?;
    let frames = frames_after(session);
    let mut record = FramesChange {
        change: "sidestep".into(),
        frames,
        pixels: pixels as u64,
        reference_rmse: reference.rmse,
        results: Vec::new(),
    };
    presets(session, &name, &mut record, |preset| {
        let mut realtime = stage.realtime(preset)?;
        let mut log = FrameLog::default();
        for _ in 0..frames {
            log.frame(&mut realtime, &stage.tracer, &from, &[])?;
        }
        let run = run(&mut realtime, stage, &camera, frames, (&reference, Some(&mask)))?;
        let settled = run.rmse.last().copied().unwrap_or(f64::NAN);
        Ok(ChangedFrames {
            preset: preset.to_string(),
            plain: plain(stage, &camera, &run.time, frames, (&reference, Some(&mask)))?,
            recovery: recovery(&run.rmse, settled, RECOVERED),
            rmse: run.rmse,
            ..ChangedFrames::default()
        })
    })?;
    Ok(Some(record))
}

/// Frames that are looked at after a change, and frames at rest before it.
fn frames_after(session: &FramesSession) -> u32 {
    (session.args.frames() * 2 / 3).max(8)
}

/// Frames after a change.
struct Run {
    rmse: Vec<f64>,
    images: Vec<Displayed>,
    time: EqualTime,
}

fn run(
    realtime: &mut Realtime,
    stage: &mut Stage,
    camera: &CameraRecord,
    frames: u32,
    (reference, mask): (&FrameReference, Option<&[f32]>),
) -> Result<Run> {
    let (mut log, mut rmse, mut images) = (FrameLog::default(), Vec::new(), Vec::new());
    let mut clock = PlainClock::default();
    for frame in 0..frames {
        log.frame(realtime, &stage.tracer, camera, &[])?;
        if is_plain_timed(frame, 0, frames) {
            stage.time_plain(camera, &mut clock)?;
        }
        let image = Displayed::new(&realtime.result()?, stage.channels());
        rmse.push(reference.rmse_over(&image, mask)?);
        images.push(image);
    }
    Ok(Run { rmse, images, time: EqualTime::new(clock.time(), log.typical(0)) })
}

/// Errors of plain accumulation that starts with the change, after 1, 2, 4, ... frames.
fn plain(
    stage: &mut Stage,
    camera: &CameraRecord,
    time: &EqualTime,
    frames: u32,
    (reference, mask): (&FrameReference, Option<&[f32]>),
) -> Result<Vec<PlainPoint>> {
    let mut points = Vec::new();
    for frame in (0..).map(|k| 1 << k).take_while(|f| *f <= frames) {
        let image = stage.plain(camera, time.paths(frame), stage.seed)?;
        points.push(PlainPoint { frame, rmse: reference.rmse_over(&Displayed::new(&image, stage.channels()), mask)? });
    }
    Ok(points)
}

/// What each pixel shows.
fn surfaces(stage: &Stage, camera: &CameraRecord) -> Result<Vec<Option<Surface>>> {
    let settings = Settings { primary: Some(Primary::Traced), ..Preset::Fast.settings() };
    let mut realtime = Realtime::new(&stage.tracer, stage.size, &settings, &[])?;
    realtime.frame(&stage.tracer, camera, &[])?;
    realtime.surfaces()
}
