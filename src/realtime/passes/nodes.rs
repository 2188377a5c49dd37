//! `nodes`: a heat map of the BVH nodes that camera rays visit, by a traversal kernel of its own.

use super::debug::DebugView;
use crate::error::Result;
use crate::realtime::graph::Range;
use crate::realtime::resources::{Resource, Resources};
use crate::tracer::stream::LAUNCH_RAYS;

/// The view.
pub const VIEW: DebugView = DebugView {
    reads: &[Resource::Camera, Resource::Scene],
    has_counts: true,
    middle: NodeVisits::MIDDLE,
    ranges: |block| Range::launches(block.rays(), 1, LAUNCH_RAYS),
    pipeline: |tracer, shader| tracer.counting_kernel(shader, "--show nodes"),
    ..DebugView::OF_PIXELS
};

/// BVH nodes that the camera rays of a frame visit, one ray through the centre of each pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct NodeVisits {
    /// Mean over all pixels of the image.
    pub mean: f64,
    /// Maximum over all pixels.
    pub max: u32,
}

impl NodeVisits {
    /// Number of nodes at the middle of the colours.
    pub const MIDDLE: f32 = 16.0;

    /// Reads the counts of the last frame that displayed them, for `pixels` pixels.
    pub fn read(resources: &Resources, pixels: u64) -> Result<Self> {
        let nodes: Vec<u32> = resources.read(Resource::DebugCounts, pixels)?;
        let sum: u64 = nodes.iter().map(|&n| u64::from(n)).sum();
        Ok(Self { mean: sum as f64 / nodes.len().max(1) as f64, max: nodes.iter().copied().max().unwrap_or(0) })
    }
}
