//! Paints egui's output, and the images beneath it, on the CPU.

use egui_software_backend::{BufferMutRef, ColorFieldOrder, EguiSoftwareRender};

use super::layer::{FrameBuffer, Layer};

/// Words of frame buffers are `0x00RRGGBB`: blue, green, red in memory.
const ORDER: ColorFieldOrder = ColorFieldOrder::Bgra;

/// Paints on the CPU. What has not changed since the last frame is kept.
pub struct CpuPainter {
    renderer: EguiSoftwareRender,
}

impl Default for CpuPainter {
    fn default() -> Self {
        Self { renderer: EguiSoftwareRender::new(ORDER) }
    }
}

impl CpuPainter {
    /// Paints a frame: `background` (`0x00RRGGBB`), layers, and the user interface over them.
    pub fn paint(
        &mut self,
        to: &mut FrameBuffer,
        background: u32,
        layers: &[Layer],
        context: &egui::Context,
        output: &mut Painted,
    ) {
        let [width, height] = to.size;
        if width == 0 || height == 0 {
            return;
        }
        to.words.fill(background);
        layers.iter().for_each(|l| l.draw(to));
        let shapes = std::mem::take(&mut output.shapes);
        let jobs = context.tessellate(shapes, output.pixels_per_point);
        let textures = std::mem::take(&mut output.textures);
        let mut buffer = BufferMutRef::new(bytemuck::cast_slice_mut(to.words), width, height);
        self.renderer.render(&mut buffer, &jobs, &textures, output.pixels_per_point);
    }
}

/// Part of egui's output that is painted.
#[derive(Default)]
pub struct Painted {
    /// Shapes of the frame.
    pub shapes: Vec<egui::epaint::ClippedShape>,
    /// Changes of textures since the last frame that was painted.
    pub textures: egui::TexturesDelta,
    /// Physical pixels per point.
    pub pixels_per_point: f32,
}

impl Painted {
    /// Takes the output of a frame. Changes of textures of frames that were not painted are kept.
    pub fn take(&mut self, output: &mut egui::FullOutput) {
        self.shapes = std::mem::take(&mut output.shapes);
        self.textures.append(std::mem::take(&mut output.textures_delta));
        self.pixels_per_point = output.pixels_per_point;
    }
}
