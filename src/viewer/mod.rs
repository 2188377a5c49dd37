//! A window in which a scene's ambient occlusion is traced while one moves through it, with the path-traced truth beside it.
//!
//! [`app`] is the state of the user interface and `panels` shows it; [`worker`] renders on a thread of its own what [`request`]s say. Neither knows a window: [`window`] has
//! one; [`headless`] runs a [`script`] without one.

pub mod app;
pub mod browse;
pub mod camera;
pub mod headless;
pub mod layer;
pub mod painter;
mod panels;
mod recent;
pub mod request;
pub mod script;
pub mod technique;
pub mod window;
pub mod worker;

use crate::renderer::RenderSettings;
use crate::scene::load::Confine;
use crate::tracer::DeviceSettings;

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

/// What the viewer starts with.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// The scene, a file or `builtin:NAME`; none: the viewer asks for one.
    pub scene: Option<String>,
    /// Where the files lie that a scene may refer to, of scenes that are opened later, too.
    pub confine: Confine<'static>,
    /// Settings of images.
    pub settings: RenderSettings,
    /// Device and tracer.
    pub device: DeviceSettings,
    /// Size of the window, points.
    pub size: [u32; 2],
    /// Frame rate to hold while something moves, frames per second; `None`: full resolution always.
    pub frame_rate: Option<f64>,
    /// Who paints the window.
    pub painter: Painter,
    /// Name of the Vulkan device, for [`Painter::Vulkan`] to use the same.
    pub device_name: Option<String>,
}

/// Opens the last scene among files that were dropped on the window, and takes over the last environment and the last settings.
fn drop_files(app: &mut app::App, files: &[egui::DroppedFile]) {
    let paths: Vec<String> = files.iter().filter_map(|f| f.path.as_ref()).map(|p| p.to_string_lossy().into_owned()).collect();
    for kind in [FileKind::Scene, FileKind::Environment, FileKind::Settings] {
        if let Some(path) = paths.iter().rev().find(|path| FileKind::of(path) == kind) {
            app.open_file(path);
        }
    }
}

/// What a file that is opened or dropped is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A scene, or what only a loader can tell.
    Scene,
    /// An image, or a folder with the faces of a cube: light from all around.
    Environment,
    /// Settings as the viewer saves them.
    Settings,
}

impl FileKind {
    /// The kind of a file by its name.
    pub fn of(path: &str) -> Self {
        let extension = std::path::Path::new(path).extension().unwrap_or_default().to_ascii_lowercase();
        match extension.to_str() {
            _ if path.starts_with("builtin:") => Self::Scene,
            Some("hdr" | "rgbe" | "pic" | "exr" | "png" | "jpg" | "jpeg" | "webp" | "tga" | "bmp") => Self::Environment,
            Some("json" | "toml") => Self::Settings,
            Some("") if std::path::Path::new(path).is_dir() => Self::Environment,
            _ => Self::Scene,
        }
    }
}
