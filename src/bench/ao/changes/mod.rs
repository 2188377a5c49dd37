//! Scenes that change while they are seen: something appears, something slides, the camera steps aside.

mod appear;
mod room;
mod script;
mod sequence;
mod sidestep;
mod stage;

use super::reference::ReferenceRenderer;
use super::session::AoSession;
use super::table;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::ChangeRecord;
use crate::bench::record::ao_verdict::THEIRS;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::recovery;
use crate::scene::load;
use script::ChangeScript;
use stage::{ChangeStage, RECOVERED};

/// What is animated, unless scenes are named.
const ANIMATED: &str = "builtin:parade";

/// All changes: those of a room of our own, and the first animation of each scene that has one.
pub fn measure(session: &mut AoSession, scenes: &[String]) -> Result<()> {
    let room = room::Room::new();
    let aspect = session.aspect();
    let animated = if session.args.scenes.is_empty() { vec![ANIMATED.to_owned()] } else { scenes.to_vec() };
    let jobs = animated.len() as f64 + 3.0;
    let plays: [(&str, ChangeScript, Play); 3] = [
        ("appear", room.appearing(), appear::play),
        ("slide", room.sliding(aspect), sequence::play),
        ("sidestep", room.standing(), sidestep::play),
    ];
    for (k, (change, script, play)) in plays.into_iter().enumerate() {
        session.advance(k as f64 / jobs);
        one(session, change, script, play)?;
    }
    for (k, source) in animated.iter().enumerate() {
        session.advance((k as f64 + 3.0) / jobs);
        let scene = load::load(source)?;
        if let Some(script) = ChangeScript::animated(source, &scene, aspect)? {
            one(session, "animated", script, sequence::play)?;
        }
    }
    Ok(())
}

type Play = fn(&mut AoSession, &mut ChangeScript, &mut ChangeStage, &mut ChangeRecord) -> Result<()>;

fn one(session: &mut AoSession, change: &str, mut script: ChangeScript, play: Play) -> Result<()> {
    let name = format!("{}, {change}", script.name);
    if session.is_over() {
        session.leave_out(&name);
        return Ok(());
    }
    let flat = FlatScene::with_motion(script.scene, script.motion.clone())?;
    let mut tracer = session.tracer(&name, &flat)?;
    let occlusion = session.args.occlusion(script.reach)?;
    let size = session.args.size();
    let reference_renderer = ReferenceRenderer::new(&tracer, size, &occlusion, session.args.reference_rays())?;
    let camera = CameraRecord::new(&script.camera, flat.origin, session.aspect());
    let mut stage = ChangeStage { tracer: &mut tracer, reference_renderer, size, camera, occlusion, name };
    let mut record = ChangeRecord { scene: script.name.clone(), change: change.to_owned(), ..Default::default() };
    let outcome = play(session, &mut script, &mut stage, &mut record);
    compare(&mut record);
    if !record.results.is_empty() {
        session.show(&table::change(&record))?;
        session.record.changes.push(record);
    }
    outcome
}

/// What says something only beside the pipeline of the reference work.
fn compare(record: &mut ChangeRecord) {
    let theirs = record.results.iter().find(|r| r.preset == THEIRS);
    let their_half_life = theirs.and_then(|r| r.memory_half_life);
    let their_end = theirs.filter(|r| r.recovery.is_some()).and_then(|r| r.rmse.last().copied());
    for r in &mut record.results {
        r.times_as_quick = their_half_life.zip(r.memory_half_life).map(|(theirs, ours)| theirs / ours).filter(|x| !x.is_nan());
        r.recovery_to_larsen = their_end.and_then(|end| recovery(&r.rmse, end, RECOVERED));
    }
}
