//! A scene from one or several views: every preset standing still, moving, and after changes.

use super::args::{FramesSession, Part};
use super::frame_log::FRAMES_PER_TURN;
use super::scenes::{self, CameraView, FramesScene};
use super::stage::{Motion, SceneStage};
use super::{change, larsen, moving, peers, still};
use crate::accel::flatten::FlatScene;
use crate::bench::record::{REFERENCE, plain, quantity};
use crate::denoise::Oidn;
use crate::error::Result;
use crate::realtime::sequence::{CameraMotion, FrameSequence};
use crate::report::thousands;
use crate::scene::{self, AnimationRig, Orbit};

/// Frames a second of an animation.
const FRAMES_PER_SECOND: f64 = 60.0;

/// Open Image Denoise, where it is there; a note says why not.
pub fn open_denoiser(session: &mut FramesSession) -> Option<Oidn> {
    match Oidn::open() {
        Ok(oidn) => Some(oidn),
        Err(e) => {
            session.note(format!("plain accumulation with Open Image Denoise left out: {e}"));
            None
        }
    }
}

pub fn measure(session: &mut FramesSession, source: &str, oidn: Option<&Oidn>) -> Result<()> {
    // the scene, with all that may move in it
    let args = session.args;
    session.phase(format!("{source}: loading"));
    let loaded = scenes::load(source, args)?;
    session.note_warnings(&loaded.name, &loaded.scene);
    let scene = &loaded.scene;
    let has_animation = scene.rig.as_ref().is_some_and(|rig: &AnimationRig| !rig.animations().is_empty());
    let animation = (has_animation && args.wants(Part::Animation)).then_some(0);
    let sequence = |view: &CameraView| {
        FrameSequence::new(scene, view.camera.clone(), None, CameraMotion::Still, animation, FRAMES_PER_SECOND)
    };
    let motion = match loaded.mover {
        Some(mover) => {
            scene::Motion { instances: vec![mover.instance], meshes: Vec::new(), ..scene::Motion::default() }
        }
        None => loaded.views.first().map(sequence).transpose()?.map_or(Ok(scene::Motion::default()), |s| s.motion())?,
    };
    let flat = FlatScene::with_motion_and_blend(scene, motion, args.integrator().get().blend())?;

    for (k, view) in loaded.views.iter().enumerate() {
        if !session.has_time_for(view.name.clone()) {
            continue;
        }
        session.phase(format!("{}: building", view.name));
        let mut stage = SceneStage::new(session, (&loaded, view), &flat, args.size(), None, oidn)?;
        let sequence = animation.map(|_| sequence(view)).transpose()?;
        let views = loaded.views.len() as f64;
        let outcome = fill(session, (&loaded, view), &mut stage, sequence, [k, k + 1].map(|k| k as f64 / views));
        // what there is, also where it failed
        describe(session, &loaded, view, &stage);
        session.show_scene(&view.name)?;
        outcome?;
    }
    Ok(())
}

/// Says what a view is of, if anything was measured of it.
fn describe(session: &mut FramesSession, loaded: &FramesScene, view: &CameraView, stage: &SceneStage) {
    if !session.record.measurements.iter().any(|m| m.scene == view.name) {
        return;
    }
    let (primitives, light) = (thousands(loaded.primitives()), &loaded.light);
    let (image, path) = (stage.plain_time.per_image, stage.plain_time.per_path);
    let reach = if stage.channels() == 1 { format!(", occlusion reaches {:.4}", loaded.reach) } else { String::new() };
    session.record.scene(&view.name).about = format!(
        "{primitives} primitives, light {light}{reach}; plain accumulation takes {image:.2} ms an image and {path:.2} ms a path"
    );
}

fn fill<'a>(
    session: &mut FramesSession,
    (loaded, view): (&'a FramesScene, &'a CameraView),
    stage: &mut SceneStage<'a>,
    sequence: Option<FrameSequence<'a>>,
    [from, to]: [f64; 2],
) -> Result<()> {
    // what moves; the still camera, each motion and the changes are steps
    let args = session.args;
    let mut motions = Vec::new();
    if args.wants(Part::Moving) {
        motions.push(Motion::Orbit(Orbit::vertical(view.middle, FRAMES_PER_TURN)?));
    }
    motions.extend(stage.map().filter(|_| args.wants(Part::Sun)).map(Motion::Sun));
    motions.extend(sequence.map(|s| Motion::Animation(Box::new(s))));
    motions.extend(loaded.mover.filter(|_| args.wants(Part::Animation)).map(Motion::Slide));
    let steps = motions.len() as f64 + 2.0;
    let share = |step: f64| from + (to - from) * step / steps;

    if args.wants_still() || args.wants(Part::Rest) {
        measure_still(session, (loaded, view), stage)?;
    }
    for (k, motion) in motions.into_iter().enumerate() {
        session.advance(share(k as f64 + 1.0));
        if session.has_time_for(format!("{}, {}", view.name, motion.name())) {
            moving::measure(session, &view.name, stage, motion)?;
        }
    }
    if args.wants(Part::Change) {
        session.advance(share(steps - 1.0));
        if session.has_time_for(format!("{}, changes", view.name)) {
            change::measure(session, view, stage, loaded.mover)?;
        }
    }
    Ok(())
}

/// Everything about a camera that stands still.
fn measure_still(
    session: &mut FramesSession,
    (loaded, view): (&FramesScene, &CameraView),
    stage: &mut SceneStage,
) -> Result<()> {
    // the reference
    let (args, scene) = (session.args, view.name.as_str());
    session.phase(format!("{scene}: reference"));
    let reference = stage.reference(&stage.still_camera(), args.reference_paths())?;
    let covered = reference.mask.as_ref().map(|mask| mask.iter().filter(|m| **m > 0.0).count() as f64);
    if covered == Some(0.0) {
        session.note(format!("{scene}: nothing is in view"));
        return Ok(());
    }

    // each preset, at rest as well
    let mut beside = peers::prepare(session, loaded, view)?;
    let mut results = Vec::new();
    for candidate in args.candidates() {
        if !session.has_time_for(format!("{scene}, still: {}", candidate.name)) {
            continue;
        }
        if args.wants_still() {
            results.push(still::measure(session, scene, stage, candidate, &reference, &mut beside)?);
        }
        if args.wants(Part::Rest) {
            still::measure_rest(session, scene, stage, candidate, &reference)?;
        }
    }
    let mut row = session.record.row(scene, still::PART, REFERENCE);
    row.exact(quantity::RMSE.not_compared(), reference.rmse).exact(plain("pixels", ""), covered);

    // beside Larsen's pipeline
    let said = larsen::remarks(&results);
    session.record.scene(scene).remarks.extend(said);
    if args.wants(Part::EqualTime) && !session.is_late() {
        session.phase(format!("{scene}: equal time"));
        let record = &mut session.record;
        larsen::measure_equal_time(record, scene, stage, &results, &reference, args.frames())?;
    }
    Ok(())
}
