//! A camera that stands still: time of a frame, errors as frames add up, flicker.

use super::FramesSession;
use super::displayed::{Displayed, FlickerMeter, FrameReference};
use super::stage::{PLAIN_SEED, Stage};
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
    for frame in 1..=frames {
        log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        let image = realtime.result()?;
        flicker.add(&Displayed::new(&image, stage.channels()))?;
        if frame.is_power_of_two() || frame == frames {
            curve.push(FramePoint { frame, errors: reference.errors_of(&image)?, ..FramePoint::default() });
        }
    }
    let cost = log.cost(first_timed(frames));
    // plain accumulation is timed by the clock, too
    let ms = cost.wall_ms.median;
    for p in &mut curve {
        p.plain = stage.plain_in(&camera, ms * f64::from(p.frame), reference, PLAIN_SEED)?;
    }
    Ok(StillFrames {
        preset: preset.to_string(),
        rays_per_pixel: stage.rays_per_pixel(preset)?,
        cost,
        curve,
        flicker: flicker.result(),
        denoised: stage.denoised(&camera, (ms, frames, false), reference, PLAIN_SEED)?,
    })
}
