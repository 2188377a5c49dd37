//! A scene: every preset standing still, moving, and after changes.

use super::args::Part;
use super::scenes::{self, FramesScene};
use super::stage::{Motion, Stage};
use super::{FramesSession, change, moving, peers, still, table};
use crate::accel::flatten::FlatScene;
use crate::bench::frame_log::FRAMES_PER_TURN;
use crate::bench::record::frames::FramesView;
use crate::denoise::Oidn;
use crate::error::Result;
use crate::realtime::sequence::{CameraMotion, FrameSequence};
use crate::scene::{AnimationRig, Orbit};

/// Of an animation.
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

/// Measures a scene.
///
/// # Errors
/// Those of loading the scene and of the device; Ctrl-C.
pub fn measure(session: &mut FramesSession, source: &str, oidn: Option<&Oidn>) -> Result<()> {
    let args = session.args;
    session.phase(format!("{source}: loading"));
    let loaded = scenes::load(source, args)?;
    session.note_warnings(&loaded.name, &loaded.scene);
    let scene = &loaded.scene;
    let has_animation = scene.rig.as_ref().is_some_and(|rig: &AnimationRig| !rig.animations().is_empty());
    let animation = (has_animation && args.wants(Part::Animation)).then_some(0);
    let camera = loaded.camera.clone();
    let sequence = FrameSequence::new(scene, camera, None, CameraMotion::Still, animation, FRAMES_PER_SECOND)?;
    let flat = FlatScene::with_motion_and_blend(scene, sequence.motion()?, args.integrator.get().blend())?;
    session.phase(format!("{}: building", loaded.name));
    let mut stage = Stage::new(session, &loaded, &flat, None, oidn)?;
    let mut record = FramesView {
        scene: loaded.name.clone(),
        primitives: scene.triangle_count() + scene.sphere_count(),
        light: loaded.light.clone(),
        ms_per_path: stage.plain_time.per_path,
        ms_per_image: stage.plain_time.per_image,
        ..FramesView::default()
    };
    let outcome = fill(session, &loaded, &mut stage, animation.map(|_| sequence), &mut record);
    // what there is, also where it failed
    if !(record.still.is_empty() && record.motions.is_empty() && record.changes.is_empty()) {
        session.show(&table::view(&record))?;
        session.record.views.push(record);
    }
    outcome
}

fn fill<'a>(
    session: &mut FramesSession,
    loaded: &'a FramesScene,
    stage: &mut Stage<'a>,
    sequence: Option<FrameSequence<'a>>,
    record: &mut FramesView,
) -> Result<()> {
    let args = session.args;
    let mut motions = Vec::new();
    if args.wants(Part::Moving) {
        motions.push(Motion::Orbit(Orbit::vertical(loaded.middle, FRAMES_PER_TURN)?));
    }
    motions.extend(stage.map().filter(|_| args.wants(Part::Sun)).map(Motion::Sun));
    motions.extend(sequence.map(|s| Motion::Animation(Box::new(s))));
    // the still camera, each motion, the changes
    let steps = motions.len() as f64 + 2.0;
    if args.wants(Part::Still) {
        session.phase(format!("{}: reference", loaded.name));
        let reference = stage.reference(&stage.still_camera(), args.reference_paths())?;
        record.reference_rmse = reference.rmse;
        let mut beside = peers::prepare(session, loaded)?;
        for preset in args.presets() {
            if session.is_late() && !record.still.is_empty() {
                session.leave_out(&format!("{}, still: {preset}", loaded.name));
                continue;
            }
            session.phase(format!("{}, still: {preset}", loaded.name));
            record.still.push(still::measure(session, stage, preset, &reference, &mut beside)?);
        }
    }
    let is_late = |session: &mut FramesSession, record: &FramesView, what: &str| {
        let late = session.is_late() && !(record.still.is_empty() && record.motions.is_empty());
        if late {
            session.leave_out(&format!("{}, {what}", loaded.name));
        }
        late
    };
    for (k, motion) in motions.into_iter().enumerate() {
        session.advance((k as f64 + 1.0) / steps);
        if !is_late(session, record, motion.name()) {
            record.motions.push(moving::measure(session, &loaded.name, stage, motion)?);
        }
    }
    if args.wants(Part::Change) {
        session.advance((steps - 1.0) / steps);
        if !is_late(session, record, "changes") {
            record.changes = change::measure(session, loaded, stage)?;
        }
    }
    Ok(())
}
