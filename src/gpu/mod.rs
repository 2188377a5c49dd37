//! A thin layer over Vulkan: device, memory, pipelines, submission, timing. Its functions are safe,
//! with the preconditions that their comments state; `unsafe` stays in this folder and in `tracer`.

mod acceleration_structure;
mod buffer;
mod cache;
mod commands;
mod device;
mod drawing;
pub mod environment;
#[cfg_attr(not(feature = "probes"), path = "no_faults.rs")]
mod faults;
mod formats;
mod graphics_pipeline;
pub mod host_memory;
mod image;
mod info;
mod instance;
mod manifests;
#[cfg_attr(not(feature = "oidn"), path = "no_oidn.rs")]
pub mod oidn;
mod pipeline;
mod result;
pub mod threads;
#[cfg(feature = "viewer")]
mod window;

pub use acceleration_structure::{AccelerationStructure, AccelerationStructureInstance, BottomLevelInput, Update};
pub use buffer::{Buffer, Memory};
pub use commands::{Commands, Recorder, Timing};
pub use device::{Device, Options, preferred};
pub use drawing::DrawRecorder;
pub use graphics_pipeline::{Cull, GraphicsPipeline};
pub use image::{Image, Targets};
pub use info::{DeviceInfo, Limits, RayTracingExtensions, enumerate};
pub use instance::Instance;
pub use pipeline::{ComputePipeline, HitShaders, KeptPipelines, RayTracingPipeline, Specialization, compile_seconds};
#[cfg(feature = "viewer")]
pub use window::{Target, WindowRenderer};
