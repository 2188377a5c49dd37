//! Feature images for denoising: AOVs of each pixel's centre, and of a grid of points in it.

use glam::Vec3;

use super::DenoiseInput;
use crate::error::Result;
use crate::film::Control;
use crate::film::camera::CameraRecord;
use crate::integrators::aov::{self, AovPixel};
use crate::integrators::path::{PathOptions, PixelFilter};
use crate::raster::Primary;
use crate::realtime::DEPTH_TOLERANCE;
use crate::scene::material::{Material, MaterialKind};

/// Number of points of a pixel along x and along y.
pub const GRID: u32 = 4;
/// Minimum cosine between the shading normals of two points of one surface.
const MIN_COSINE: f32 = 0.95;

/// The surfaces that are visible in a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum PixelContent {
    /// Only the surface at its centre.
    #[default]
    OneSurface,
    /// Possibly several surfaces.
    SeveralSurfaces,
    /// Also an emitter or the environment, which is far brighter, or free of noise.
    Emitter,
}

/// Feature images, rows from the top.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Linear base colour, averaged over the pixel, channels interleaved. Mirrors and glass have
    /// their specular or transmitted colour, white furnaces 1, the background 0.
    pub albedo: Vec<f32>,
    /// World-space normal without normal maps, averaged over the pixel, channels interleaved.
    pub normals: Vec<f32>,
    /// Fraction of the pixel that is covered by surfaces, in [0, 1].
    pub coverage: Vec<f32>,
    /// The surfaces that are visible in the pixel.
    pub content: Vec<PixelContent>,
    /// AOVs of the pixel's centre.
    pub centres: Vec<AovPixel>,
}

/// The camera as a pinhole, for depths and pixel footprints.
pub(super) struct PinholeView {
    position: Vec3,
    back: Vec3,
    orthographic: bool,
    // side of a pixel at unit distance; for an orthographic camera, at any distance
    pixel: f32,
}

impl PinholeView {
    /// `height` in pixels.
    pub fn new(camera: &CameraRecord, height: u32) -> Self {
        let column = |c: usize| Vec3::from_array(camera.camera_to_world.map(|row| row[c]));
        Self {
            position: column(3),
            back: column(2).normalize_or_zero(),
            orthographic: camera.orthographic,
            pixel: 2.0 * camera.view[1] / height as f32,
        }
    }

    /// Depth of a point along the view direction, in scene units.
    pub fn depth(&self, point: [f32; 3]) -> f32 {
        (self.position - Vec3::from(point)).dot(self.back)
    }

    /// Whether `point` is on the same surface as the pixel's centre.
    fn is_same(&self, centre: &AovPixel, point: &AovPixel) -> bool {
        let footprint = if self.orthographic { self.pixel } else { self.pixel * self.depth(centre.position) };
        let off = (Vec3::from(point.position) - Vec3::from(centre.position)).dot(Vec3::from(centre.ng));
        point.material == centre.material
            && off.abs() <= DEPTH_TOLERANCE * footprint
            && Vec3::from(point.ns).dot(Vec3::from(centre.ns)) >= MIN_COSINE
    }
}

impl Features {
    /// Renders the feature images with a pinhole camera.
    ///
    /// # Errors
    /// Those of [`aov::render`].
    pub fn render(shot: &DenoiseInput, control: &mut dyn Control) -> Result<Self> {
        let DenoiseInput { tracer, scene, camera, options } = *shot;
        let [width, height] = options.samples.size;
        let pixels = width as usize * height as usize;

        // AOVs of the pixels' centres, with which all other points are compared.
        let centres = aov::render(tracer, camera, options.samples.size, control)?;
        let mut albedo = vec![Vec3::ZERO; pixels];
        let mut normals = vec![Vec3::ZERO; pixels];
        let mut coverage = vec![0.0; pixels];
        let mut content = vec![PixelContent::OneSurface; pixels];
        let view = PinholeView::new(camera, height);
        let reach = reach(options.samples.pixel_filter);
        let share = 1.0 / (GRID * GRID) as f32;

        // Means over a grid of points of each pixel.
        let fine = [width * GRID, height * GRID];
        aov::visit(tracer, camera, fine, Primary::Traced, control, &mut |index, point| {
            let [x, y] = [index % fine[0] as usize, index / fine[0] as usize];
            let at = y / GRID as usize * width as usize + x / GRID as usize;
            let material = scene.materials.get(point.material as usize).filter(|_| point.depth < f32::INFINITY);
            if let Some(material) = material {
                albedo[at] += colour(material, point, options) * share;
                normals[at] += Vec3::from(point.ns) * share;
                coverage[at] += share;
            }

            // The content of every pixel whose reconstruction filter may include this point.
            let is_emitter = material.is_none_or(|m| options.white_sky.is_none() && is_uniform_emitter(m));
            let range = |p: usize, n: u32| {
                let grid = GRID as usize;
                (p.saturating_sub(reach) / grid)..=((p + reach) / grid).min(n as usize - 1)
            };
            for row in range(y, height) {
                for column in range(x, width) {
                    let k = row * width as usize + column;
                    let centre = &centres[k];
                    let are_surfaces = centre.depth < f32::INFINITY && material.is_some();
                    let found = if are_surfaces && view.is_same(centre, point) {
                        PixelContent::OneSurface
                    } else if is_emitter {
                        PixelContent::Emitter
                    } else {
                        PixelContent::SeveralSurfaces
                    };
                    content[k] = content[k].max(found);
                }
            }
        })?;
        let planes = |values: Vec<Vec3>| values.iter().flat_map(|v| v.to_array()).collect();
        Ok(Self { albedo: planes(albedo), normals: planes(normals), coverage, content, centres })
    }
}

/// Number of grid points beyond a border that may be visible: the filter's reach, and one between.
fn reach(filter: PixelFilter) -> usize {
    let beyond = match filter {
        PixelFilter::Box | PixelFilter::Centre => 0.0,
        PixelFilter::Tent => 0.5,
        PixelFilter::BlackmanHarris => 1.0,
    };
    1 + (beyond * GRID as f32) as usize
}

/// Whether the material emits with one radiance everywhere: unlit, or emissive without a texture.
pub(super) fn is_uniform_emitter(material: &Material) -> bool {
    material.unlit || material.emissive != Vec3::ZERO && material.emissive_texture.is_none()
}

fn colour(material: &Material, point: &AovPixel, options: &PathOptions) -> Vec3 {
    match material.kind {
        // white furnaces have no materials, and radiance is divided by their albedo already
        _ if options.white_sky.is_some() => Vec3::ONE,
        MaterialKind::Mirror => material.specular_color,
        MaterialKind::Glass => material.specular_color.max(material.transmittance),
        MaterialKind::MetallicRoughness | MaterialKind::Matte | MaterialKind::Copper | MaterialKind::Gold => {
            Vec3::new(point.red, point.green, point.blue)
        }
    }
}
