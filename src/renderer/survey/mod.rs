//! A survey of a scene: a few thousand rays choose the camera, the AO radius and the light.

pub mod framing;
pub mod light;
pub mod own_light;
pub mod radius;
pub mod rays;

use std::sync::OnceLock;

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::oracle::{Oracle, OracleRay};
use crate::scene::{Geometry, Scene};
use rays::visible_surfaces;

/// The surface that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibleSurface {
    /// Distance, scene units.
    pub distance: f64,
    /// Whether it is the front of the surface.
    pub is_front: bool,
    /// Unit normal on the side that is seen, world space.
    pub normal: DVec3,
    /// Index into [`Scene::materials`].
    pub material: usize,
}

/// Finds what rays see, which are given as origins and unit directions.
pub type Trace<'a> = dyn Fn(&[(DVec3, DVec3)]) -> Result<Vec<Option<VisibleSurface>>> + 'a;

/// Scenes with more primitives are not surveyed on the host: a hierarchy would take too long.
const MAX_PRIMITIVES: u64 = 5_000_000;
/// With more primitives, building a hierarchy takes longer than the rays of a survey: it is built
/// quickly. With fewer, rooms above all, one that suits the rays is worth its time.
const MANY_PRIMITIVES: u64 = 400_000;

/// A scene to be looked at by rays that are traced on the host, in double precision.
pub struct Survey<'s> {
    scene: &'s Scene,
    bounds: Option<(DVec3, DVec3)>,
    /// Built for the first rays.
    oracle: OnceLock<Oracle>,
}

impl<'s> Survey<'s> {
    /// Prepares rays through a scene; nothing is built yet.
    pub fn new(scene: &'s Scene) -> Self {
        Self { scene, bounds: scene.bounds(), oracle: OnceLock::new() }
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// The scene's bounds, world space.
    ///
    /// # Errors
    /// [`Error::Scene`] for a scene without geometry.
    pub fn bounds(&self) -> Result<(DVec3, DVec3)> {
        self.bounds.ok_or_else(|| Error::Scene("the scene has no geometry to render".into()))
    }

    /// Length of the diagonal of the scene's bounds, scene units; 0 without geometry.
    pub fn diagonal(&self) -> f64 {
        self.bounds.map_or(0.0, |(lo, hi)| (hi - lo).length())
    }

    /// Whether the scene is small enough for rays.
    pub fn is_small(&self) -> bool {
        self.primitive_count() <= MAX_PRIMITIVES
    }

    fn primitive_count(&self) -> u64 {
        self.scene.triangle_count() + self.scene.sphere_count()
    }

    /// Finds the surfaces that rays hit, without any error.
    pub fn trace(&self, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<VisibleSurface>>> {
        let origin = self.scene.origin();
        let is_large = self.primitive_count() > MANY_PRIMITIVES;
        let build = if is_large { Oracle::for_few_rays } else { Oracle::new };
        let oracle = self.oracle.get_or_init(|| build(self.scene, origin));
        let closest = |&(from, direction): &(DVec3, DVec3)| {
            let ray = OracleRay { origin: from - origin, tmin: 0.0, direction, tmax: f64::INFINITY };
            let hit = oracle.closest(ray);
            hit.is_hit().then(|| hit.to_hit())
        };
        Ok(visible_surfaces(self.scene, rays, rays.par_iter().map(closest).collect()))
    }

    /// Distance in scene units, infinite for none, of the nearest surface in each direction from a
    /// point, and whether it is a front: by all triangles, without a hierarchy or spheres.
    pub fn nearest<const N: usize>(&self, eye: DVec3, directions: [DVec3; N]) -> [(f64, bool); N] {
        let scene = self.scene;
        let nearest = scene.instances.par_iter().map(|instance| {
            let mut nearest = [(f64::INFINITY, false); N];
            let Geometry::Triangles(mesh) = &scene.meshes[instance.mesh].geometry else { return nearest };
            let points: Vec<DVec3> =
                mesh.positions.iter().map(|p| instance.object_to_world.transform_point3(p.as_dvec3()) - eye).collect();
            let turned = instance.object_to_world.matrix3.determinant().signum();
            for triangle in &mesh.indices {
                let [a, b, c] = triangle.map(|i| points[i as usize]);
                let normal = (b - a).cross(c - a) * turned;
                for (direction, nearest) in directions.iter().zip(&mut nearest) {
                    let facing = normal.dot(*direction);
                    let t = normal.dot(a) / facing;
                    if !(t > 0.0 && t < nearest.0) {
                        continue;
                    }
                    // on the inner side of all three edges
                    let p = *direction * t;
                    let side = |u: DVec3, v: DVec3| (v - u).cross(p - u).dot(normal) * turned >= 0.0;
                    if side(a, b) && side(b, c) && side(c, a) {
                        *nearest = (t, facing < 0.0);
                    }
                }
            }
            nearest
        });
        let none = || [(f64::INFINITY, false); N];
        nearest.reduce(none, |a, b| std::array::from_fn(|k| if b[k].0 < a[k].0 { b[k] } else { a[k] }))
    }

    /// Distances of the nearest surfaces around a point of a closed room or solid body, or `None`.
    pub fn walls(&self, eye: DVec3) -> Option<[f64; WALL_DIRECTIONS]> {
        // most places that are open are open outside, or to the sky
        let (lo, hi) = self.bounds?;
        let upwards = [sphere_directions()[0]];
        if eye.cmplt(lo).any() || eye.cmpgt(hi).any() || self.nearest(eye, upwards)[0].0 == f64::INFINITY {
            return None;
        }
        let distances = self.nearest(eye, sphere_directions()).map(|(distance, _)| distance);
        distances.iter().all(|d| d.is_finite()).then_some(distances)
    }
}

/// A number with so many significant digits: what is chosen is what is printed.
pub fn significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// Number of directions of [`Survey::walls`].
pub const WALL_DIRECTIONS: usize = 16;

/// Directions that cover the sphere evenly (a Fibonacci lattice); the first is upwards.
fn sphere_directions() -> [DVec3; WALL_DIRECTIONS] {
    std::array::from_fn(|k| {
        let y = 1.0 - 2.0 * k as f64 / (WALL_DIRECTIONS - 1) as f64;
        let (sin, cos) = (2.399_963_229_728_653 * k as f64).sin_cos();
        let radius = (1.0 - y * y).max(0.0).sqrt();
        // no direction lies within a wall of a scene that is made of boxes, or on its edges
        (DVec3::new(radius * cos, y, radius * sin) + DVec3::new(0.013, 0.007, 0.019)).normalize()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_rooms_have_walls_all_around() {
        for (name, closed) in [("closed-box", true), ("cornell-box", false), ("stairs", false)] {
            let scene = crate::scene::builtin::by_name(name).unwrap();
            let survey = Survey::new(&scene);
            let (lo, hi) = survey.bounds().unwrap();
            let middle = (lo + hi) * 0.5;
            let walls = survey.walls(middle);
            assert_eq!(walls.is_some(), closed, "{name}");
            assert!(walls.into_iter().flatten().all(|d| d > 0.0 && d < survey.diagonal()));
            // as the hierarchy finds them
            let rays = sphere_directions().map(|d| (middle, d));
            let traced = survey.trace(&rays).unwrap();
            let distance = |v: &Option<VisibleSurface>| v.map_or(f64::INFINITY, |v| v.distance);
            if scene.sphere_count() == 0 {
                for (a, b) in survey.nearest(middle, sphere_directions()).iter().zip(&traced) {
                    let b = distance(b);
                    assert!(a.0 == b || (a.0 / b - 1.0).abs() < 1e-5, "{name}: {} {b}", a.0);
                }
            }
        }
        assert!(Survey::new(&Scene::default()).bounds().is_err());
    }
}
