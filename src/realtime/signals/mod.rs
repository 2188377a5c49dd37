//! The signals that frames are made of: ambient visibility, radiance, and Larsen's pipeline.

pub mod larsen;
pub mod radiance;
pub mod visibility;

use super::frame_samples::FrameSamples;
use super::graph::Stage;
use super::plan::Signal;
use super::resources::Extent;
use super::settings::Settings;

/// The passes of the frames of a signal, at one image size.
pub struct Pipeline {
    /// The signal.
    pub signal: &'static dyn Signal,
    /// The settings, resolved.
    pub settings: Settings,
    /// Number of samples of frames.
    pub frame_samples: FrameSamples,
    /// Quantities from which the sizes of resources follow.
    pub extent: Extent,
    /// The stages, in order.
    pub stages: Vec<Stage>,
    /// Why camera rays are traced or rasterized.
    pub primary_reason: String,
}

/// Returns the number of pixels of an image.
pub fn pixels(size: [u32; 2]) -> u64 {
    u64::from(size[0]) * u64::from(size[1])
}
