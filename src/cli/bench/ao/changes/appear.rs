//! Something appears under a camera that stands still: how long the image without it stays.

use super::script::Script;
use super::{Stage, candidates, ghost, lag, masks, result_of};
use crate::cli::bench::ao::Bench;
use crate::cli::bench::ao::laps::Laps;
use crate::cli::bench::ao::reference::Truth;
use crate::error::Result;
use crate::measure::ao_benchmark::{ChangeRecord, ChangeResult};
use crate::measure::stats::Spread;
use crate::measure::temporal::Ghosting;
use crate::render::realtime::Realtime;

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
pub fn play(bench: &mut Bench, script: &mut Script, stage: &mut Stage, record: &mut ChangeRecord) -> Result<()> {
    bench.phase(format!("{}: references", stage.name));
    script.to(stage.tracer, 0)?;
    let wrong = stage.truth()?;
    script.to(stage.tracer, 1)?;
    let truth = stage.truth()?;
    let mask = masks::unchanged(&truth.surfaces, &wrong.surfaces, script.reach);
    let frames = (bench.args.frames() / 2).max(FRAMES);
    record.frames = frames;
    record.pixels = mask.iter().filter(|m| **m > 0.0).count() as u64;
    record.reference_rmse = truth.rmse;
    for candidate in candidates(bench) {
        if bench.is_late() && !record.results.is_empty() {
            bench.leave_out(&format!("{}: {}", stage.name, candidate.name));
            continue;
        }
        bench.phase(format!("{}: {}", stage.name, candidate.name));
        script.to(stage.tracer, 0)?;
        let mut realtime = stage.shot().realtime(&candidate.settings(&stage.occlusion))?;
        let mut laps = Laps::default();
        for _ in 0..bench.args.frames() {
            laps.frame(&mut realtime, stage.tracer, &stage.camera, &[])?;
        }
        let mut result = result_of(candidate, stage);
        let update = script.to(stage.tracer, 1)?;
        result.update_ms = Spread::of(&[1e3 * (update.mesh_seconds + update.top_seconds)]);
        let (mut residuals, mut ghosting, mut after) = (Vec::new(), Ghosting::default(), Vec::new());
        for frame in 0..frames as usize {
            let moved = if frame == 0 { update.moved.as_slice() } else { &[] };
            laps.frame(&mut realtime, stage.tracer, &stage.camera, moved)?;
            let image = realtime.result()?;
            residuals.push(ghost(&mut ghosting, &image, &truth, &wrong, &mask).map_or(f64::NAN, |r| r.share));
            result.rmse.push(truth.rmse_over(&image, &mask)?);
            if frame + 1 == STALE_AFTER {
                after = image;
            }
        }
        result.ghosting = Some(ghosting.energy());
        lag(&mut result, residuals);
        stale(&mut result, &mut realtime, stage, (&after, &mask), (&truth, &wrong))?;
        record.results.push(result);
    }
    Ok(())
}

/// Counts pixels that keep the old, beside runs that start after the change.
fn stale(
    result: &mut ChangeResult,
    realtime: &mut Realtime,
    stage: &Stage,
    (image, mask): (&[f32], &[f32]),
    (truth, wrong): (&Truth, &Truth),
) -> Result<()> {
    let mut laps = Laps::default();
    let mut fresh = || -> Result<Vec<f32>> {
        // what it draws goes on: each run is another
        realtime.reset();
        for _ in 0..STALE_AFTER {
            laps.frame(realtime, stage.tracer, &stage.camera, &[])?;
        }
        realtime.result()
    };
    let mut squares = vec![0f64; image.len()];
    for _ in 0..FRESH_RUNS {
        let errors = fresh()?;
        squares.iter_mut().zip(errors.iter().zip(&truth.image)).for_each(|(s, (v, t))| *s += f64::from(v - t).powi(2));
    }
    let chance = fresh()?;
    let noise = truth.rmse.powi(2) + HALF_STEP.powi(2);
    let variances = pooled(&squares, mask, stage.size, FRESH_RUNS as f64);
    let count = |image: &[f32]| {
        let is_stale = |k: &usize| {
            let k = *k;
            let old = f64::from(wrong.image[k] - truth.image[k]);
            let off = f64::from(image[k] - truth.image[k]) * old.signum();
            mask[k] > 0.0 && old != 0.0 && off > SIGMAS * (variances[k] + noise).sqrt()
        };
        (0..image.len()).filter(is_stale).count() as u64
    };
    result.stale_pixels = Some(count(image));
    result.stale_pixels_by_chance = Some(count(&chance));
    Ok(())
}

/// Mean square of each pixel, over squares of pixels around it that count.
fn pooled(squares: &[f64], mask: &[f32], size: [u32; 2], runs: f64) -> Vec<f64> {
    let [width, height] = size.map(i64::from);
    let around = |k: usize| {
        let (x, y) = (k as i64 % width, k as i64 / width);
        let (mut sum, mut n) = (0.0, 0.0);
        for v in (y - POOL).max(0)..=(y + POOL).min(height - 1) {
            for u in (x - POOL).max(0)..=(x + POOL).min(width - 1) {
                let at = (v * width + u) as usize;
                if mask[at] > 0.0 {
                    sum += squares[at];
                    n += runs;
                }
            }
        }
        if n > 0.0 { sum / n } else { 0.0 }
    };
    (0..squares.len()).map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_pooled_over_what_counts() {
        let mask = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        let squares = [2.0, 4.0, 100.0, 6.0, 0.0, 0.0];
        assert_eq!(pooled(&squares, &mask, [6, 1], 2.0)[0], 1.5);
    }
}
