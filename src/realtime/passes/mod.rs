//! The passes of a frame, one file each: resources, parameters, and how they are recorded.

pub mod antialias;
pub mod ao_trace;
pub mod compose;
pub mod debug;
pub mod display;
pub mod filter;
pub mod gather;
pub mod gbuffer;
pub mod gtao;
pub mod larsen;
pub mod nlmeans;
pub mod nodes;
pub mod paths;
pub mod radiance_filter;
pub mod radiance_temporal;
pub mod rejected;
pub mod rest;
pub mod rest_samples;
pub mod surfaces;
pub mod temporal;
pub mod uncovered;

use crate::interface::DisplayMode;
use crate::shaders::{self, ComputeShader};
use debug::DebugView;

/// The debug view that a display mode selects, and its shader; `None` for buffers.
pub fn debug_view(mode: DisplayMode) -> Option<(&'static DebugView, &'static ComputeShader)> {
    match mode {
        DisplayMode::Nodes => Some((&nodes::VIEW, &shaders::NODES)),
        DisplayMode::Rejected => Some((&rejected::VIEW, &shaders::REJECTED)),
        DisplayMode::Result
        | DisplayMode::Unfiltered
        | DisplayMode::Samples
        | DisplayMode::Variance
        | DisplayMode::Depth
        | DisplayMode::Rays
        | DisplayMode::Normal
        | DisplayMode::Position
        | DisplayMode::Bent
        | DisplayMode::Ids
        | DisplayMode::Motion => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view shows what its name says: its file, its shader and its mode are called the same.
    #[test]
    fn debug_views_have_shaders_of_their_names() {
        let views = DisplayMode::ALL.into_iter().filter_map(|mode| Some((mode, debug_view(mode)?.1)));
        let names: Vec<_> = views.map(|(mode, shader)| (mode.name(), shader.name)).collect();
        assert_eq!(names, [("nodes", "nodes"), ("rejected", "rejected")]);
    }
}
