//! What commands share in the terminal they run in: options, text or JSON, warnings, progress bars, Ctrl-C, panics.

pub mod console;
pub mod device_args;
pub mod interrupt;
pub mod lights;
pub mod panic;
pub mod parse;
pub mod progress;
pub mod sampling;
pub mod warnings;
