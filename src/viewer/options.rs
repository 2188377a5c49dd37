//! Options that the viewer starts with.

use crate::renderer::RenderSettings;
use crate::scene::load::{Confine, GeometryOptions, LoadOptions};
use crate::tracer::DeviceSettings;

/// Size of the window where none is given or remembered, points.
pub const DEFAULT_SIZE: [u32; 2] = [1280, 800];
/// Frame rate that is held on CPU drivers, frames per second.
pub const CPU_FRAME_RATE: f64 = 10.0;

/// Frame rate that is held on GPUs, frames per second.
pub const GPU_FRAME_RATE: f64 = 30.0;

crate::settings::choices! {
    /// Who paints the window.
    pub enum Painter {
        /// The CPU: on CPU drivers, where Vulkan would wait for the rays that are traced, and would need narrower vectors
        Cpu = "cpu",
        /// Vulkan, on a device of its own
        Vulkan = "vulkan",
    }
}

/// Options that the viewer starts with.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// The scene, a file or `builtin:NAME`; none: the viewer asks for one.
    pub scene: Option<String>,
    /// Which scene of a glTF file; none: the one that the file names.
    pub gltf_scene: Option<String>,
    /// Where the files lie that a scene may refer to, of scenes that are opened later, too.
    pub confine: Confine<'static>,
    /// Normals and texture coordinates of all scenes that are opened.
    pub geometry: GeometryOptions,
    /// Settings of images.
    pub settings: RenderSettings,
    /// Device and tracer.
    pub device: DeviceSettings,
    /// Size of the window, points; `None`: as it was the last time.
    pub size: Option<[u32; 2]>,
    /// Frame rate to hold while something moves, frames per second; `None`: full resolution always.
    pub frame_rate: Option<f64>,
    /// Who paints the window.
    pub painter: Painter,
    /// Name of the Vulkan device, for [`Painter::Vulkan`] to use the same.
    pub device_name: Option<String>,
}

impl ViewOptions {
    /// How scenes are loaded.
    pub fn load(&self) -> LoadOptions<'static> {
        LoadOptions { confine: self.confine, geometry: self.geometry, ..LoadOptions::default() }
    }
}
