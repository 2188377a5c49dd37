//! Runs of frames of one view of a scene.

use super::candidates::{Candidate, Occlusion};
use super::reference::AoReference;
use crate::bench::frame_log::{FrameLog, first_timed};
use crate::bench::record::ao::{ErrorPoint, ImageErrors, RestRecord, StillRecord};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::{Filter, FilterKind, Realtime, Settings, Technique};
use crate::tracer::Tracer;

/// Frames of a preset that keeps no history: one is like another.
const WITHOUT_HISTORY: u32 = 4;
/// Frames after which the reference work's pipeline has settled: it forgets half in each.
const THEIRS_SETTLED: u32 = 16;
/// Frames at rest that are timed.
const AT_REST: usize = 8;
/// Frames that a history takes to fill, and some.
const PATIENCE: u32 = 8;
/// Frames that are timed with camera rays: a share of those without.
const TREMBLING_SHARE: u32 = 2;

/// Renders frames of a scene from one camera.
#[derive(Clone, Copy)]
pub struct ViewRenderer<'a> {
    /// Holds the scene.
    pub tracer: &'a Tracer,
    /// Pixels.
    pub size: [u32; 2],
    /// From where.
    pub camera: CameraRecord,
    /// How occlusion fades.
    pub occlusion: Occlusion,
}

/// The camera, but for less than a thousandth of a pixel in every second frame: enough that everything has to be looked at anew.
pub fn trembling(camera: &CameraRecord, frame: u32) -> CameraRecord {
    let [width, height] = camera.view;
    CameraRecord { view: [if frame % 2 == 1 { width.next_up() } else { width }, height], ..*camera }
}

/// Frames of a run of `settings` out of `frames`.
pub fn run_length(settings: &Settings, frames: u32) -> u32 {
    if settings.history == 1 && settings.technique == Technique::Traced { frames.min(WITHOUT_HISTORY) } else { frames }
}

impl ViewRenderer<'_> {
    /// Makes frames with these settings.
    pub fn realtime(&self, settings: &Settings) -> Result<Realtime> {
        Realtime::new(self.tracer, self.size, settings, &[])
    }

    /// A camera that stands still, with all work done in every frame.
    pub fn still(&self, candidate: &Candidate, reference: &AoReference, frames: u32) -> Result<StillRecord> {
        let settings = Settings { rest: false, ..candidate.settings(&self.occlusion) };
        self.still_with(&settings, reference, frames)
    }

    /// The same with settings of one's own.
    pub fn still_with(&self, settings: &Settings, reference: &AoReference, frames: u32) -> Result<StillRecord> {
        let frames = run_length(settings, frames);
        let mut realtime = self.realtime(settings)?;
        let (mut log, mut out) = (FrameLog::default(), StillRecord::default());
        for frame in 1..=frames {
            log.frame(&mut realtime, self.tracer, &self.camera, &[])?;
            let image = realtime.result()?;
            out.rmse.push(reference.rmse_of(&image)?);
            out.rays.push(log.rays());
            if frame.is_power_of_two() || frame == frames {
                let unfiltered = match settings.technique {
                    Technique::Larsen => None,
                    _ => Some(reference.errors_of(&realtime.unfiltered()?)?),
                };
                let errors = reference.errors_of(&image)?;
                let (rays, camera_rays) = (log.rays(), log.camera_rays());
                out.curve.push(ErrorPoint { frame, rays, camera_rays, errors, unfiltered });
            }
        }
        out.cost = log.cost(first_timed(frames));
        let mut log = FrameLog::default();
        let trembles = (frames / TREMBLING_SHARE).max(2);
        // an odd one first: it differs from the frame before
        for frame in 1..=trembles {
            log.frame(&mut realtime, self.tracer, &trembling(&self.camera, frame), &[])?;
        }
        out.moving_cost = log.cost(first_timed(trembles));
        if let (Technique::Larsen, Some(last)) = (settings.technique, out.curve.last_mut()) {
            last.unfiltered = Some(self.without_filter(settings, reference, frames.min(THEIRS_SETTLED))?);
        }
        Ok(out)
    }

    /// The settled error of the reference work's pipeline without its box.
    fn without_filter(&self, settings: &Settings, reference: &AoReference, frames: u32) -> Result<ImageErrors> {
        let filter = Filter { kind: FilterKind::None, ..settings.filter };
        let mut realtime = self.realtime(&Settings { filter, ..*settings })?;
        let mut log = FrameLog::default();
        for _ in 0..frames {
            log.frame(&mut realtime, self.tracer, &self.camera, &[])?;
        }
        reference.errors_of(&realtime.result()?)
    }

    /// Settled error and cost with settings of one's own, every frame with all of its camera rays.
    pub fn settle(&self, settings: &Settings, reference: &AoReference, frames: u32) -> Result<(f64, FrameLog)> {
        let last_and_log = self.tremble(settings, frames)?;
        Ok((reference.errors_of(&last_and_log.0)?.rmse_corrected, last_and_log.1))
    }

    /// The last of some frames, every one with all of its camera rays.
    pub fn tremble(&self, settings: &Settings, frames: u32) -> Result<(Vec<f32>, FrameLog)> {
        let mut realtime = self.realtime(&Settings { rest: false, ..*settings })?;
        let mut log = FrameLog::default();
        for frame in 0..frames {
            log.frame(&mut realtime, self.tracer, &trembling(&self.camera, frame), &[])?;
        }
        Ok((realtime.result()?, log))
    }

    /// A camera that stands still, until nothing is traced any more; `None` for what never rests.
    pub fn rest(&self, candidate: &Candidate, reference: &AoReference) -> Result<Option<RestRecord>> {
        let settings = Settings { rest: true, ..candidate.settings(&self.occlusion) };
        if settings.technique != Technique::Traced || settings.history == 1 {
            return Ok(None);
        }
        let mut realtime = self.realtime(&settings)?;
        let most = settings.history.min(Settings::MAX_SAMPLES).saturating_mul(settings.resolution.period()) + PATIENCE;
        let mut log = FrameLog::default();
        let mut frames = None;
        for frame in 0..most {
            if log.frame(&mut realtime, self.tracer, &self.camera, &[])?.occlusion_rays == 0 {
                frames = Some(frame);
                break;
            }
        }
        let first = log.len();
        for _ in 0..AT_REST {
            log.frame(&mut realtime, self.tracer, &self.camera, &[])?;
        }
        Ok(Some(RestRecord { frames, cost: log.cost(first), errors: reference.errors_of(&realtime.result()?)? }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trembling_camera_moves_by_next_to_nothing() {
        let camera =
            CameraRecord { camera_to_world: [[0.0; 4]; 3], view: [0.7, 0.4], orthographic: false, clip: [0.0, f32::INFINITY] };
        let moved = trembling(&camera, 1);
        assert!(moved != camera && trembling(&camera, 2) == camera);
        // pixels, at the border of a wide image
        assert!((moved.view[0] - camera.view[0]) / camera.view[0] * 3840.0 < 1e-3);
    }
}
