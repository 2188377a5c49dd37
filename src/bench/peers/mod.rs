//! Renderers of others, run beside ours: the file that describes them, and their processes.

pub mod file;
pub mod process;
