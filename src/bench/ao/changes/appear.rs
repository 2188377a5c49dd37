//! Something appears under a camera that stands still: how long the image without it stays.

use super::script::ChangeScript;
use super::stage::{ChangeStage, afresh, candidates, ghost, lag, result_of, settled};
use crate::bench::ao::reference::AoReference;
use crate::bench::ao::session::AoSession;
use crate::bench::frame_log::FrameLog;
use crate::bench::masks;
use crate::bench::record::ao::{ChangeRecord, ChangeResult};
use crate::error::Result;
use crate::measure::stats::Percentiles;
use crate::measure::temporal::Ghosting;
use crate::realtime::Realtime;

/// Frames that are looked at, at least.
const FRAMES: u32 = 16;
/// Frames after which no pixel may keep what is wrong.
const STALE_AFTER: usize = 8;
/// Runs that never saw the old, which say how much chance does to a pixel.
const FRESH_RUNS: usize = 8;
/// Standard deviations that chance does not explain.
const SIGMAS: f64 = 5.0;
/// Half side of the squares over which these deviations are pooled, pixels.
const POOL: i64 = 2;
/// What an 8-bit image does not show counts as noise.
const HALF_STEP: f64 = 1.0 / 510.0;

/// Plays it with every preset.
pub fn play(
    session: &mut AoSession,
    script: &mut ChangeScript,
    stage: &mut ChangeStage,
    record: &mut ChangeRecord,
) -> Result<()> {
    session.phase(format!("{}: references", stage.name));
    script.to(stage.tracer, 0)?;
    let wrong = stage.reference()?;
    script.to(stage.tracer, 1)?;
    let reference = stage.reference()?;
    let mask = masks::unchanged(&reference.surfaces, &wrong.surfaces, script.reach);
    let frames = (session.args.frames() / 2).max(FRAMES);
    record.frames = frames;
    record.pixels = mask.iter().filter(|m| **m > 0.0).count() as u64;
    record.reference_rmse = reference.rmse;
    for candidate in candidates(session) {
        if session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{}: {}", stage.name, candidate.name));
            continue;
        }
        session.phase(format!("{}: {}", stage.name, candidate.name));
        script.to(stage.tracer, 0)?;
        let mut realtime = stage.renderer().realtime(&candidate.settings(&stage.occlusion))?;
        let mut log = FrameLog::default();
        for _ in 0..session.args.frames() {
            log.frame(&mut realtime, stage.tracer, &stage.camera, &[])?;
        }
        let mut result = result_of(candidate, stage);
        let update = script.to(stage.tracer, 1)?;
        result.update_ms = Percentiles::from_values(&[1e3 * (update.mesh_seconds + update.top_seconds)]);
        let old = realtime.result()?;
        let mut images = Vec::new();
        for frame in 0..frames {
            let moved = if frame == 0 { update.moved.as_slice() } else { &[] };
            log.frame(&mut realtime, stage.tracer, &stage.camera, moved)?;
            let image = realtime.result()?;
            result.rmse.push(reference.rmse_over(&image, &mask)?);
            images.push(image);
        }
        let fresh = afresh(&mut realtime, stage, session.args.frames().max(frames))?;
        let Some(new) = fresh.last() else { continue };
        // what it showed before is all of it, also where that is not what was right
        let share = |image: &[f32], beside: &[f32], ghosting: &mut Ghosting| {
            ghost(ghosting, (image, beside), (&reference, &wrong), &mask).map_or(f64::NAN, |r| r.share)
        };
        let all = share(&old, new, &mut Ghosting::default());
        let mut ghosting = Ghosting::default();
        let residuals = images.iter().map(|image| share(image, new, &mut ghosting) / all).collect();
        let of_that_age = |(image, fresh): (&Vec<f32>, &Vec<f32>)| share(image, fresh, &mut Ghosting::default()) / all;
        let memory = images.iter().zip(&fresh).map(of_that_age).collect();
        result.ghosting = Some(ghosting.energy());
        lag(&mut result, residuals, memory);
        let after = &images[STALE_AFTER - 1];
        stale(&mut result, &mut realtime, stage, (after, &mask), (&reference, &wrong))?;
        record.results.push(result);
    }
    Ok(())
}

/// Counts pixels that keep the old, beside runs that start after the change.
fn stale(
    result: &mut ChangeResult,
    realtime: &mut Realtime,
    stage: &ChangeStage,
    (image, mask): (&[f32], &[f32]),
    (reference, wrong): (&AoReference, &AoReference),
) -> Result<()> {
    // what it draws goes on: each run is another
    let mut fresh = || settled(realtime, stage, STALE_AFTER as u32);
    let (mut sums, mut squares) = (vec![0f64; image.len()], vec![0f64; image.len()]);
    for _ in 0..FRESH_RUNS {
        for ((sum, square), v) in sums.iter_mut().zip(&mut squares).zip(fresh()?) {
            *sum += f64::from(v);
            *square += f64::from(v).powi(2);
        }
    }
    let chance = fresh()?;
    let runs = FRESH_RUNS as f64;
    let scatter: Vec<f64> = sums.iter().zip(&squares).map(|(s, q)| ((q - s * s / runs) / (runs - 1.0)).max(0.0)).collect();
    let variances = pooled(&scatter, mask, stage.size);
    let count = |image: &[f32]| {
        let is_stale = |k: &usize| {
            let k = *k;
            let old = f64::from(wrong.image[k] - reference.image[k]);
            let off = (f64::from(image[k]) - sums[k] / runs) * old.signum();
            // of one image and of a mean of some
            let variance = variances[k] * (1.0 + 1.0 / runs) + HALF_STEP.powi(2);
            mask[k] > 0.0 && old != 0.0 && off > SIGMAS * variance.sqrt()
        };
        (0..image.len()).filter(is_stale).count() as u64
    };
    result.stale_pixels = Some(count(image));
    result.stale_pixels_by_chance = Some(count(&chance));
    Ok(())
}

/// Mean variance of each pixel, over squares of pixels around it that count.
fn pooled(variances: &[f64], mask: &[f32], size: [u32; 2]) -> Vec<f64> {
    let [width, height] = size.map(i64::from);
    let around = |k: usize| {
        let (x, y) = (k as i64 % width, k as i64 / width);
        let (mut sum, mut n) = (0.0, 0.0);
        for v in (y - POOL).max(0)..=(y + POOL).min(height - 1) {
            for u in (x - POOL).max(0)..=(x + POOL).min(width - 1) {
                let at = (v * width + u) as usize;
                if mask[at] > 0.0 {
                    sum += variances[at];
                    n += 1.0;
                }
            }
        }
        if n > 0.0 { sum / n } else { 0.0 }
    };
    (0..variances.len()).map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_pooled_over_what_counts() {
        let mask = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        let variances = [2.0, 4.0, 100.0, 6.0, 0.0, 0.0];
        assert_eq!(pooled(&variances, &mask, [6, 1])[0], 3.0);
        assert_eq!(pooled(&variances, &mask, [1, 6])[5], 2.0);
    }
}
