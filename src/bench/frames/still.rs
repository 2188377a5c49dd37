//! A camera that stands still: time, errors as frames add up, flicker, and occlusion at rest.

use super::args::FramesSession;
use super::candidates::Candidate;
use super::frame_log::{FrameCost, FrameLog, first_timed};
use super::peers::{self, PeerImages};
use super::signal::EqualTime;
use super::stage::{PlainImage, SceneStage};
use crate::bench::record::{FRAME, plain, quantity};
use crate::error::Result;
use crate::measure::displayed::{Flicker, FlickerMeter, FrameReference, ImageErrors};
use crate::measure::plain_time::{PlainClock, is_plain_timed};
use crate::realtime::{Filter, FilterKind, Settings, Technique};

pub const PART: &str = "still";
/// Part of the record with frames that have all of their camera rays.
pub const WITH_CAMERA_RAYS: &str = "still, camera rays";
/// Frames after which Larsen's pipeline has settled: it forgets half in each.
const LARSEN_SETTLED: u32 = 16;
/// Frames that are timed with camera rays: a share of those without.
const JITTERED_SHARE: u32 = 2;
/// Frames at rest that are timed.
const AT_REST: usize = 8;
/// Frames that a history takes to fill, and some.
const PATIENCE: u32 = 8;

/// The results of a preset at the still camera.
pub struct StillResult {
    pub candidate: &'static Candidate,
    pub cost: FrameCost,
    /// A frame's with all of its camera rays; of ambient occlusion.
    pub camera_cost: FrameCost,
    /// Errors after all frames.
    pub settled: ImageErrors,
    /// The same before the filter; of ambient occlusion.
    pub unfiltered: Option<ImageErrors>,
    pub rmse: Vec<f64>,
    /// Occlusion rays traced until each frame is done.
    pub rays: Vec<u64>,
}

/// Frames of a camera that stands still.
pub struct StillRun {
    pub log: FrameLog,
    /// Differences of consecutive frames.
    flicker: FlickerMeter,
    /// Errors after 1, 2, 4, ... frames.
    pub errors: Vec<ImageErrors>,
    /// The same before the filter; of ambient occlusion.
    pub unfiltered: Vec<ImageErrors>,
    pub rmse: Vec<f64>,
    /// Rays traced until each frame is done.
    rays: Vec<u64>,
}

/// Measures a preset and the peers `beside` it: errors are means over runs with other samples, time
/// and flicker those of the first.
pub fn measure(
    session: &mut FramesSession,
    scene: &str,
    stage: &mut SceneStage,
    candidate: &'static Candidate,
    reference: &FrameReference,
    beside: &mut Vec<PeerImages>,
) -> Result<StillResult> {
    // frames of the preset, run by run
    let frames = session.args.frames();
    let settings = stage.settings(candidate)?;
    let (first_seed, runs) = (session.args.seed, session.args.runs);
    let seeds = || (0..runs).map(|k| first_seed.wrapping_add(k));
    let mut clock = PlainClock::default();
    let first = run(stage, candidate, settings, reference, frames, Some(&mut clock))?;
    let mut errors: Vec<Vec<ImageErrors>> = first.errors.iter().map(|e| vec![*e]).collect();
    for seed in seeds().skip(1) {
        let again = run(stage, candidate, Settings { seed, ..settings }, reference, frames, None)?;
        errors.iter_mut().zip(again.errors).for_each(|(of_frame, e)| of_frame.push(e));
    }
    let mean = |all: &[ImageErrors]| ImageErrors::mean(all).unwrap_or_default();
    let errors: Vec<ImageErrors> = errors.iter().map(|all| mean(all)).collect();

    // plain accumulation in the same time, of the same samples, as far as they go
    let camera = stage.still_camera();
    let time = EqualTime::new(clock.time(), first.log.typical(first_timed(frames)));
    let mut plains = Vec::new();
    for frame in points(frames) {
        let paths = time.paths(frame);
        let mut of_seeds = Vec::new();
        for seed in seeds() {
            of_seeds.push(stage.plain_image(&camera, paths, reference, seed)?.errors);
        }
        plains.push(PlainImage { paths, errors: mean(&of_seeds) });
    }
    let denoised = stage.denoised(&camera, (&time, frames, false), reference, first_seed)?;

    // what only ambient occlusion has
    let (mut camera_cost, mut unfiltered) = (FrameCost::default(), first.unfiltered.last().copied());
    if stage.channels() == 1 {
        let jittered = (frames / JITTERED_SHARE).max(2);
        camera_cost = stage.jittered_frames(candidate, settings, jittered)?.1.cost(first_timed(jittered));
        if settings.technique == Technique::Larsen {
            let filter = Filter { kind: FilterKind::None, ..settings.filter };
            let without = Settings { filter, ..settings };
            let mut realtime = stage.realtime_with(candidate, without)?;
            let images = stage.frames_afresh(&mut realtime, &camera, frames.min(LARSEN_SETTLED))?;
            unfiltered = images.last().map(|image| reference.errors_of(image)).transpose()?;
        }
    }

    // all of it into the record
    let cost = first.log.cost(first_timed(frames));
    let (settled, flicker) = (errors.last().copied().unwrap_or_default(), first.flicker.result());
    let record = &mut session.record;
    cost.add_to(record, [scene, PART, candidate.name]);
    if stage.channels() == 1 {
        camera_cost.add_to(record, [scene, WITH_CAMERA_RAYS, candidate.name]);
    }
    let mut row = record.row(scene, PART, candidate.name);
    row.errors(&settled);
    row.exact(quantity::UNFILTERED, unfiltered.map(|e| e.rmse));
    plains.iter().last().into_iter().for_each(|image| image.add_to(&mut row, &settled));
    row.exact(quantity::FLICKER, flicker.map(|f| f.rms)).exact(plain("worst flicker", ""), flicker.map(|f| f.greatest));
    denoised.iter().for_each(|image| image.add_to(&mut row));
    for (k, frame) in points(frames).enumerate() {
        let mut at = row.at(FRAME, f64::from(frame));
        at.exact(quantity::RMSE.not_compared(), errors.get(k).map(|e| e.rmse));
        at.exact(quantity::CORRECTED, errors.get(k).map(|e| e.corrected));
        at.exact(quantity::PLAIN_RMSE, plains.get(k).map(|p| p.errors.rmse));
        at.exact(plain("plain paths", ""), plains.get(k).map(|p| f64::from(p.paths)));
        at.exact(quantity::UNFILTERED, first.unfiltered.get(k).map(|e| e.rmse));
    }
    add_remarks(session, scene, candidate, plains.last().and_then(|p| settled.over(&p.errors)), flicker);

    // peers in the same time
    let ms: Vec<(u32, f64)> = points(frames).map(|frame| (frame, time.ms(frame))).collect();
    peers::render_beside(session, (scene, candidate.name), beside, &ms)?;
    let StillRun { rmse, rays, .. } = first;
    Ok(StillResult { candidate, cost, camera_cost, settled, unfiltered, rmse, rays })
}

/// Says whether a preset is worth its time, and whether it flickers.
fn add_remarks(
    session: &mut FramesSession,
    scene: &str,
    candidate: &Candidate,
    over_plain: Option<f64>,
    flicker: Option<Flicker>,
) {
    let remarks = &mut session.record.scene(scene).remarks;
    remarks.extend(over_plain.map(|ratio| plain_remark(candidate.name, PART, ratio)));
    remarks.extend(flicker.map(|f| {
        let limit = Flicker::LIMIT;
        let below =
            f.is_invisible().map_or_else(String::new, |yes| format!("; below 1/255 = {limit:.5}: {}", yes_or_no(yes)));
        format!("{}: flicker after {} frames {:.5} (worst {:.5}){below}", candidate.name, f.after, f.rms, f.greatest)
    }));
}

/// Says whether a preset is worth its time.
pub fn plain_remark(preset: &str, part: &str, ratio: f64) -> String {
    let less = yes_or_no(ratio < 1.0);
    format!("{preset}, {part}: {ratio:.2} of the error of plain accumulation at equal time; less: {less}")
}

/// In remarks.
pub fn yes_or_no(holds: bool) -> &'static str {
    if holds { "yes" } else { "NO" }
}

/// Frames after which errors are measured: 1, 2, 4, ... and all.
pub fn points(frames: u32) -> impl Iterator<Item = u32> {
    (1..=frames).filter(move |f| f.is_power_of_two() || *f == frames)
}

/// Frames of a still camera, from the first. `clock`: plain accumulation is timed beside them.
pub fn run(
    stage: &mut SceneStage,
    candidate: &Candidate,
    settings: Settings,
    reference: &FrameReference,
    frames: u32,
    mut clock: Option<&mut PlainClock>,
) -> Result<StillRun> {
    let camera = stage.still_camera();
    let mut realtime = stage.realtime_with(candidate, settings)?;
    if clock.is_some() {
        // a frame for nothing: the first takes longer than the same frame later
        realtime.frame(&stage.tracer, &camera, &[])?;
        realtime.rewind();
    }

    // Every frame costs time, and some are held against the reference.
    let mut run = StillRun {
        log: FrameLog::default(),
        flicker: FlickerMeter::new(frames),
        errors: Vec::new(),
        unfiltered: Vec::new(),
        rmse: Vec::new(),
        rays: Vec::new(),
    };
    for frame in 1..=frames {
        run.log.render_frame(&mut realtime, &stage.tracer, &camera, &[])?;
        let image = realtime.result()?;
        let displayed = stage.displayed(&image);
        run.rmse.push(reference.rmse_over(&displayed, reference.mask.as_deref())?);
        run.rays.push(run.log.rays());
        run.flicker.add(&displayed)?;
        if let Some(clock) = clock.as_deref_mut()
            && is_plain_timed(frame - 1, first_timed(frames), frames)
        {
            stage.time_plain(&camera, clock)?;
        }
        if points(frames).any(|f| f == frame) {
            run.errors.push(reference.errors_of(&image)?);
            if stage.channels() == 1 && settings.technique != Technique::Larsen {
                run.unfiltered.push(reference.errors_of(&realtime.unfiltered()?)?);
            }
        }
    }
    Ok(run)
}

/// A preset of ambient occlusion until nothing is traced any more, and the cost of frames then.
pub fn measure_rest(
    session: &mut FramesSession,
    scene: &str,
    stage: &SceneStage,
    candidate: &Candidate,
    reference: &FrameReference,
) -> Result<()> {
    let settings = Settings { rest: true, ..stage.settings(candidate)? };
    if settings.technique != Technique::Traced || settings.history == 1 {
        return Ok(());
    }
    let camera = stage.still_camera();
    let mut realtime = stage.realtime_with(candidate, settings)?;
    let most = settings.history.min(Settings::MAX_SAMPLES).saturating_mul(settings.resolution.period()) + PATIENCE;
    let mut log = FrameLog::default();
    let mut frames = None;
    for frame in 0..most {
        if log.render_frame(&mut realtime, &stage.tracer, &camera, &[])?.occlusion_rays == 0 {
            frames = Some(frame);
            break;
        }
    }
    let first = log.count();
    for _ in 0..AT_REST {
        log.render_frame(&mut realtime, &stage.tracer, &camera, &[])?;
    }
    log.cost(first).add_to(&mut session.record, [scene, "rest", candidate.name]);
    let mut row = session.record.row(scene, "rest", candidate.name);
    row.exact(plain("frames to rest", ""), frames.map(f64::from));
    row.errors(&reference.errors_of(&realtime.result()?)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_say_what_falls_short() {
        assert!(
            plain_remark("fast", "still", 2.0)
                .ends_with("fast, still: 2.00 of the error of plain accumulation at equal time; less: NO")
        );
        assert!(plain_remark("fast", "orbit", 0.5).ends_with("yes"));
        assert_eq!(points(12).collect::<Vec<_>>(), [1, 2, 4, 8, 12]);
    }
}
