//! The tiles of an image that can contain geometry. Camera rays through the others need no tracing.
//!
//! The screen bounding rectangle of every primitive is marked, with a margin for the rounding of
//! the rays, so the mask is conservative: unmarked tiles are certain to be empty.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::block::{Block, TILE};
use super::camera::CameraRecord;
use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene, Submesh, TlasInstance};
use crate::scene::Geometry;

/// Maximum number of instanced primitives per camera ray that are projected: above it, tracing
/// costs less. A projection takes 10 to 20 ns, a camera ray that misses a hierarchy about 50.
const PRIMITIVES_PER_RAY: f64 = 0.5;
/// Relative rounding of ray origins, directions and transformed vertices: 16 half-ulps.
const ROUNDING: f64 = 16.0 * f32::EPSILON as f64 * 0.5;
/// Minimum margin, pixels.
const MIN_MARGIN: f64 = 0.5;
/// Maximum margin, pixels: no tile is skipped in views too narrow for single precision.
const MAX_MARGIN: f64 = 64.0;

/// The tiles of an image that can contain geometry.
#[derive(Debug)]
pub struct TileMask {
    tiles_x: u32,
    live: Vec<bool>,
}

/// Projection from world space (relative to the scene's origin) to the image.
struct View {
    world_to_camera: DAffine3,
    orthographic: bool,
    // pixels per unit of the image plane, and the middle of the image
    scale: [f64; 2],
    middle: [f64; 2],
    margin: f64,
}

/// A rectangle in pixels.
#[derive(Clone, Copy)]
struct Rectangle {
    min: [f64; 2],
    max: [f64; 2],
}

impl TileMask {
    /// The mask of an image of `size` pixels with `spp` samples each. `None` if no tile can be
    /// skipped: the camera is inside or beside the scene's bounds, or every tile is marked.
    pub fn new(flat: &FlatScene, camera: &CameraRecord, size: [u32; 2], spp: u32) -> Option<Self> {
        let bounds = flat.bounds();
        let view = View::new(camera, size, bounds, &flat.instances)?;
        let [tiles_x, tiles_y] = size.map(|n| n.div_ceil(TILE));
        let live = std::iter::repeat_with(AtomicBool::default).take((tiles_x * tiles_y) as usize).collect();
        let tiles = Marks { tiles_x, tiles_y, live };
        // the scene's bounds first: for a distant scene they cover only a small part of the image
        let whole = view.rectangle(bounds, &DAffine3::IDENTITY)?;
        let placed: f64 = flat.instances.iter().map(|p| flat.groups[p.group].primitive_count as f64).sum();
        let rays = whole.clipped_area(size) * spp as f64;
        if placed > PRIMITIVES_PER_RAY * rays {
            tiles.mark(whole, view.margin);
        } else {
            for placement in &flat.instances {
                let group = &flat.groups[placement.group];
                for part in &group.submeshes {
                    mark_part(flat, placement, group, part, &view, &tiles);
                }
            }
        }
        let live: Vec<bool> = tiles.live.into_iter().map(AtomicBool::into_inner).collect();
        live.iter().any(|l| !l).then_some(Self { tiles_x, live })
    }

    /// Indices within a block of its marked tiles; `None` if all are marked.
    pub fn tiles(&self, block: &Block) -> Option<Vec<u32>> {
        let width = self.tiles_x * TILE;
        let live: Vec<u32> = (0..block.tiles()).filter(|&t| self.live[block.image_tile(t, width)]).collect();
        (live.len() < block.tiles() as usize).then_some(live)
    }

    /// Number of marked tiles, and of all tiles.
    pub fn count(&self) -> (usize, usize) {
        (self.live.iter().filter(|l| **l).count(), self.live.len())
    }
}

fn mark_part(
    flat: &FlatScene,
    placement: &TlasInstance,
    group: &BlasGroup,
    part: &Submesh,
    view: &View,
    tiles: &Marks,
) {
    let to_world = placement.to_world;
    match &flat.scene.meshes[part.mesh].geometry {
        Geometry::Triangles(mesh) => {
            // each vertex once, though several triangles share it
            let image: Vec<[f64; 2]> = (0..mesh.positions.len())
                .into_par_iter()
                .with_min_len(4096)
                .map(|v| view.project(&to_world, flat.vertex(part, v)))
                .collect();
            mesh.indices.par_iter().with_min_len(4096).for_each(|corners| {
                let r = Rectangle::bounding(corners.iter().map(|&c| image[c as usize]));
                tiles.mark(r, view.margin);
            });
        }
        Geometry::Spheres(spheres) => (0..spheres.len()).into_par_iter().with_min_len(1024).for_each(|k| {
            let bounds = flat.primitive_bounds(group, part, part.first_primitive + k);
            match view.rectangle(bounds, &to_world) {
                Some(r) => tiles.mark(r, view.margin),
                // the sphere's box may extend behind the camera
                None => tiles.mark(Rectangle { min: [f64::NEG_INFINITY; 2], max: [f64::INFINITY; 2] }, 0.0),
            }
        }),
    }
}

impl View {
    fn new(camera: &CameraRecord, size: [u32; 2], bounds: Aabb, instances: &[TlasInstance]) -> Option<Self> {
        let rows = camera.camera_to_world.map(|r| r.map(f64::from));
        let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        if matrix.determinant().abs() <= 1e-12 {
            return None;
        }
        let camera_to_world = DAffine3 { matrix3: matrix, translation: column(3) };
        let half = camera.view.map(f64::from);
        let image = size.map(f64::from);
        let mut view = Self {
            world_to_camera: camera_to_world.inverse(),
            orthographic: camera.orthographic,
            scale: [0.5 * image[0] / half[0], 0.5 * image[1] / half[1]],
            middle: image.map(|n| 0.5 * n),
            margin: 0.0,
        };
        // all geometry has to be in front of the camera
        let corners = corners(bounds).map(|c| view.world_to_camera.transform_point3(c));
        let near = corners.iter().map(|c| -c.z).fold(f64::INFINITY, f64::min);
        let reach = corners.iter().map(|c| c.length()).fold(0.0, f64::max);
        // as in oracle/rounding.rs: going to an ill-conditioned group's space and back errs more
        let moved = || instances.iter().map(|p| p.to_world).filter(|t| *t != DAffine3::IDENTITY);
        let translation = moved().map(|t| t.translation.length()).fold(0.0, f64::max);
        let condition = moved().map(|t| condition(t.matrix3)).fold(1.0, f64::max);
        let coordinates = condition
            * (bounds.min.abs().max(bounds.max.abs()).max_element() as f64 + column(3).length() + translation);
        if !(reach.is_finite() && (view.orthographic || near > 1e-3 * reach)) {
            return None;
        }
        // error of points and directions on the image plane at unit distance
        let error = if view.orthographic {
            ROUNDING * (coordinates + half[0] + half[1] + reach)
        } else {
            ROUNDING * (coordinates / near + 1.0) * (1.0 + half[0] * half[0] + half[1] * half[1])
        };
        view.margin = MIN_MARGIN + error * view.scale[0].max(view.scale[1]);
        (view.margin <= MAX_MARGIN).then_some(view)
    }

    /// Projects a point to the image, in pixels from the upper left corner.
    fn project(&self, to_world: &DAffine3, point: Vec3) -> [f64; 2] {
        let p = self.world_to_camera.transform_point3(to_world.transform_point3(point.as_dvec3()));
        let depth = if self.orthographic { 1.0 } else { -p.z };
        [self.middle[0] + self.scale[0] * p.x / depth, self.middle[1] - self.scale[1] * p.y / depth]
    }

    /// Bounding rectangle of a projected box; `None` if the box extends behind the camera.
    fn rectangle(&self, bounds: Aabb, to_world: &DAffine3) -> Option<Rectangle> {
        let corners = corners(bounds);
        let before = |c: &DVec3| -self.world_to_camera.transform_point3(to_world.transform_point3(*c)).z > 0.0;
        (self.orthographic || corners.iter().all(before))
            .then(|| Rectangle::bounding(corners.into_iter().map(|c| self.project(to_world, c.as_vec3()))))
    }
}

/// Condition number of a matrix (Frobenius norm), scaled to 1 for rotation and uniform scale.
fn condition(m: DMat3) -> f64 {
    let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let k = norm(m) * norm(m.inverse()) / 3.0;
    if k.is_finite() { k.max(1.0) } else { f64::INFINITY }
}

fn corners(b: Aabb) -> [DVec3; 8] {
    let pick = |k: usize, axis: usize| (if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] }) as f64;
    std::array::from_fn(|k| DVec3::new(pick(k, 0), pick(k, 1), pick(k, 2)))
}

impl Rectangle {
    fn bounding(points: impl Iterator<Item = [f64; 2]>) -> Self {
        points.fold(Self { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] }, |r, p| Self {
            min: [r.min[0].min(p[0]), r.min[1].min(p[1])],
            max: [r.max[0].max(p[0]), r.max[1].max(p[1])],
        })
    }

    /// Area of the part inside the image, pixels.
    fn clipped_area(&self, size: [u32; 2]) -> f64 {
        let side = |k: usize| (self.max[k].min(size[k] as f64) - self.min[k].max(0.0)).max(0.0);
        side(0) * side(1)
    }
}

struct Marks {
    tiles_x: u32,
    tiles_y: u32,
    live: Vec<AtomicBool>,
}

impl Marks {
    fn mark(&self, r: Rectangle, margin: f64) {
        // a float beyond an integer's range becomes its end
        let first = |x: f64| ((x - margin) / TILE as f64).floor().max(0.0) as u32;
        let end = |x: f64, n: u32| (((x + margin) / TILE as f64).floor() + 1.0).clamp(0.0, n as f64) as u32;
        for y in first(r.min[1])..end(r.max[1], self.tiles_y) {
            for x in first(r.min[0])..end(r.max[0], self.tiles_x) {
                let tile = &self.live[(y * self.tiles_x + x) as usize];
                // most tiles are marked already: a read does not invalidate other cores' cache
                if !tile.load(Ordering::Relaxed) {
                    tile.store(true, Ordering::Relaxed);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Instance, Material, Mesh, Scene, TriangleMesh};

    /// A triangle far from its mesh's origin, twice, brought back and deformed by `matrix`.
    fn brought_back(far: f64, matrix: DMat3) -> Scene {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| (p + DVec3::splat(far)).as_vec3()).to_vec();
        let mesh = TriangleMesh { positions, indices: vec![[0, 1, 2]], ..Default::default() };
        let place = |x: f64| Instance {
            name: String::new(),
            mesh: 0,
            object_to_world: DAffine3 { matrix3: matrix, translation: DVec3::X * x - matrix * DVec3::splat(far) },
        };
        Scene {
            meshes: vec![Mesh { name: String::new(), geometry: Geometry::Triangles(mesh), material: 0, source: None }],
            instances: vec![place(0.0), place(1.5)],
            materials: vec![Material::default()],
            ..Default::default()
        }
    }

    fn view(scene: &Scene) -> Option<View> {
        let flat = FlatScene::new(scene);
        assert_eq!(flat.instances.len(), 2, "the mesh is not baked");
        let camera = Camera::look_at(DVec3::new(1.0, 0.5, 20.0), DVec3::new(1.0, 0.5, 0.0), DVec3::Y, 0.7);
        let camera = CameraRecord::new(&camera, flat.origin, 1.0);
        View::new(&camera, [256, 256], flat.bounds(), &flat.instances)
    }

    #[test]
    fn the_margin_holds_what_instances_transforms_round() {
        let near = view(&brought_back(0.0, DMat3::IDENTITY)).unwrap();
        assert!(near.margin < MIN_MARGIN + 0.01, "{}", near.margin);
        let scene = brought_back(1.0e6, DMat3::IDENTITY);
        let far = view(&scene).unwrap();
        // a ray's origin is rounded by half an ulp, so its hit may be seen beside
        let ulp = (1.0e6f32.next_up() - 1.0e6f32) as f64;
        let to_world = FlatScene::new(&scene).instances[0].to_world;
        let at = |p: DVec3| {
            let p = far.world_to_camera.transform_point3(to_world.transform_point3(p));
            [far.scale[0] * p.x / -p.z, far.scale[1] * p.y / -p.z]
        };
        let corner = DVec3::splat(1.0e6);
        let (exact, off) = (at(corner), at(corner + DVec3::splat(ulp)));
        assert!(far.margin > MIN_MARGIN + (exact[0] - off[0]).abs().max((exact[1] - off[1]).abs()), "{}", far.margin);
        // stretching makes it worse
        let stretch = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.1));
        let stretched = view(&brought_back(1.0e5, stretch)).unwrap().margin;
        assert!(stretched > 2.0 * view(&brought_back(1.0e5, DMat3::IDENTITY)).unwrap().margin, "{stretched}");
        // and where single precision does not resolve the view, nothing is left out
        assert!(view(&brought_back(1.0e9, DMat3::IDENTITY)).is_none());
    }
}
