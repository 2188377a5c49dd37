//! Something moves in every frame: the camera, the sun, or objects.

use super::FramesSession;
use super::displayed::FrameReference;
use super::signal::{EqualTime, PlainClock};
use super::stage::{Motion, PLAIN_SEED, Stage, is_plain_timed};
use crate::bench::frame_log::{FrameLog, first_timed, measured};
use crate::bench::record::frames::{DenoisedImage, FrameErrors, MotionRecord, MovingFrames, PlainImage};
use crate::error::Result;
use crate::realtime::Preset;

/// Measures all presets.
///
/// # Errors
/// Those of the device; Ctrl-C.
pub fn measure(session: &mut FramesSession, name: &str, stage: &mut Stage, mut motion: Motion) -> Result<MotionRecord> {
    let name = format!("{name}, {}", motion.name());
    session.phase(format!("{name}: references"));
    let mut references = Vec::new();
    for frame in measured(session.args.frames()) {
        let camera = stage.go(&mut motion, frame)?.camera;
        references.push((frame, stage.reference(&camera, session.args.moving_reference_paths())?));
    }
    let count = references.len().max(1) as f64;
    let mut record = MotionRecord {
        motion: motion.name().to_owned(),
        frames: references.iter().map(|r| r.0).collect(),
        reference_rmse: references.iter().map(|r| r.1.rmse).sum::<f64>() / count,
        results: Vec::new(),
    };
    for preset in session.args.presets() {
        if session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{name}: {preset}"));
            continue;
        }
        session.phase(format!("{name}: {preset}"));
        record.results.push(one(session, stage, &mut motion, preset, &references)?);
    }
    // what comes after begins where everything was
    stage.go(&mut motion, 0)?;
    stage.rest()?;
    Ok(record)
}

fn one(
    session: &FramesSession,
    stage: &mut Stage,
    motion: &mut Motion,
    preset: Preset,
    references: &[(u32, FrameReference)],
) -> Result<MovingFrames> {
    let frames = session.args.frames();
    let mut realtime = stage.realtime(preset)?;
    let (mut log, mut errors) = (FrameLog::default(), Vec::new());
    let mut clock = PlainClock::default();
    for frame in 0..frames {
        let inputs = stage.go(motion, frame)?;
        inputs.light(&mut realtime, &stage.tracer)?;
        // what the scene was before the first frame is nobody's history
        let moved = if frame == 0 { &[][..] } else { &inputs.moved };
        log.frame(&mut realtime, &stage.tracer, &inputs.camera, moved)?;
        // so that structures are built anew where that pays
        stage.tracer.traced(log.seconds().last().copied().unwrap_or_default());
        if is_plain_timed(frame, first_timed(frames), frames) {
            stage.time_plain(&inputs.camera, &mut clock)?;
        }
        if let Some((_, reference)) = references.iter().find(|r| r.0 == frame) {
            errors.push(reference.errors_of(&realtime.result()?)?);
        }
    }
    let cost = log.cost(first_timed(frames));
    // the last one: the first has other samples
    let typical = log.typical(first_timed(frames)).pop();
    let time = EqualTime::new(clock.time(), typical.into_iter().collect());
    let (mut plain, mut denoised) = (Vec::new(), Vec::new());
    for (frame, reference) in references {
        let camera = stage.go(motion, *frame)?.camera;
        plain.push(stage.plain_image(&camera, time.paths(1), reference, PLAIN_SEED + frame)?);
        denoised.extend(stage.denoised(&camera, (&time, 1, true), reference, PLAIN_SEED + frame)?);
    }
    let mean = |of: Vec<FrameErrors>| FrameErrors::mean(&of).unwrap_or_default();
    let denoised = denoised.first().map(|first: &DenoisedImage| DenoisedImage {
        errors: mean(denoised.iter().map(|d| d.errors).collect()),
        ms: denoised.iter().map(|d| d.ms).sum::<f64>() / denoised.len() as f64,
        paths: first.paths,
    });
    Ok(MovingFrames {
        preset: preset.to_string(),
        cost,
        errors: mean(errors),
        plain: PlainImage { paths: time.paths(1), errors: mean(plain.iter().map(|p| p.errors).collect()) },
        denoised,
    })
}
