//! The preset `balanced` beside the pipeline of Larsen (2019), also in equal time.

use super::candidates::Candidate;
use super::frame_log::{FrameLog, first_timed};
use super::stage::SceneStage;
use super::still::{StillResult, yes_or_no};
use crate::bench::record::{Record, plain, quantity};
use crate::error::Result;
use crate::measure::displayed::FrameReference;
use crate::realtime::Settings;
use crate::report::thousands;

/// Preset that is compared.
pub const OURS: &str = "balanced";
/// Preset it is compared with.
pub const THEIRS: &str = "larsen";
/// Greatest share of their rays that is aimed at.
const RAYS_AIM: f64 = 0.1;
/// Greatest share of their error at equal time.
const EQUAL_TIME_AIM: f64 = 1.0 / 3.0;
/// Frames that are timed while the number of rays is looked for.
const PROBE_FRAMES: u32 = 8;
/// Rays per pixel at most.
const MAX_RAYS: u32 = 256;
/// Times that the number is corrected by what the whole run took.
const CORRECTIONS: u32 = 3;

/// Remarks on both at still cameras; none where one of them was not measured.
pub fn remarks(results: &[StillResult]) -> Vec<String> {
    let mut lines = Vec::new();
    let raises = |r: &&StillResult| r.unfiltered.is_some_and(|u| r.settled.rmse > u.rmse);
    let find = |name: &str| results.iter().find(|r| r.candidate.name == name);
    if let (Some(ours), Some(theirs)) = (find(OURS), find(THEIRS)) {
        // rays of a frame, with those of the camera and while something moves, and error
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { f64::NAN };
        let rays = ratio(ours.cost.rays, theirs.cost.rays);
        let with_camera = ratio(ours.cost.all_rays(), theirs.cost.all_rays());
        let moving = ratio(ours.camera_cost.all_rays(), theirs.camera_cost.all_rays());
        let rmse = ratio(ours.settled.corrected, theirs.settled.corrected);
        let holds = yes_or_no(rays <= RAYS_AIM && rmse <= 1.0);
        lines.push(format!(
            "balanced over larsen: {rays:.3} of the rays ({with_camera:.3} with camera rays, {moving:.3} while moving), {rmse:.3} of the settled RMSE; a tenth of the rays, no more error: {holds}"
        ));

        // when ours is first as good as theirs ever is
        let reached = ours.rmse.iter().position(|e| *e <= theirs.settled.rmse);
        lines.push(match reached.and_then(|k| Some((k + 1, *ours.rays.get(k)?))) {
            Some((frame, rays)) => {
                let share = ratio(rays as f64, theirs.cost.rays);
                let rays = thousands(rays);
                format!("balanced reaches larsen's settled RMSE in frame {frame}, after {rays} rays: {share:.3} of what one frame of larsen's traces")
            }
            None => "balanced does not reach larsen's settled RMSE".to_owned(),
        });
    }
    let raised: Vec<&str> = results.iter().filter(raises).map(|r| r.candidate.name).collect();
    lines
        .extend((!raised.is_empty()).then(|| format!("the filter raises the settled error of: {}", raised.join(", "))));
    lines
}

/// Adds the error of our frames with the most rays per pixel that take no longer than one of
/// theirs, by medians; nothing where one was not measured or a single ray takes longer.
pub fn measure_equal_time(
    record: &mut Record,
    scene: &str,
    stage: &SceneStage,
    results: &[StillResult],
    reference: &FrameReference,
    frames: u32,
) -> Result<()> {
    let find = |name: &str| results.iter().find(|r| r.candidate.name == name);
    let (Some(ours), Some(theirs)) = (find(OURS), find(THEIRS)) else { return Ok(()) };
    let their_ms = theirs.camera_cost.ms();
    if ours.camera_cost.ms() > their_ms {
        return Ok(());
    }

    // doubling, then halving the interval
    let candidate: &Candidate = ours.candidate;
    let base = stage.settings(candidate)?;
    let settings = |rays_per_pixel| Settings { rays_per_pixel, ..base };
    let ms = |log: &FrameLog, frames: u32| log.cost(first_timed(frames)).ms();
    let fits = |rays: u32| -> Result<bool> {
        Ok(ms(&stage.jittered_frames(candidate, settings(rays), PROBE_FRAMES)?.1, PROBE_FRAMES) <= their_ms)
    };
    let (mut fit, mut beyond) = (1, 2);
    while beyond <= MAX_RAYS && fits(beyond)? {
        (fit, beyond) = (beyond, 2 * beyond);
    }
    while beyond - fit > 1 && fit < MAX_RAYS {
        let middle = fit + (beyond - fit) / 2;
        if fits(middle)? {
            fit = middle;
        } else {
            beyond = middle;
        }
    }

    // a whole run, with fewer rays as long as it takes longer
    for _ in 0..CORRECTIONS {
        let (image, log) = stage.jittered_frames(candidate, settings(fit), frames)?;
        let ms = ms(&log, frames);
        if ms <= their_ms {
            let error = reference.errors_of(&image)?.corrected;
            let ratio = error / theirs.settled.corrected;
            let mut row = record.row(scene, "equal time", candidate.name);
            row.exact(plain("rays per pixel", ""), f64::from(fit)).exact(quantity::FRAME_TIME.not_compared(), ms);
            row.exact(quantity::CORRECTED, error).exact(plain("over larsen's", ""), ratio);
            let holds = yes_or_no(ratio <= EQUAL_TIME_AIM);
            record.scene(scene).remarks.push(format!(
                "equal time: balanced with {fit} rays per pixel takes {ms:.2} ms to larsen's {their_ms:.2}, and {ratio:.3} of its settled RMSE; a third or less: {holds}"
            ));
            return Ok(());
        }
        if fit == 1 {
            return Ok(());
        }
        fit = ((f64::from(fit) * their_ms / ms) as u32).clamp(1, fit - 1);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::frame_log::FrameCost;
    use super::*;
    use crate::measure::displayed::ImageErrors;

    fn result(name: &str, rays: f64, camera_rays: f64, rmse: &[f64], unfiltered: f64) -> StillResult {
        let cost = |camera_rays| FrameCost { rays, camera_rays, ..FrameCost::default() };
        let errors = |rmse| ImageErrors { rmse, corrected: rmse, ..ImageErrors::default() };
        StillResult {
            candidate: Candidate::find(name).unwrap(),
            cost: cost(camera_rays),
            camera_cost: cost(100.0),
            settled: errors(rmse[rmse.len() - 1]),
            unfiltered: Some(errors(unfiltered)),
            rmse: rmse.to_vec(),
            rays: (1..=rmse.len() as u64).map(|k| k * rays as u64).collect(),
        }
    }

    #[test]
    fn ratios_to_larsens_pipeline() {
        let ours = result("balanced", 100.0, 0.0, &[0.3, 0.05, 0.02, 0.01], 0.02);
        let theirs = result("larsen", 1600.0, 100.0, &[0.05, 0.04], 0.03);
        let lines = remarks(&[ours, theirs]);
        assert!(
            lines[0].contains("0.062 of the rays (0.059 with camera rays, 0.118 while moving), 0.250 of"),
            "{lines:?}"
        );
        assert!(lines[0].ends_with("yes") && lines[1].contains("in frame 3, after 300 rays: 0.188 of"), "{lines:?}");
        // theirs is worse with its box than without
        assert_eq!(lines[2], "the filter raises the settled error of: larsen");
        assert!(remarks(&[result("balanced", 1.0, 0.0, &[0.1], 0.2)]).is_empty());
    }
}
