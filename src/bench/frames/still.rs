//! A camera that stands still: time of a frame, errors as frames add up, flicker.

use super::FramesSession;
use super::displayed::{Displayed, FlickerMeter, FrameReference};
use super::peers::{self, PeerImages};
use super::signal::{EqualTime, PlainClock};
use super::stage::{Stage, is_plain_timed};
use crate::bench::frame_log::{FrameLog, first_timed};
use crate::bench::record::frames::{FrameErrors, FramePoint, PlainImage, StillFrames};
use crate::error::Result;
use crate::realtime::Preset;

/// Measures a preset, and the peers `beside` it: errors are means over runs that differ in their samples alone. Time and flicker are those of the first.
///
/// # Errors
/// Those of the device; Ctrl-C.
pub fn measure(
    session: &mut FramesSession,
    stage: &mut Stage,
    preset: Preset,
    reference: &FrameReference,
    beside: &mut Vec<PeerImages>,
) -> Result<StillFrames> {
    let frames = session.args.frames();
    let camera = stage.still_camera();
    let (first_seed, runs) = (session.args.seed, session.args.runs);
    let seeds = || (0..runs).map(|k| first_seed.wrapping_add(k));
    let mut clock = PlainClock::default();
    let first = run(stage, preset, reference, first_seed, frames, Some(&mut clock))?;
    let mut errors: Vec<Vec<FrameErrors>> = first.errors.iter().map(|e| vec![*e]).collect();
    for seed in seeds().skip(1) {
        for (of_frame, e) in errors.iter_mut().zip(run(stage, preset, reference, seed, frames, None)?.errors) {
            of_frame.push(e);
        }
    }
    let time = EqualTime::new(clock.time(), first.log.typical(first_timed(frames)));
    let mut curve = Vec::new();
    for (frame, of_frame) in points(frames).zip(&errors) {
        let paths = time.paths(frame);
        let mut plain = Vec::new();
        // the same samples, as far as they go
        for seed in seeds() {
            plain.push(stage.plain_image(&camera, paths, reference, seed)?.errors);
        }
        let mean = |of: &[FrameErrors]| FrameErrors::mean(of).unwrap_or_default();
        curve.push(FramePoint { frame, errors: mean(of_frame), plain: PlainImage { paths, errors: mean(&plain) } });
    }
    let ms: Vec<(u32, f64)> = points(frames).map(|frame| (frame, time.ms(frame))).collect();
    Ok(StillFrames {
        peers: peers::beside(session, beside, &ms)?,
        preset: preset.to_string(),
        rays_per_pixel: stage.rays_per_pixel(preset)?,
        cost: first.log.cost(first_timed(frames)),
        curve,
        flicker: first.flicker.result(),
        denoised: stage.denoised(&camera, (&time, frames, false), reference, first_seed)?,
    })
}

/// Frames after which errors are measured: 1, 2, 4, ... and all.
fn points(frames: u32) -> impl Iterator<Item = u32> {
    (1..=frames).filter(move |f| f.is_power_of_two() || *f == frames)
}

struct Run {
    log: FrameLog,
    flicker: FlickerMeter,
    errors: Vec<FrameErrors>,
}

/// Frames of a camera that stands still, from the first. `clock`: plain accumulation is timed beside them.
fn run(
    stage: &mut Stage,
    preset: Preset,
    reference: &FrameReference,
    seed: u32,
    frames: u32,
    mut clock: Option<&mut PlainClock>,
) -> Result<Run> {
    let camera = stage.still_camera();
    let mut realtime = stage.realtime_with_seed(preset, seed)?;
    if clock.is_some() {
        // a frame for nothing: the first takes longer than the same frame later, and would not count for plain accumulation, whose time is the median of several
        realtime.frame(&stage.tracer, &camera, &[])?;
        realtime.rewind();
    }
    let (mut log, mut flicker, mut errors) = (FrameLog::default(), FlickerMeter::new(frames), Vec::new());
    for frame in 1..=frames {
        log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        let image = realtime.result()?;
        flicker.add(&Displayed::new(&image, stage.channels()))?;
        if let Some(clock) = clock.as_deref_mut()
            && is_plain_timed(frame - 1, first_timed(frames), frames)
        {
            stage.time_plain(&camera, clock)?;
        }
        if points(frames).any(|f| f == frame) {
            errors.push(reference.errors_of(&image)?);
        }
    }
    Ok(Run { log, flicker, errors })
}
