//! One number varied, everything else as it is.

use super::args::{FramesSession, Series};
use super::candidates::Candidate;
use super::frame_log::first_timed;
use super::larsen::{OURS, THEIRS};
use super::scenes;
use super::stage::SceneStage;
use super::still::{self, StillRun, points};
use crate::accel::flatten::FlatScene;
use crate::bench::record::{FRAME, SIZE, plain, quantity};
use crate::error::Result;
use crate::realtime::Settings;
use crate::sampling::Sequence;

/// Preset whose resolution is varied.
const FAST: &str = "fast";
const TRIANGLES: [&str; 6] = [
    "builtin:terrain:10000",
    "builtin:terrain:100000",
    "builtin:terrain:1000000",
    "builtin:terrain:2450000",
    "builtin:terrain:10000000",
    "builtin:instances:25000000",
];
const QUICK_TRIANGLES: [&str; 3] = ["builtin:terrain:1000", "builtin:terrain:10000", "builtin:instances:25000"];
const RAYS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
const QUICK_RAYS: [u32; 2] = [1, 4];
const SIZES: [[u32; 2]; 5] = [[320, 180], [640, 360], [960, 540], [1280, 720], [1920, 1080]];
const QUICK_SIZES: [[u32; 2]; 2] = [[80, 45], [160, 90]];
/// Scenes over which sequences are compared, of those that are measured.
const SAMPLED: usize = 4;

/// Measures a whole series. `scenes`: those on the command line, or the default ones.
pub fn measure(session: &mut FramesSession, series: Series, scenes: &[String]) -> Result<()> {
    let args = session.args;
    let sources: Vec<String> = match series {
        Series::Triangles if !args.scenes.is_empty() => scenes.to_vec(),
        Series::Triangles if args.common.quick => QUICK_TRIANGLES.map(str::to_owned).to_vec(),
        Series::Triangles => TRIANGLES.map(str::to_owned).to_vec(),
        Series::Sampling => scenes.iter().take(SAMPLED).cloned().collect(),
        Series::Rays | Series::Resolution => scenes.iter().take(1).cloned().collect(),
    };

    // Measures the first view of each scene, at one or all sizes.
    for (k, source) in sources.iter().enumerate() {
        if !session.has_time_for(source.clone()) {
            continue;
        }
        session.advance(k as f64 / sources.len() as f64);
        session.phase(format!("{source}: loading"));
        let loaded = scenes::load(source, args)?;
        let flat =
            FlatScene::with_motion_and_blend(&loaded.scene, Default::default(), args.integrator().get().blend())?;
        let Some(view) = loaded.views.first() else { continue };
        let sizes: &[[u32; 2]] = if args.common.quick { &QUICK_SIZES } else { &SIZES };
        let sizes = if series == Series::Resolution { sizes.to_vec() } else { vec![args.size()] };
        for (k, size) in sizes.into_iter().enumerate() {
            let name = format!("{source}: {}x{}", size[0], size[1]);
            if k > 0 && session.is_over() {
                session.leave_out(&name);
                continue;
            }
            session.phase(name);
            let mut stage = SceneStage::new(session, (&loaded, view), &flat, size, None, None)?;
            match series {
                Series::Triangles => {
                    measure_size(session, &view.name, &stage, (SIZE, loaded.primitives() as f64), &[OURS, THEIRS])?;
                }
                Series::Resolution => {
                    let pixels = f64::from(size[0]) * f64::from(size[1]);
                    measure_size(session, &view.name, &stage, ("pixels", pixels), &[FAST])?;
                }
                Series::Rays => measure_rays(session, &view.name, &mut stage)?,
                Series::Sampling => measure_sequences(session, &view.name, &mut stage)?,
            }
        }
        session.show_scene(&view.name)?;
    }
    Ok(())
}

/// Time of presets at a place along an axis.
fn measure_size(
    session: &mut FramesSession,
    scene: &str,
    stage: &SceneStage,
    (axis, value): (&str, f64),
    presets: &[&str],
) -> Result<()> {
    let frames = session.args.frames();
    let is_there = |c: &Candidate| session.args.is_occlusion() || !c.is_for_occlusion_alone();
    for candidate in presets.iter().filter_map(|name| Candidate::find(name)).filter(|c| is_there(c)) {
        let log = stage.jittered_frames(candidate, stage.settings(candidate)?, frames)?.1;
        let cost = log.cost(first_timed(frames));
        let part = if axis == SIZE { "by triangles" } else { "by resolution" };
        let mut row = session.record.row(scene, part, candidate.name);
        row.at(axis, value).repeated(quantity::FRAME_TIME, cost.time()).exact(quantity::RAYS, cost.rays);
    }
    Ok(())
}

/// Time and error by the number of rays, or paths, per pixel.
fn measure_rays(session: &mut FramesSession, scene: &str, stage: &mut SceneStage) -> Result<()> {
    let numbers: &[u32] = if session.args.common.quick { &QUICK_RAYS } else { &RAYS };
    let frames = session.args.frames();
    let Some(candidate) = Candidate::find(OURS) else { return Ok(()) };
    let reference = stage.reference(&stage.still_camera(), session.args.reference_paths())?;
    for (k, &rays_per_pixel) in numbers.iter().enumerate() {
        if k > 0 && session.is_over() {
            session.leave_out(&format!("{scene}: {rays_per_pixel} rays per pixel"));
            continue;
        }
        session.phase(format!("{scene}: {rays_per_pixel} rays per pixel"));
        session.advance(k as f64 / numbers.len() as f64);
        let settings = Settings { rays_per_pixel, ..stage.settings(candidate)? };
        let run = still::run(stage, candidate, settings, &reference, frames, None)?;
        let cost = stage.jittered_frames(candidate, settings, frames)?.1.cost(first_timed(frames));
        let mut row = session.record.row(scene, "by rays", candidate.name);
        let mut at = row.at("rays per pixel", f64::from(rays_per_pixel));
        at.repeated(quantity::FRAME_TIME, cost.time());
        at.exact(quantity::RMSE, run.errors.last().map(|e| e.rmse));
        at.exact(quantity::CORRECTED, run.errors.last().map(|e| e.corrected));
        at.exact(quantity::UNFILTERED, run.unfiltered.last().map(|e| e.corrected));
    }
    Ok(())
}

/// Error of every sequence of samples: by frames, and when the quickest of them is done.
fn measure_sequences(session: &mut FramesSession, scene: &str, stage: &mut SceneStage) -> Result<()> {
    let frames = session.args.frames();
    let Some(candidate) = Candidate::find(OURS) else { return Ok(()) };
    let reference = stage.reference(&stage.still_camera(), session.args.reference_paths())?;
    let mut runs: Vec<(Sequence, StillRun)> = Vec::new();
    for (k, sequence) in Sequence::ALL.into_iter().enumerate() {
        if k > 0 && session.is_late() {
            session.leave_out(&format!("{scene}: {}", sequence.name()));
            continue;
        }
        session.phase(format!("{scene}: {}", sequence.name()));
        session.advance(k as f64 / Sequence::ALL.len() as f64);
        let settings = Settings { sequence, ..stage.settings(candidate)? };
        runs.push((sequence, still::run(stage, candidate, settings, &reference, frames, None)?));
    }

    // as long as the quickest needs, each frame at its median price: single ones are too noisy
    let price = |run: &StillRun| run.log.cost(first_timed(frames)).ms();
    let done = runs.iter().map(|(_, run)| price(run)).fold(f64::INFINITY, f64::min) * f64::from(frames);
    for (sequence, run) in &runs {
        let mut row = session.record.row(scene, "by sequence", sequence.name());
        row.repeated(quantity::FRAME_TIME, run.log.cost(first_timed(frames)).time());
        let until = (done / price(run) * (1.0 + 1e-9)) as usize;
        let at_equal_time = until.min(run.rmse.len()).checked_sub(1).map(|k| run.rmse[k]);
        row.exact(plain("equal-time RMSE", ""), at_equal_time);
        for (k, frame) in points(frames).enumerate() {
            let mut at = row.at(FRAME, f64::from(frame));
            at.exact(quantity::RMSE.not_compared(), run.errors.get(k).map(|e| e.rmse));
            at.exact(quantity::CORRECTED, run.errors.get(k).map(|e| e.corrected));
            at.exact(quantity::UNFILTERED, run.unfiltered.get(k).map(|e| e.corrected));
        }
    }
    Ok(())
}
