//! Something moves in every frame: the camera, the sun, or objects.

use super::args::FramesSession;
use super::candidates::Candidate;
use super::frame_log::{FrameLog, first_timed, measured};
use super::signal::EqualTime;
use super::stage::{DenoisedImage, Motion, PLAIN_SEED, PlainImage, SceneStage};
use super::still::plain_remark;
use crate::bench::record::{REFERENCE, plain, quantity};
use crate::error::Result;
use crate::measure::displayed::{FrameReference, ImageErrors};
use crate::measure::plain_time::{PlainClock, is_plain_timed};
use crate::measure::stats::Percentiles;
use crate::measure::temporal::Ghosting;
use crate::realtime::surface_masks;

/// A frame whose error is measured.
struct Moment {
    frame: u32,
    reference: FrameReference,
    /// With moving objects: the reference before, and pixels of the same surface at rest in both.
    before: Option<(FrameReference, Vec<f32>)>,
}

/// Measures all presets.
pub fn measure(session: &mut FramesSession, scene: &str, stage: &mut SceneStage, mut motion: Motion) -> Result<()> {
    let (part, paths) = (motion.name(), session.args.moving_reference_paths());
    session.phase(format!("{scene}, {part}: references"));
    let mut moments = Vec::new();
    for frame in measured(session.args.frames()) {
        let mut before = None;
        if motion.moves_objects() {
            let camera = stage.move_to(&mut motion, frame.saturating_sub(1))?.camera;
            before = Some((stage.reference(&camera, paths)?, stage.surfaces(&camera)?));
        }
        let camera = stage.move_to(&mut motion, frame)?.camera;
        let reference = stage.reference(&camera, paths)?;
        let before = match before {
            None => None,
            Some((old, surfaces)) => {
                Some((old, surface_masks::unchanged(&stage.surfaces(&camera)?, &surfaces, stage.reach)))
            }
        };
        moments.push(Moment { frame, reference, before });
    }
    let error = moments.iter().map(|m| m.reference.rmse).sum::<f64>() / moments.len().max(1) as f64;
    for (k, candidate) in session.args.candidates().into_iter().enumerate() {
        if !session.has_time_for(format!("{scene}, {part}: {}", candidate.name)) {
            continue;
        }
        measure_preset(session, scene, stage, &mut motion, candidate, &moments)?;
        if k == 0 {
            session.record.row(scene, part, REFERENCE).exact(quantity::RMSE.not_compared(), error);
        }
    }
    // what comes after begins where everything was
    stage.move_to(&mut motion, 0)?;
    stage.rest()
}

fn measure_preset(
    session: &mut FramesSession,
    scene: &str,
    stage: &mut SceneStage,
    motion: &mut Motion,
    candidate: &Candidate,
    moments: &[Moment],
) -> Result<()> {
    // the frames
    let (frames, part) = (session.args.frames(), motion.name());
    let mut realtime = stage.realtime(candidate)?;
    let (mut log, mut errors, mut images) = (FrameLog::default(), Vec::new(), Vec::new());
    let mut unfiltered = Vec::new();
    let (mut clock, mut updates) = (PlainClock::default(), Vec::new());
    for frame in 0..frames {
        let inputs = stage.move_to(motion, frame)?;
        updates.extend(inputs.update_seconds.filter(|_| frame > 0).map(|s| 1e3 * s));
        inputs.light(&mut realtime, &stage.tracer)?;
        // what the scene was before the first frame is nobody's history
        let moved = if frame == 0 { &[][..] } else { &inputs.moved };
        log.render_frame(&mut realtime, &stage.tracer, &inputs.camera, moved)?;
        // so that structures are built anew where that pays
        stage.tracer.traced(log.seconds().last().copied().unwrap_or_default());
        if is_plain_timed(frame, first_timed(frames), frames) {
            stage.time_plain(&inputs.camera, &mut clock)?;
        }
        if let Some(m) = moments.iter().find(|m| m.frame == frame) {
            let image = realtime.result()?;
            errors.push(m.reference.errors_of(&image)?);
            if stage.channels() == 1 {
                unfiltered.push(m.reference.errors_of(&realtime.unfiltered()?)?);
            }
            images.push(image);
        }
    }

    // plain accumulation in the time of the last one: the first has other samples
    let cost = log.cost(first_timed(frames));
    let typical = log.typical(first_timed(frames)).pop();
    let time = EqualTime::new(clock.time(), typical.into_iter().collect());
    let (mut plains, mut denoised) = (Vec::new(), Vec::new());
    for m in moments {
        let camera = stage.move_to(motion, m.frame)?.camera;
        plains.push(stage.plain_image(&camera, time.paths(1), &m.reference, PLAIN_SEED + m.frame)?.errors);
        denoised.extend(stage.denoised(&camera, (&time, 1, true), &m.reference, PLAIN_SEED + m.frame)?);
    }
    let mean = |all: &[ImageErrors]| ImageErrors::mean(all).unwrap_or_default();
    let denoised = denoised.first().map(|first: &DenoisedImage| DenoisedImage {
        errors: mean(&denoised.iter().map(|d| d.errors).collect::<Vec<_>>()),
        ms: denoised.iter().map(|d| d.ms).sum::<f64>() / denoised.len() as f64,
        paths: first.paths,
    });

    // what is left of the frame before, beside what the preset ends at when everything rests
    let (mut ghosting, mut shares) = (Ghosting::default(), Vec::new());
    for (m, image) in moments.iter().zip(&images) {
        let Some((old, mask)) = &m.before else { continue };
        let inputs = stage.move_to(motion, m.frame)?;
        inputs.light(&mut realtime, &stage.tracer)?;
        stage.rest()?;
        let settled = stage.frames_afresh(&mut realtime, &inputs.camera, frames)?.pop().unwrap_or_default();
        let [image, settled] = [image, &settled].map(|image| stage.displayed(image).coded);
        let references = (&m.reference.displayed.coded[..], &old.displayed.coded[..]);
        shares.extend(ghosting.add_beside((&image, &settled), references, Some(mask)).map(|r| r.share));
    }

    // all of it into the record
    let (errors, plain_image) = (mean(&errors), PlainImage { paths: time.paths(1), errors: mean(&plains) });
    cost.add_to(&mut session.record, [scene, part, candidate.name]);
    let mut row = session.record.row(scene, part, candidate.name);
    row.errors(&errors);
    row.exact(quantity::UNFILTERED, ImageErrors::mean(&unfiltered).map(|e| e.rmse));
    plain_image.add_to(&mut row, &errors);
    denoised.iter().for_each(|image| image.add_to(&mut row));
    row.repeated(quantity::UPDATE_TIME, Percentiles::from_values(&updates));
    if motion.moves_objects() {
        let left = shares.iter().sum::<f64>() / shares.len() as f64;
        row.exact(plain("left", ""), left).exact(plain("ghosting", ""), ghosting.energy());
    }
    let ratio = errors.over(&plain_image.errors);
    session.record.scene(scene).remarks.extend(ratio.map(|ratio| plain_remark(candidate.name, part, ratio)));
    Ok(())
}
