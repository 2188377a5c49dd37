//! Cages: where rays start that find a detailed model around the surfaces of a simple one.

use glam::{DVec3, Vec2};

use super::frames::{SurfaceFrames, SurfacePoint};
use super::plan::triangles_of;
use super::skew::Skew;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators::rays::{Mode, PreparedRays};
use crate::ray::{Hit, Ray};
use crate::scene::Scene;
use crate::tracer::Tracer;

/// Where the surfaces of a detailed model are looked for.
#[derive(Clone, Copy)]
pub enum Cage<'a> {
    /// From this distance of the surface along its shading normal, scene units.
    Distance(f64),
    /// From the surface of this scene, which has the instances and triangles of the baked one
    /// ([`check`]), through the point of the baked surface.
    Model(&'a Scene),
}

/// A detailed model that is traced in place of the scene.
#[derive(Clone, Copy)]
pub struct Detailed<'a> {
    /// The model.
    pub scene: &'a Scene,
    /// Where it is looked for.
    pub cage: Cage<'a>,
    /// Distance behind the surface at which rays end, scene units; `None`: as far as they start in
    /// front of it.
    pub behind: Option<f64>,
    /// How much rays are turned to the geometric normal.
    pub skew: Skew<'a>,
}

impl<'a> Detailed<'a> {
    /// Looks as far behind the surface as in front of it, along the cage's own directions.
    pub fn new(scene: &'a Scene, cage: Cage<'a>) -> Self {
        Self { scene, cage, behind: None, skew: Skew::default() }
    }
}

/// Checks that a cage has the instances and the triangles of a scene.
///
/// # Errors
/// [`Error::Usage`] with what differs.
pub fn check(scene: &Scene, cage: &Scene) -> Result<()> {
    let refused = |what: String| {
        Err(Error::Usage(format!(
            "--cage {}: {what}: a cage is a copy of the model whose vertices are moved outwards, none added or removed",
            cage.name
        )))
    };
    let (own, other) = (scene.instances.len(), cage.instances.len());
    if own != other {
        return refused(format!("has {other} instances, and the model has {own}"));
    }
    for (own, other) in scene.instances.iter().zip(&cage.instances) {
        let (own, other) = (&scene.meshes[own.mesh], &cage.meshes[other.mesh]);
        match (triangles_of(own), triangles_of(other)) {
            (Some(a), Some(b)) if a.indices.len() != b.indices.len() => {
                let [a, b] = [a, b].map(|t| t.indices.len());
                return refused(format!("mesh `{}` has {b} triangles, and that of the model has {a}", own.name));
            }
            (Some(a), Some(b)) if a.indices != b.indices => {
                return refused(format!(
                    "triangles of mesh `{}` join other vertices than those of the model",
                    own.name
                ));
            }
            (None, Some(_)) | (Some(_), None) => {
                return refused(format!("mesh `{}` is one of spheres in one of both alone", own.name));
            }
            _ => {}
        }
    }
    Ok(())
}

/// A point of a simple model from which the surface of a detailed one is looked for.
pub struct SimplePoint {
    /// The point.
    pub surface: SurfacePoint,
    /// Index of its triangle.
    pub triangle: usize,
    /// Barycentric weights of the triangle's second and third vertex.
    pub barycentrics: Vec2,
    /// Instance of the surface.
    pub instance: usize,
    /// Share of the geometric normal in the direction of the ray, from 0 to 1 ([`Skew`]).
    pub skew: f64,
}

/// Finds the points of a detailed model that lie before or behind those of a simple one.
pub struct Projector<'a> {
    detailed: Detailed<'a>,
    /// The meshes of a cage that is a model.
    cage: Vec<Option<SurfaceFrames<'a>>>,
    tracer: &'a Tracer,
    /// Origin of the tracer's scene.
    origin: DVec3,
}

impl<'a> Projector<'a> {
    /// Prepares the cage. `tracer`: of the detailed model, whose scene has this origin.
    pub fn new(detailed: Detailed<'a>, tracer: &'a Tracer, origin: DVec3) -> Self {
        let cage = match detailed.cage {
            Cage::Distance(_) => Vec::new(),
            Cage::Model(scene) => (0..scene.meshes.len()).map(|mesh| SurfaceFrames::of_mesh(scene, mesh)).collect(),
        };
        Self { detailed, cage, tracer, origin }
    }

    /// The skew where there is no map.
    pub fn uniform_skew(&self) -> f64 {
        if let Skew::Uniform(share) = self.detailed.skew { share } else { 0.0 }
    }

    /// The nearest hit of each point's ray.
    ///
    /// # Errors
    /// Those of the device, and of `control`.
    pub fn project(&self, points: &[SimplePoint], control: &mut dyn Control) -> Result<Vec<Hit>> {
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let ray = |point: &SimplePoint| {
            let (start, direction, length) = self.ray(point);
            Ray {
                origin: (start - self.origin).as_vec3().to_array(),
                tmin: 0.0,
                direction: direction.as_vec3().to_array(),
                tmax: length as f32,
            }
        };
        let rays: Vec<Ray> = points.iter().map(ray).collect();
        let mut set = PreparedRays::new(self.tracer, &rays, Mode::Closest)?;
        set.pass(control)?;
        set.hits()
    }

    /// The point where the ray of a point starts, its direction, which has unit length, and its
    /// length. It goes through the point, from as far as the cage is.
    fn ray(&self, point: &SimplePoint) -> (DVec3, DVec3, f64) {
        let SurfacePoint { world, geometric, frame } = point.surface;
        let (averaged, distance) = match self.detailed.cage {
            Cage::Distance(distance) => (frame.z_axis, distance),
            Cage::Model(scene) => {
                let frames = self.cage[scene.instances[point.instance].mesh].as_ref();
                let start = frames.map_or(world, |f| f.at(point.triangle, point.barycentrics, point.instance).world);
                ((start - world).normalize_or(frame.z_axis), start.distance(world))
            }
        };
        // a cage may lie behind the surface
        let straight = if averaged.dot(geometric) < 0.0 { -geometric } else { geometric };
        let outward = averaged.lerp(straight, point.skew).normalize_or(averaged);
        (world + distance * outward, -outward, distance + self.detailed.behind.unwrap_or(distance))
    }
}
