//! A window in which a scene's ambient occlusion is traced while one moves through it, with the
//! path-traced truth beside it.
//!
//! [`app`] is the state of the user interface and `panels` shows it; [`worker`] renders on a thread
//! of its own what [`request`]s say. Neither knows a window: [`window`] has one; with
//! the feature `probes`, `headless` runs a `script` without one. [`images`] are looked at in the
//! same window, without any of these.

pub mod app;
pub mod bake_preview;
pub mod baking;
pub mod browse;
pub mod camera;
pub mod dialog;
mod file_kind;
#[cfg(feature = "probes")]
pub mod headless;
mod hiding;
pub mod hierarchy;
pub mod images;
pub mod layer;
mod options;
pub mod painter;
pub mod panels;
mod recent;
pub mod remembered;
pub mod renders;
pub mod request;
mod rounding;
pub mod scene_list;
#[cfg(feature = "probes")]
pub mod script;
pub mod technique;
mod theme;
pub mod window;
mod wireframe;
pub mod worker;

pub use file_kind::FileKind;
pub use options::{CPU_FRAME_RATE, DEFAULT_SIZE, GPU_FRAME_RATE, Painter, ViewOptions};
