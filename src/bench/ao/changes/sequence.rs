//! Something moves in every frame: errors, ghosts, and what keeping up costs.

use super::script::ChangeScript;
use super::stage::{ChangeStage, candidates, ghost, result_of, settled};
use crate::bench::ao::reference::AoReference;
use crate::bench::ao::session::AoSession;
use crate::bench::frame_log::{FrameLog, first_timed, measured};
use crate::bench::masks;
use crate::bench::record::ao::{ChangeRecord, ImageErrors};
use crate::error::Result;
use crate::measure::stats::Percentiles;
use crate::measure::temporal::Ghosting;

/// References of a frame and of the one before, and the pixels in which both show the same surface at rest.
struct Moment {
    frame: u32,
    reference: AoReference,
    before: AoReference,
    mask: Vec<f32>,
}

/// Plays it with every preset.
pub fn play(
    session: &mut AoSession,
    script: &mut ChangeScript,
    stage: &mut ChangeStage,
    record: &mut ChangeRecord,
) -> Result<()> {
    let frames = session.args.frames();
    session.phase(format!("{}: references", stage.name));
    let mut moments = Vec::new();
    for frame in measured(frames) {
        script.to(stage.tracer, frame.saturating_sub(1))?;
        let before = stage.reference()?;
        script.to(stage.tracer, frame)?;
        let reference = stage.reference()?;
        let mask = masks::unchanged(&reference.surfaces, &before.surfaces, script.reach);
        moments.push(Moment { frame, reference, before, mask });
    }
    let count = moments.len().max(1) as f64;
    record.frames = frames;
    record.pixels = moments.iter().map(|m| m.mask.iter().filter(|v| **v > 0.0).count() as u64).sum();
    record.reference_rmse = moments.iter().map(|m| m.reference.rmse).sum::<f64>() / count;
    for candidate in candidates(session) {
        if session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{}: {}", stage.name, candidate.name));
            continue;
        }
        session.phase(format!("{}: {}", stage.name, candidate.name));
        script.to(stage.tracer, 0)?;
        let mut realtime = stage.renderer().realtime(&candidate.settings(&stage.occlusion))?;
        let mut result = result_of(candidate, stage);
        let (mut log, mut updates) = (FrameLog::default(), Vec::new());
        let (mut images, mut errors): (Vec<Vec<f32>>, Vec<ImageErrors>) = (Vec::new(), Vec::new());
        for frame in 0..frames {
            let moved = if frame == 0 {
                Vec::new()
            } else {
                let update = script.to(stage.tracer, frame)?;
                updates.push(1e3 * (update.mesh_seconds + update.top_seconds));
                update.moved
            };
            let seconds = {
                log.frame(&mut realtime, stage.tracer, &stage.camera, &moved)?;
                log.seconds().last().copied().unwrap_or_default()
            };
            // so that structures are built anew where that pays
            stage.tracer.traced(seconds);
            let Some(m) = moments.iter().find(|m| m.frame == frame) else { continue };
            let image = realtime.result()?;
            errors.push(m.reference.errors_of(&image)?);
            images.push(image);
        }
        let mut ghosting = Ghosting::default();
        for (m, image) in moments.iter().zip(&images) {
            script.to(stage.tracer, m.frame)?;
            let settled = settled(&mut realtime, stage, frames)?;
            let left = ghost(&mut ghosting, (image, &settled), (&m.reference, &m.before), &m.mask);
            result.residuals.push(left.map_or(f64::NAN, |r| r.share));
        }
        result.ghosting = Some(ghosting.energy());
        result.errors = ImageErrors::mean(&errors);
        result.cost = Some(log.cost(first_timed(frames)));
        result.update_ms = Percentiles::from_values(&updates);
        record.results.push(result);
    }
    Ok(())
}
