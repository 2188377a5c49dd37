//! A camera that stands still: time of a frame, errors as frames add up, flicker.

use super::FramesSession;
use super::displayed::{Displayed, FlickerMeter, FrameReference};
use super::signal::PlainClock;
use super::stage::{PLAIN_SEED, Stage, is_plain_timed};
use crate::bench::frame_log::{FrameLog, first_timed};
use crate::bench::record::frames::{FramePoint, StillFrames};
use crate::error::Result;
use crate::realtime::Preset;

/// Measures a preset.
///
/// # Errors
/// Those of the device; Ctrl-C.
pub fn measure(session: &FramesSession, stage: &mut Stage, preset: Preset, reference: &FrameReference) -> Result<StillFrames> {
    let frames = session.args.frames();
    let camera = stage.still_camera();
    let mut realtime = stage.realtime(preset)?;
    let (mut log, mut flicker, mut curve) = (FrameLog::default(), FlickerMeter::new(frames), Vec::new());
    let mut clock = PlainClock::default();
    for frame in 1..=frames {
        log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        let image = realtime.result()?;
        flicker.add(&Displayed::new(&image, stage.channels()))?;
        if is_plain_timed(frame - 1, first_timed(frames), frames) {
            stage.time_plain(&camera, &mut clock)?;
        }
        if frame.is_power_of_two() || frame == frames {
            curve.push(FramePoint { frame, errors: reference.errors_of(&image)?, ..FramePoint::default() });
        }
    }
    let cost = log.cost(first_timed(frames));
    let time = stage.equal_time(preset, &cost, &clock)?;
    for p in &mut curve {
        p.plain = stage.plain_image(&camera, time.paths(p.frame), reference, PLAIN_SEED)?;
    }
    Ok(StillFrames {
        preset: preset.to_string(),
        rays_per_pixel: stage.rays_per_pixel(preset)?,
        cost,
        curve,
        flicker: flicker.result(),
        denoised: stage.denoised(&camera, (&time, frames, false), reference, PLAIN_SEED)?,
    })
}
