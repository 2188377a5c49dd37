//! The passes of a frame, one file each: the resources that a pass reads and writes, its
//! parameters, and how it is recorded.

pub mod antialias;
pub mod ao_trace;
pub mod budget;
pub mod compose;
pub mod debug;
pub mod display;
pub mod filter;
pub mod gather;
pub mod gbuffer;
pub mod gtao;
pub mod larsen;
pub mod nlmeans;
pub mod paths;
pub mod radiance_filter;
pub mod radiance_temporal;
pub mod rest;
pub mod rest_samples;
pub mod surfaces;
pub mod temporal;
pub mod uncovered;

use crate::interface::DisplayMode;
use crate::interface::debug_views::debug_views;
use crate::shaders::{self, ComputeShader};
use debug::DebugView;

macro_rules! debug_view_modules {
    ($($(#[doc = $doc:literal])+ $view:ident = $name:literal, $glsl:literal, mod $module:ident, shader $shader:ident;)*) => {
        $(pub mod $module;)*

        /// The debug view that a display mode selects, and its shader; `None` for buffers.
        pub fn debug_view(mode: DisplayMode) -> Option<(&'static DebugView, &'static ComputeShader)> {
            match mode {
                $(DisplayMode::$view => Some((&$module::VIEW, &shaders::$shader)),)*
                _ => None,
            }
        }
    };
}
debug_views!(debug_view_modules);
