//! Scenes that change while they are seen: something appears, something slides, the camera steps aside.

mod appear;
mod masks;
mod room;
mod script;
mod sequence;
mod sidestep;

use super::Bench;
use super::candidates::Candidate;
use super::laps::Laps;
use super::reference::{Referee, Truth};
use super::shot::Shot;
use super::table;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::{ChangeRecord, ChangeResult};
use crate::bench::record::ao_verdict::THEIRS;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::{Ghosting, LagCurve, Residual, recovery};
use crate::realtime::{Realtime, Technique};
use crate::scene::load;
use crate::tracer::Tracer;
use script::Script;

/// How much more than the settled error still counts as recovered.
const RECOVERED: f64 = 1.1;

/// What is animated, unless scenes are named.
const ANIMATED: &str = "builtin:parade";

/// All changes: those of a room of our own, and the first animation of each scene that has one.
pub fn measure(bench: &mut Bench, scenes: &[String]) -> Result<()> {
    let room = room::Room::new();
    let aspect = bench.aspect();
    let animated = if bench.args.scenes.is_empty() { vec![ANIMATED.to_owned()] } else { scenes.to_vec() };
    let jobs = animated.len() as f64 + 3.0;
    let plays: [(&str, Script, Play); 3] = [
        ("appear", room.appearing(), appear::play),
        ("slide", room.sliding(aspect), sequence::play),
        ("sidestep", room.standing(), sidestep::play),
    ];
    for (k, (change, script, play)) in plays.into_iter().enumerate() {
        bench.advance(k as f64 / jobs);
        one(bench, change, script, play)?;
    }
    for (k, source) in animated.iter().enumerate() {
        bench.advance((k as f64 + 3.0) / jobs);
        let scene = load::load(source)?;
        if let Some(script) = Script::animated(source, &scene, aspect)? {
            one(bench, "animated", script, sequence::play)?;
        }
    }
    Ok(())
}

type Play = fn(&mut Bench, &mut Script, &mut Stage, &mut ChangeRecord) -> Result<()>;

fn one(bench: &mut Bench, change: &str, mut script: Script, play: Play) -> Result<()> {
    let name = format!("{}, {change}", script.name);
    if bench.is_late() && !bench.out.is_empty() {
        bench.leave_out(&name);
        return Ok(());
    }
    let flat = FlatScene::with_motion(script.scene, script.motion.clone())?;
    let mut tracer = bench.tracer(&name, &flat)?;
    let occlusion = bench.args.occlusion(script.reach)?;
    let size = bench.args.size();
    let referee = Referee::new(&tracer, size, &occlusion, bench.args.reference_rays())?;
    let camera = CameraRecord::new(&script.camera, flat.origin, bench.aspect());
    let mut stage = Stage { tracer: &mut tracer, referee, size, camera, occlusion, name };
    let mut record = ChangeRecord { scene: script.name.clone(), change: change.to_owned(), ..Default::default() };
    let outcome = play(bench, &mut script, &mut stage, &mut record);
    compare(&mut record);
    if !record.results.is_empty() {
        bench.lines(&table::change(&record))?;
        bench.out.changes.push(record);
    }
    outcome
}

/// Where a script is played.
struct Stage<'a> {
    tracer: &'a mut Tracer,
    referee: Referee,
    size: [u32; 2],
    camera: CameraRecord,
    occlusion: super::candidates::Occlusion,
    name: String,
}

impl Stage<'_> {
    /// What is right now.
    fn truth(&mut self) -> Result<Truth> {
        self.referee.truth(self.tracer, &self.camera)
    }

    /// What the camera sees now.
    fn shot(&self) -> Shot<'_> {
        Shot { tracer: self.tracer, size: self.size, camera: self.camera, occlusion: self.occlusion }
    }
}

/// Presets that know a past.
fn candidates(bench: &Bench) -> Vec<&'static Candidate> {
    bench.args.candidates().into_iter().filter(|c| c.name != "reference").collect()
}

/// A result with the name of its preset.
fn result_of(candidate: &Candidate, stage: &Stage) -> ChangeResult {
    let technique: Technique = candidate.settings(&stage.occlusion).technique;
    ChangeResult { preset: candidate.name.to_owned(), technique: technique.name().to_owned(), ..Default::default() }
}

/// How much of `wrong` an image shows, added to `ghosting`. `settled` is what the preset itself ends at when nothing changes any more: what
/// it always gets wrong is no ghost. `None` where nothing differs.
fn ghost(
    ghosting: &mut Ghosting,
    (image, settled): (&[f32], &[f32]),
    (truth, wrong): (&Truth, &Truth),
    mask: &[f32],
) -> Option<Residual> {
    // as if it settled at what is right
    let shifted: Vec<f32> = image.iter().zip(settled).zip(&truth.image).map(|((v, s), t)| v - s + t).collect();
    ghosting.add(&shifted, &truth.image, &wrong.image, Some(mask))
}

/// What a preset shows of a scene that does not change, in each of `frames` frames from now on, without any past.
fn afresh(realtime: &mut Realtime, stage: &Stage, frames: u32) -> Result<Vec<Vec<f32>>> {
    realtime.reset();
    let mut laps = Laps::default();
    let one = |_| {
        laps.frame(realtime, stage.tracer, &stage.camera, &[])?;
        realtime.result()
    };
    (0..frames).map(one).collect()
}

/// The last of them: what it ends at.
fn settled(realtime: &mut Realtime, stage: &Stage, frames: u32) -> Result<Vec<f32>> {
    Ok(afresh(realtime, stage, frames)?.pop().unwrap_or_default())
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

/// What the residuals of frames after a sudden change say, beside what the preset ends at and beside frames of the same age without a
/// past.
fn lag(result: &mut ChangeResult, residuals: Vec<f64>, memory: Vec<f64>) {
    let remembered = LagCurve::new(memory);
    result.memory_half_life = Some(remembered.fitted_half_life());
    result.memory = remembered.residuals().to_vec();
    let curve = LagCurve::new(residuals);
    result.half_life = Some(curve.half_life());
    result.fitted_half_life = Some(curve.fitted_half_life());
    result.gone = curve.gone();
    result.residuals = curve.residuals().to_vec();
}
