//! The camera steps aside, once: how long what it had not seen before takes to look like the rest.

use glam::DVec3;

use super::script::ChangeScript;
use super::stage::{ChangeStage, RECOVERED, candidates, result_of};
use crate::bench::ao::session::AoSession;
use crate::bench::frame_log::FrameLog;
use crate::bench::masks;
use crate::bench::record::ao::ChangeRecord;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::recovery;
use crate::scene::Camera;

/// Scene units, to the right.
const STEP: f64 = 0.5;

/// Plays it with every preset.
pub fn play(
    session: &mut AoSession,
    script: &mut ChangeScript,
    stage: &mut ChangeStage,
    record: &mut ChangeRecord,
) -> Result<()> {
    session.phase(format!("{}: references", stage.name));
    let before = stage.reference()?;
    let from = stage.camera;
    let mut to_world = script.camera.camera_to_world;
    to_world.translation += to_world.transform_vector3(DVec3::X * STEP);
    let camera = Camera { camera_to_world: to_world, ..script.camera.clone() };
    stage.camera = CameraRecord::new(&camera, script.scene.origin(), session.aspect());
    let reference = stage.reference()?;
    let mask = masks::newly_seen(&reference.surfaces, &before.surfaces, &from, stage.size);
    let frames = session.args.frames();
    record.frames = frames;
    record.pixels = mask.iter().filter(|m| **m > 0.0).count() as u64;
    record.reference_rmse = reference.rmse;
    if record.pixels == 0 {
        session.note(format!("{}: the step shows nothing new at this size", stage.name));
        return Ok(());
    }
    for candidate in candidates(session) {
        if session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{}: {}", stage.name, candidate.name));
            continue;
        }
        session.phase(format!("{}: {}", stage.name, candidate.name));
        let mut realtime = stage.renderer().realtime(&candidate.settings(&stage.occlusion))?;
        let mut log = FrameLog::default();
        for _ in 0..frames {
            log.frame(&mut realtime, stage.tracer, &from, &[])?;
        }
        let mut result = result_of(candidate, stage);
        for _ in 0..frames {
            log.frame(&mut realtime, stage.tracer, &stage.camera, &[])?;
            result.rmse.push(reference.rmse_over(&realtime.result()?, &mask)?);
        }
        let settled = result.rmse.last().copied().unwrap_or(f64::NAN);
        result.recovery = recovery(&result.rmse, settled, RECOVERED);
        result.errors = Some(reference.errors_of(&realtime.result()?)?);
        record.results.push(result);
    }
    Ok(())
}
