//! How good the preset `balanced` is when it may take as long as the pipeline of the reference work.

use super::candidates::CANDIDATES;
use super::reference::AoReference;
use super::view_renderer::ViewRenderer;
use crate::bench::frame_log::{FrameLog, first_timed};
use crate::bench::record::ao::{EqualTime, ViewRecord};
use crate::bench::record::ao_verdict::{OURS, THEIRS};
use crate::error::Result;
use crate::realtime::Settings;

/// Frames that are timed while the number of rays is looked for.
const PROBE_FRAMES: u32 = 8;
/// Rays a pixel at most.
const MAX_RAYS: u32 = 256;
/// Times that the number is corrected by what the whole run took.
const CORRECTIONS: u32 = 3;

/// Looks for the most rays a pixel with which a frame of ours, camera rays included, takes no longer than one of theirs, by the median
/// of what they take; `None` where one of the two was not measured or one ray takes longer already.
///
/// # Errors
/// Those of making frames.
pub fn find(renderer: &ViewRenderer, view: &ViewRecord, reference: &AoReference, frames: u32) -> Result<Option<EqualTime>> {
    let still = |name: &str| view.results.iter().find(|r| r.preset == name).and_then(|r| r.still.as_ref());
    let (Some(ours), Some(theirs)) = (still(OURS), still(THEIRS)) else { return Ok(None) };
    let Some(their_rmse) = theirs.settled().map(|p| p.errors.rmse_corrected) else { return Ok(None) };
    let their_ms = theirs.moving_cost.ms();
    if ours.moving_cost.ms() > their_ms {
        return Ok(None);
    }
    let Some(candidate) = CANDIDATES.iter().find(|c| c.name == OURS) else { return Ok(None) };
    let settings = |rays_per_pixel| Settings { rays_per_pixel, ..candidate.settings(&renderer.occlusion) };
    let ms = |log: &FrameLog, frames: u32| log.cost(first_timed(frames)).ms();
    let fits =
        |rays: u32| -> Result<bool> { Ok(ms(&renderer.tremble(&settings(rays), PROBE_FRAMES)?.1, PROBE_FRAMES) <= their_ms) };
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
    for _ in 0..CORRECTIONS {
        let (rmse, log) = renderer.settle(&settings(fit), reference, frames)?;
        let ms = ms(&log, frames);
        if ms <= their_ms {
            return Ok(Some(EqualTime { rays_per_pixel: fit, ms, their_ms, rmse, rmse_ratio: rmse / their_rmse }));
        }
        if fit == 1 {
            return Ok(None);
        }
        fit = ((f64::from(fit) * their_ms / ms) as u32).clamp(1, fit - 1);
    }
    Ok(None)
}
