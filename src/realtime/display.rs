//! The display of frames: a buffer of theirs, and how it becomes 8-bit colours.

pub use crate::interface::DisplayMode;
use crate::interface::ToneMap;

/// The buffer that frames display, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// Buffer to display.
    pub shown: DisplayMode,
    /// Exposure in stops: 0 unchanged, 1 twice as bright.
    pub exposure: f32,
    /// Length by which depths and positions are divided, scene units.
    pub unit: f32,
    /// Tone mapping operator of radiance.
    pub tone_map: ToneMap,
}
