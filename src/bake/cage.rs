//! Cages: where rays start that find a detailed model around the surfaces of a simple one.

use glam::DVec3;

use super::frames::{SurfaceFrames, SurfacePoint};
use super::plan::triangles_of;
use super::texels::TexelPoint;
use crate::error::{Error, Result};
use crate::scene::Scene;

/// Where the surfaces of a detailed model are looked for.
#[derive(Clone, Copy)]
pub enum Cage<'a> {
    /// Within this distance of the surface along its shading normal, on both sides; scene units.
    Distance(f64),
    /// From the surface of this scene, which has the instances and triangles of the baked one,
    /// through the point of the baked surface and as far behind it ([`check`]).
    Model(&'a Scene),
}

/// A detailed model that is traced in place of the scene.
#[derive(Clone, Copy)]
pub struct Detailed<'a> {
    /// The model.
    pub scene: &'a Scene,
    /// Where it is looked for.
    pub cage: Cage<'a>,
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

/// The meshes of a cage, ready for points on them.
pub struct CageFrames<'a> {
    cage: Cage<'a>,
    meshes: Vec<Option<SurfaceFrames<'a>>>,
}

impl<'a> CageFrames<'a> {
    /// Prepares a cage.
    pub fn new(cage: Cage<'a>) -> Self {
        let meshes = match cage {
            Cage::Distance(_) => Vec::new(),
            Cage::Model(scene) => (0..scene.meshes.len()).map(|mesh| SurfaceFrames::of_mesh(scene, mesh)).collect(),
        };
        Self { cage, meshes }
    }

    /// The point where the ray of a texel's point starts, its direction, which has unit length, and
    /// its length; `surface`: the point itself.
    pub fn ray(&self, surface: &SurfacePoint, point: &TexelPoint, instance: usize) -> (DVec3, DVec3, f64) {
        let normal = surface.frame.z_axis;
        match self.cage {
            Cage::Distance(distance) => (surface.world + distance * normal, -normal, 2.0 * distance),
            Cage::Model(scene) => {
                let frames = self.meshes[scene.instances[instance].mesh].as_ref();
                let start = frames.map_or(surface.world, |frames| frames.point(point, instance).world);
                let (inward, distance) = (surface.world - start, surface.world.distance(start));
                (start, inward.normalize_or(-normal), 2.0 * distance)
            }
        }
    }
}
