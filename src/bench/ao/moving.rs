//! A camera that goes round, and what is right on its way.

use super::candidates::Candidate;
use super::laps::Laps;
use super::reference::{Referee, Truth};
use super::shot::{Shot, first_timed};
use crate::bench::record::ao::{Errors, Moving};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::Technique;
use crate::scene::{Camera, Orbit};

/// Frames in which it would be back.
const FRAMES_PER_TURN: f64 = 720.0;
/// Frames with a reference.
const TRUTHS: u32 = 4;

/// Frames of a sequence in which its error is measured, counted from 0: in its second half, the last included.
pub fn measured(frames: u32) -> Vec<u32> {
    let half = frames / 2;
    let mut at: Vec<u32> = (1..=TRUTHS).map(|k| frames - half + half * k / TRUTHS).map(|end| end.max(1) - 1).collect();
    at.dedup();
    at
}

/// Cameras of each frame, and references of some.
pub struct Way {
    cameras: Vec<CameraRecord>,
    truths: Vec<(u32, Truth)>,
}

impl Way {
    /// About the vertical through `middle`, `frames` of them.
    pub fn new(
        shot: &Shot,
        referee: &mut Referee,
        camera: &Camera,
        (middle, origin): (glam::DVec3, glam::DVec3),
        frames: u32,
    ) -> Result<Self> {
        let orbit = Orbit::vertical(middle, FRAMES_PER_TURN)?;
        let aspect = f64::from(shot.size[0]) / f64::from(shot.size[1]);
        let record = |f: u32| CameraRecord::new(&orbit.camera_at(camera, f64::from(f)), origin, aspect);
        let cameras: Vec<CameraRecord> = (0..frames).map(record).collect();
        let truth = |f: u32| Ok((f, referee.truth(shot.tracer, &cameras[f as usize])?));
        let truths = measured(frames).into_iter().map(truth).collect::<Result<_>>()?;
        Ok(Self { cameras, truths })
    }

    /// A preset on its way.
    pub fn follow(&self, shot: &Shot, candidate: &Candidate) -> Result<Moving> {
        let settings = candidate.settings(&shot.occlusion);
        let mut realtime = shot.realtime(&settings)?;
        let mut laps = Laps::default();
        let (mut errors, mut unfiltered): (Vec<Errors>, Vec<Errors>) = (Vec::new(), Vec::new());
        for (f, camera) in self.cameras.iter().enumerate() {
            laps.frame(&mut realtime, shot.tracer, camera, &[])?;
            let Some((_, truth)) = self.truths.iter().find(|t| t.0 as usize == f) else { continue };
            errors.push(truth.errors_of(&realtime.result()?)?);
            if settings.technique != Technique::Larsen {
                unfiltered.push(truth.errors_of(&realtime.unfiltered()?)?);
            }
        }
        let references = self.truths.len().max(1) as f64;
        Ok(Moving {
            degrees_per_frame: 360.0 / FRAMES_PER_TURN,
            cost: laps.cost(first_timed(self.cameras.len() as u32)),
            frames: self.truths.iter().map(|t| t.0).collect(),
            errors: Errors::mean(&errors).unwrap_or_default(),
            unfiltered: Errors::mean(&unfiltered),
            reference_rmse: self.truths.iter().map(|t| t.1.rmse).sum::<f64>() / references,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_measured_late() {
        assert_eq!(measured(64), [39, 47, 55, 63]);
        assert_eq!(measured(16), [9, 11, 13, 15]);
        assert_eq!(measured(4), [1, 2, 3]);
    }
}
