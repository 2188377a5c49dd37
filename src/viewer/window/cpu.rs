//! Presents what the CPU paints: on CPU drivers, where Vulkan would have to wait for the rays that
//! are being traced.

use std::num::NonZeroU32;
use std::sync::Arc;

use egui_winit::winit::window::Window;
use softbuffer::{Context, SoftBufferError, Surface};

use super::Presenter;
use crate::error::{Error, Result};
use crate::viewer::layer::{BACKGROUND, FrameBuffer, Layer};
use crate::viewer::painter::{CpuPainter, Painted};

/// Paints into the window's own memory.
pub struct CpuPresenter {
    surface: Surface<Arc<Window>, Arc<Window>>,
    painter: CpuPainter,
}

impl CpuPresenter {
    /// A presenter for this window.
    ///
    /// # Errors
    /// [`Error::Device`] where the window system has no such surfaces.
    pub fn new(window: Arc<Window>) -> Result<Self> {
        Ok(Self { surface: surface(window)?, painter: CpuPainter::default() })
    }
}

fn surface(window: Arc<Window>) -> Result<Surface<Arc<Window>, Arc<Window>>> {
    let context = Context::new(window.clone()).map_err(failed)?;
    Surface::new(&context, window).map_err(failed)
}

impl Presenter for CpuPresenter {
    fn present(
        &mut self,
        size: [u32; 2],
        layers: &[Layer],
        context: &egui::Context,
        painted: &mut Painted,
    ) -> Result<()> {
        let [Some(width), Some(height)] = size.map(NonZeroU32::new) else { return Ok(()) };
        self.surface.resize(width, height).map_err(failed)?;
        let mut buffer = self.surface.buffer_mut().map_err(failed)?;
        let size = size.map(|n| n as usize);
        self.painter.paint(&mut FrameBuffer { size, words: &mut buffer }, BACKGROUND, layers, context, painted);
        buffer.present().map_err(failed)
    }

    fn recover(&mut self, window: Arc<Window>, _: &egui::Context) -> Result<()> {
        self.surface = surface(window)?;
        Ok(())
    }
}

fn failed(e: SoftBufferError) -> Error {
    Error::Device(format!("the window cannot be drawn: {e}"))
}
