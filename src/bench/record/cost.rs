//! What frames in real time cost: times of their passes, and rays.

use serde::{Deserialize, Serialize};

use crate::measure::stats::Percentiles;

/// Passes of a frame that trace and average samples.
const SAMPLING: [&str; 6] = ["path_camera", "path_bounce", "path_shadow", "path_gather", "ao_trace", "gather"];

/// Times of a pass, or of one step of several launches of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassTime {
    /// Name of the pass.
    pub pass: String,
    /// Device time over the timed frames, milliseconds.
    pub ms: Percentiles,
}

/// Cost of a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameCost {
    /// Each pass.
    pub passes: Vec<PassTime>,
    /// All passes, on the device; 0 where the device has no clock.
    pub device_ms: Percentiles,
    /// By the clock of the process, submission included.
    pub wall_ms: Percentiles,
    /// Camera rays, the mean of a frame.
    pub camera_rays: f64,
    /// Occlusion rays traced, the mean of a frame.
    pub rays: f64,
    /// Occlusion rays that were left out, the mean of a frame.
    pub skipped_rays: f64,
}

impl FrameCost {
    /// Time on the device, or by the clock where the device has none, milliseconds.
    pub fn time(&self) -> Percentiles {
        if self.device_ms.median > 0.0 { self.device_ms } else { self.wall_ms }
    }

    /// Median on the device, or by the clock where the device has none.
    pub fn ms(&self) -> f64 {
        self.time().median
    }

    /// Share of the device time that goes into passes that trace and average samples, rather than reuse those of earlier frames and of neighbours; `None` where it is
    /// not known.
    pub fn sampling_share(&self) -> Option<f64> {
        let is_sampling = |p: &&PassTime| SAMPLING.contains(&p.pass.as_str());
        let sampling: f64 = self.passes.iter().filter(is_sampling).map(|p| p.ms.median).sum();
        let all: f64 = self.passes.iter().map(|p| p.ms.median).sum();
        (sampling > 0.0).then(|| sampling / all)
    }

    /// Rays of a frame, those of the camera included.
    pub fn all_rays(&self) -> f64 {
        self.rays + self.camera_rays
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_samples() {
        let pass = |pass: &str, ms: f64| PassTime { pass: pass.into(), ms: Percentiles::from_values(&[ms]).unwrap() };
        let cost = FrameCost {
            passes: vec![pass("path_camera", 1.0), pass("path_bounce", 2.0), pass("filter", 1.0)],
            ..FrameCost::default()
        };
        assert_eq!(cost.sampling_share(), Some(0.75));
        assert_eq!(FrameCost::default().sampling_share(), None);
    }
}
