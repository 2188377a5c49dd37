//! A Vulkan renderer for ambient occlusion: in real time, as a path-traced ground truth, and in
//! numbers that say how far apart the two are.
//!
//! [`Renderer`] opens a scene on a device and renders stills and frames of it; [`renderer`] has an
//! example. Its settings are [`renderer::RenderSettings`], which the command line is made of, too.
//! What it returns are images ([`output`]) with channels, metadata and a report; [`measure`]
//! compares them.
//!
//! Three tracers make one image on any Vulkan 1.3 device ([`tracer`]): ray-tracing pipelines, ray
//! queries, and compute shaders over a hierarchy of our own. ARCHITECTURE.md draws the whole and
//! says which files to touch for what; each module's first lines say what it is for.

#![deny(unsafe_code)]

pub mod accel;
#[cfg(feature = "bake")]
pub mod bake;
#[cfg(feature = "bench")]
pub mod bench;
#[cfg(feature = "cli")]
pub mod cli;
pub mod colour;
#[cfg(feature = "compare")]
pub mod compare;
pub mod denoise;
pub mod error;
pub mod files;
pub mod film;
#[allow(unsafe_code, reason = "Vulkan is called here, and nowhere else")]
pub mod gpu;
pub mod integrators;
pub mod interface;
pub mod measure;
pub mod memory;
pub mod oracle;
pub mod output;
pub mod raster;
pub mod ray;
pub mod realtime;
pub mod renderer;
#[cfg(feature = "report")]
pub mod report;
pub mod sampling;
pub mod scene;
pub mod settings;
pub mod shaders;
pub mod stage;
pub mod stress;
#[cfg(feature = "cli")]
pub mod terminal;
pub mod tracer;
#[cfg(feature = "verify")]
pub mod verify;
#[cfg(feature = "viewer")]
pub mod viewer;

pub use error::{Error, Result};
pub use renderer::Renderer;
