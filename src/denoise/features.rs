//! What pixels show, and how it mixes in them: auxiliary outputs of each pixel's middle and of a grid of points in it.

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

/// Points of a pixel in x and in y.
pub const GRID: u32 = 4;
/// Of points of one surface: cosine between their normals and that of the pixel's middle.
const MIN_COSINE: f32 = 0.95;

/// How much of a pixel is the surface in its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum PixelContent {
    /// All of it.
    #[default]
    OneSurface,
    /// It may be that others show in it.
    SeveralSurfaces,
    /// What emits or what surrounds the scene shows in it as well: far brighter, or without noise.
    Emitter,
}

/// Images of surfaces, rows from the top.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Linear base colours, means over the pixel, channels interleaved; of mirrors and glass what they reflect or transmit, of surfaces under a white
    /// sky 1, where nothing is 0.
    pub albedo: Vec<f32>,
    /// Shading normals, world, normal maps left out; likewise. Shorter than 1 where they differ.
    pub normals: Vec<f32>,
    /// Share of the pixel in which something is.
    pub coverage: Vec<f32>,
    /// What shows in the pixel.
    pub mix: Vec<PixelContent>,
    /// What its middle shows.
    pub centres: Vec<AovPixel>,
}

/// The camera's view of points.
pub(super) struct PinholeView {
    position: Vec3,
    back: Vec3,
    orthographic: bool,
    // side of a pixel at unit distance, or of any where rays are parallel
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

    /// Depth of a point along the view.
    pub fn depth(&self, point: [f32; 3]) -> f32 {
        (self.position - Vec3::from(point)).dot(self.back)
    }

    /// Is it a point of the same surface?
    fn is_same(&self, centre: &AovPixel, point: &AovPixel) -> bool {
        let footprint = if self.orthographic { self.pixel } else { self.pixel * self.depth(centre.position) };
        let off = (Vec3::from(point.position) - Vec3::from(centre.position)).dot(Vec3::from(centre.ng));
        point.material == centre.material
            && off.abs() <= DEPTH_TOLERANCE * footprint
            && Vec3::from(point.ns).dot(Vec3::from(centre.ns)) >= MIN_COSINE
    }
}

impl Features {
    /// Renders them, as a pinhole sees them.
    ///
    /// # Errors
    /// Those of [`aov::render`].
    pub fn render(shot: &DenoiseInput, control: &mut dyn Control) -> Result<Self> {
        let DenoiseInput { tracer, scene, camera, options } = *shot;
        let [width, height] = options.size;
        let pixels = width as usize * height as usize;
        let centres = aov::render(tracer, camera, options.size, control)?;
        let mut albedo = vec![Vec3::ZERO; pixels];
        let mut normals = vec![Vec3::ZERO; pixels];
        let mut coverage = vec![0.0; pixels];
        let mut mix = vec![PixelContent::OneSurface; pixels];
        let look = PinholeView::new(camera, height);
        let reach = reach(options.pixel_filter);
        let share = 1.0 / (GRID * GRID) as f32;
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
            let source = material.is_none_or(|m| options.white_sky.is_none() && is_uniform_emitter(m));
            // every pixel whose filter may take this point in
            let range = |p: usize, n: u32| {
                let grid = GRID as usize;
                (p.saturating_sub(reach) / grid)..=((p + reach) / grid).min(n as usize - 1)
            };
            for row in range(y, height) {
                for column in range(x, width) {
                    let k = row * width as usize + column;
                    let centre = &centres[k];
                    let found = match centre.depth < f32::INFINITY && material.is_some() && look.is_same(centre, point) {
                        true => PixelContent::OneSurface,
                        false if source => PixelContent::Emitter,
                        false => PixelContent::SeveralSurfaces,
                    };
                    mix[k] = mix[k].max(found);
                }
            }
        })?;
        let planes = |values: Vec<Vec3>| values.iter().flat_map(|v| v.to_array()).collect();
        Ok(Self { albedo: planes(albedo), normals: planes(normals), coverage, mix, centres })
    }
}

/// Points of the grid beyond a pixel's border that belong to what may show in it: what lies between its last point and the next is either's.
fn reach(filter: PixelFilter) -> usize {
    let beyond = match filter {
        PixelFilter::Box => 0.0,
        PixelFilter::Tent => 0.5,
        PixelFilter::BlackmanHarris => 1.0,
    };
    1 + (beyond * GRID as f32) as usize
}

/// Does a surface of it shine by itself, everywhere alike?
pub(super) fn is_uniform_emitter(material: &Material) -> bool {
    material.unlit || material.emissive != Vec3::ZERO && material.emissive_texture.is_none()
}

fn colour(material: &Material, point: &AovPixel, options: &PathOptions) -> Vec3 {
    match material.kind {
        // a tracer for it knows no materials, and all are of one grey that radiance is divided by already
        _ if options.white_sky.is_some() => Vec3::ONE,
        MaterialKind::Mirror => material.specular_color,
        MaterialKind::Glass => material.specular_color.max(material.transmittance),
        _ => Vec3::new(point.red, point.green, point.blue),
    }
}
