//! What commands share in the terminal they run in: options, text or JSON, warnings, progress bars, Ctrl-C, panics.

pub mod console;
pub mod interrupt;
pub mod panic;
pub mod progress;
pub mod warnings;
