//! Terminal interface shared by the commands: output options, text or JSON, warnings, progress
//! bars, Ctrl-C, panics.

pub mod console;
pub mod interrupt;
pub mod lines;
pub mod loading;
pub mod panic;
pub mod progress;
pub mod warnings;
