//! Pixels of ambient occlusion that keep what was right before a change, by more than chance explains.

use super::stage::Stage;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::Realtime;

/// Frames after which no pixel may keep what is wrong.
pub const AFTER: u32 = 8;
/// Runs that never saw the old, which say how much chance does to a pixel.
const FRESH_RUNS: usize = 8;
/// Standard deviations that chance does not explain.
const SIGMAS: f64 = 5.0;
/// Half side of the squares over which these deviations are pooled, pixels.
const POOL: i64 = 2;
/// What an 8-bit image does not show counts as noise.
const HALF_STEP: f64 = 1.0 / 510.0;

/// Counts pixels of an image, [`AFTER`] frames after a change, that keep the old; and as many of a run that started after the change: what chance makes.
pub fn count(
    stage: &Stage,
    realtime: &mut Realtime,
    camera: &CameraRecord,
    (image, mask): (&[f32], &[f32]),
    [reference, old]: [&[f32]; 2],
) -> Result<[u64; 2]> {
    // the sampler goes on: each run is another
    let mut fresh = || Ok::<_, crate::Error>(stage.frames_afresh(realtime, camera, AFTER)?.pop().unwrap_or_default());
    let (mut sums, mut squares) = (vec![0f64; mask.len()], vec![0f64; mask.len()]);
    for _ in 0..FRESH_RUNS {
        for ((sum, square), v) in sums.iter_mut().zip(&mut squares).zip(fresh()?) {
            *sum += f64::from(v);
            *square += f64::from(v).powi(2);
        }
    }
    let chance = fresh()?;
    let runs = FRESH_RUNS as f64;
    let scatter: Vec<f64> = sums.iter().zip(&squares).map(|(s, q)| ((q - s * s / runs) / (runs - 1.0)).max(0.0)).collect();
    let variances = pool(&scatter, mask, stage.size);

    let is_stale = |image: &[f32], k: usize| {
        let towards = f64::from(old[k] - reference[k]);
        let off = (f64::from(image[k]) - sums[k] / runs) * towards.signum();
        // of one image and of a mean of some
        let variance = variances[k] * (1.0 + 1.0 / runs) + HALF_STEP.powi(2);
        mask[k] > 0.0 && towards != 0.0 && off > SIGMAS * variance.sqrt()
    };
    Ok([image, &chance].map(|image| (0..image.len()).filter(|k| is_stale(image, *k)).count() as u64))
}

/// Mean variance of each pixel, over squares of pixels around it that count.
fn pool(variances: &[f64], mask: &[f32], size: [u32; 2]) -> Vec<f64> {
    let [width, height] = size.map(i64::from);
    let neighbourhood = |k: usize| {
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
    (0..variances.len()).map(neighbourhood).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_pooled_over_what_counts() {
        let mask = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        let variances = [2.0, 4.0, 100.0, 6.0, 0.0, 0.0];
        assert_eq!(pool(&variances, &mask, [6, 1])[0], 3.0);
        assert_eq!(pool(&variances, &mask, [1, 6])[5], 2.0);
    }
}
