//! The camera steps aside, once: how long what it had not seen before takes to look like the rest.

use glam::DVec3;

use super::script::Script;
use super::{RECOVERED, Stage, candidates, masks, result_of};
use crate::bench::ao::Bench;
use crate::bench::ao::laps::Laps;
use crate::bench::record::ao::ChangeRecord;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::recovery;
use crate::scene::Camera;

/// World units, to the right.
const STEP: f64 = 0.5;

/// Plays it with every preset.
pub fn play(bench: &mut Bench, script: &mut Script, stage: &mut Stage, record: &mut ChangeRecord) -> Result<()> {
    bench.phase(format!("{}: references", stage.name));
    let before = stage.truth()?;
    let from = stage.camera;
    let mut to_world = script.camera.camera_to_world;
    to_world.translation += to_world.transform_vector3(DVec3::X * STEP);
    let camera = Camera { camera_to_world: to_world, ..script.camera.clone() };
    stage.camera = CameraRecord::new(&camera, script.scene.origin(), bench.aspect());
    let truth = stage.truth()?;
    let mask = masks::newly_seen(&truth.surfaces, &before.surfaces, &from, stage.size);
    let frames = bench.args.frames();
    record.frames = frames;
    record.pixels = mask.iter().filter(|m| **m > 0.0).count() as u64;
    record.reference_rmse = truth.rmse;
    if record.pixels == 0 {
        bench.note(format!("{}: the step shows nothing new at this size", stage.name));
        return Ok(());
    }
    for candidate in candidates(bench) {
        if bench.is_late() && !record.results.is_empty() {
            bench.leave_out(&format!("{}: {}", stage.name, candidate.name));
            continue;
        }
        bench.phase(format!("{}: {}", stage.name, candidate.name));
        let mut realtime = stage.shot().realtime(&candidate.settings(&stage.occlusion))?;
        let mut laps = Laps::default();
        for _ in 0..frames {
            laps.frame(&mut realtime, stage.tracer, &from, &[])?;
        }
        let mut result = result_of(candidate, stage);
        for _ in 0..frames {
            laps.frame(&mut realtime, stage.tracer, &stage.camera, &[])?;
            result.rmse.push(truth.rmse_over(&realtime.result()?, &mask)?);
        }
        let settled = result.rmse.last().copied().unwrap_or(f64::NAN);
        result.recovery = recovery(&result.rmse, settled, RECOVERED);
        result.errors = Some(truth.errors_of(&realtime.result()?)?);
        record.results.push(result);
    }
    Ok(())
}
