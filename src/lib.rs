//! skylit traces ambient occlusion in real time, path-traces the reference it stands in for, and measures how far apart the
//! two are. ARCHITECTURE.md draws the whole; each module's first lines say what it is for.

#![deny(unsafe_code)]

pub mod bvh;
pub mod cli;
pub mod error;
#[allow(unsafe_code, reason = "Vulkan is called here, and nowhere else")]
pub mod gpu;
pub mod interface;
pub mod measure;
pub mod oracle;
pub mod output;
pub mod ray;
pub mod render;
pub mod sampling;
pub mod scene;
pub mod shaders;
pub mod tracer;

pub use error::{Error, Result};
