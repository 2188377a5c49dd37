//! What frames in real time cost: times of their passes, and rays.

use serde::{Deserialize, Serialize};

use crate::measure::stats::Percentiles;

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

    /// Rays of a frame, those of the camera included.
    pub fn all_rays(&self) -> f64 {
        self.rays + self.camera_rays
    }
}
