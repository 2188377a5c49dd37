//! Presents with Vulkan: on GPUs.

use std::collections::HashMap;
use std::sync::Arc;

use egui::epaint::{ClippedPrimitive, ImageDelta, Mesh, Primitive, Vertex};
use egui::{Color32, ColorImage, Pos2, Rect, TextureId, TextureOptions, TexturesDelta};
use egui_winit::winit::window::Window;

use super::Presenter;
use crate::colour::srgb_decode;
use crate::error::Result;
use crate::gpu::WindowRenderer;
use crate::renderer::interactive::ViewPicture;
use crate::viewer::layer::{BACKGROUND, Layer};
use crate::viewer::painter::Painted;

/// Id of the first image; egui's own count up from 0.
const FIRST_IMAGE: u64 = 1 << 62;

/// Draws on a device of its own.
pub struct VulkanPresenter {
    renderer: WindowRenderer,
    /// Images that are textures: what they show, and by which name.
    images: Vec<Arc<ViewPicture>>,
    device_name: Option<String>,
    validation: bool,
}

impl VulkanPresenter {
    /// A presenter for this window, on the device of this name if it can draw to it.
    ///
    /// # Errors
    /// Those of [`WindowRenderer::new`].
    pub fn new(window: Arc<Window>, device_name: Option<String>, validation: bool) -> Result<Self> {
        let renderer = WindowRenderer::new(window, device_name.as_deref(), validation)?;
        Ok(Self { renderer, images: Vec::new(), device_name, validation })
    }

    /// Uploads images that have changed, and makes rectangles of the layers.
    fn layers(&mut self, layers: &[Layer], scale: f32, textures: &mut TexturesDelta) -> Vec<ClippedPrimitive> {
        let mut named: HashMap<*const ViewPicture, TextureId> = HashMap::new();
        let mut primitives = Vec::new();
        let mut images: Vec<Arc<ViewPicture>> = Vec::new();
        for layer in layers {
            let [width, height] = layer.picture.size.map(|n| n as usize);
            if width == 0 || height == 0 {
                continue;
            }

            // a picture that is on the device already is not copied again
            let id = *named.entry(Arc::as_ptr(&layer.picture)).or_insert_with(|| {
                let slot = images.len();
                let id = TextureId::Managed(FIRST_IMAGE + slot as u64);
                let is_there = self.images.get(slot).is_some_and(|image| Arc::ptr_eq(image, &layer.picture));
                if !is_there {
                    let image = ColorImage::from_rgba_unmultiplied([width, height], &layer.picture.rgba);
                    // what has the same size is overwritten
                    let same_size = self.images.get(slot).is_some_and(|image| image.size == layer.picture.size);
                    let delta = if same_size {
                        ImageDelta::partial([0, 0], image, TextureOptions::LINEAR)
                    } else {
                        ImageDelta::full(image, TextureOptions::LINEAR)
                    };
                    textures.set.push((id, delta));
                }
                images.push(layer.picture.clone());
                id
            });

            // two triangles, in points
            let point = |k: usize, of: [i32; 4]| Pos2::new(of[k] as f32 / scale, of[k + 1] as f32 / scale);
            let corner = |pos: Pos2, uv: [f32; 2]| Vertex { pos, uv: uv.into(), color: Color32::WHITE };
            let (lo, hi) = (point(0, layer.area), point(2, layer.area));
            let mesh = Mesh {
                indices: vec![0, 1, 2, 2, 1, 3],
                vertices: vec![
                    corner(lo, [0.0, 0.0]),
                    corner(Pos2::new(hi.x, lo.y), [1.0, 0.0]),
                    corner(Pos2::new(lo.x, hi.y), [0.0, 1.0]),
                    corner(hi, [1.0, 1.0]),
                ],
                texture_id: id,
            };
            let clip_rect = Rect::from_min_max(point(0, layer.clip), point(2, layer.clip));
            primitives.push(ClippedPrimitive { clip_rect, primitive: Primitive::Mesh(mesh) });
        }

        // textures of images that are gone
        textures
            .free
            .extend((images.len()..self.images.len()).map(|slot| TextureId::Managed(FIRST_IMAGE + slot as u64)));
        self.images = images;
        primitives
    }
}

impl Presenter for VulkanPresenter {
    fn present(
        &mut self,
        size: [u32; 2],
        layers: &[Layer],
        context: &egui::Context,
        painted: &mut Painted,
    ) -> Result<()> {
        let shapes = std::mem::take(&mut painted.shapes);
        let mut textures = std::mem::take(&mut painted.textures);
        let mut primitives = self.layers(layers, painted.pixels_per_point, &mut textures);
        primitives.extend(context.tessellate(shapes, painted.pixels_per_point));
        let background = [16, 8, 0].map(|shift| srgb_decode((BACKGROUND >> shift & 0xff) as f32 / 255.0));
        self.renderer.draw(size, background, painted.pixels_per_point, &primitives, &textures)
    }

    fn recover(&mut self, window: Arc<Window>, context: &egui::Context) -> Result<()> {
        self.renderer = WindowRenderer::new(window, self.device_name.as_deref(), self.validation)?;
        self.images.clear();
        // a new device knows no texture: changing the fonts has egui send its own anew
        context.set_fonts(egui::FontDefinitions::default());
        Ok(())
    }

    fn check(&self) -> Vec<String> {
        self.renderer.validation_messages()
    }
}
