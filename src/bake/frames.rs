//! Points of surfaces on the host: where they are, and their normals and tangents.

use glam::{DMat3, DVec3, Vec2, Vec3, Vec4};

use super::plan::{Surface, triangles_of};
use super::texels::TexelPoint;
use crate::scene::load::tangents_of_corners;
use crate::scene::{Scene, TriangleMesh};

/// A surface's vertices, ready for points on it.
pub struct SurfaceFrames<'s> {
    scene: &'s Scene,
    mesh: &'s TriangleMesh,
    /// Tangents at the corners of each triangle; empty unless they are needed.
    tangents: Vec<Vec4>,
}

/// A point of an instance's surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position in world space.
    pub world: DVec3,
    /// Unit geometric normal of the front, world space.
    pub geometric: DVec3,
    /// Unit tangent, bitangent and shading normal, world space.
    pub frame: DMat3,
}

impl<'s> SurfaceFrames<'s> {
    /// `None` for a mesh of spheres. `tangents`: whether points need them.
    pub fn new(scene: &'s Scene, surface: &Surface, tangents: bool) -> Option<Self> {
        let mesh = triangles_of(&scene.meshes[surface.mesh])?;
        let tangents = if tangents { tangents_of_corners(mesh, &surface.corners) } else { Vec::new() };
        Some(Self { scene, mesh, tangents })
    }

    /// A mesh without tangents; `None` for spheres.
    pub fn of_mesh(scene: &'s Scene, mesh: usize) -> Option<Self> {
        Some(Self { scene, mesh: triangles_of(&scene.meshes[mesh])?, tangents: Vec::new() })
    }

    /// The surface point of a texel, on an instance of the scene.
    pub fn point(&self, point: &TexelPoint, instance: usize) -> SurfacePoint {
        self.at(point.triangle as usize, point.barycentrics, instance)
    }

    /// The point of a triangle with these weights of its second and third vertex.
    pub fn at(&self, triangle: usize, barycentrics: Vec2, instance: usize) -> SurfacePoint {
        let to_world = &self.scene.instances[instance].object_to_world;
        let corners = self.mesh.indices[triangle].map(|v| v as usize);
        let weights = [1.0 - barycentrics.x - barycentrics.y, barycentrics.x, barycentrics.y].map(f64::from);
        let mixed = |values: [Vec3; 3]| values.iter().zip(weights).map(|(v, w)| w * v.as_dvec3()).sum::<DVec3>();

        // geometry, the front on the side from which corners are counter-clockwise
        let [a, b, c] = corners.map(|v| self.mesh.positions[v].as_dvec3());
        let normals_to_world = to_world.matrix3.inverse().transpose();
        let object = mixed(corners.map(|v| self.mesh.positions[v]));
        let flat = (b - a).cross(c - a);
        let geometric = (normals_to_world * flat).normalize_or(DVec3::Z);

        // the shading normal is on the same side
        let smooth = if self.mesh.normals.is_empty() { flat } else { mixed(corners.map(|v| self.mesh.normals[v])) };
        let object_normal = smooth.normalize_or(DVec3::Z);
        let normal = (normals_to_world * object_normal).normalize_or(geometric);
        let normal = if normal.dot(geometric) < 0.0 { -normal } else { normal };

        // tangents, by Gram and Schmidt
        let at_corner = |k: usize| self.tangents.get(3 * triangle + k).copied().unwrap_or(Vec4::X);
        let tangent = to_world.matrix3 * mixed([0, 1, 2].map(|k| at_corner(k).truncate()));
        let tangent = (tangent - normal * normal.dot(tangent)).normalize_or(normal.any_orthonormal_vector());
        let mirrors = if to_world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let bitangent = f64::from(at_corner(0).w) * mirrors * normal.cross(tangent);
        SurfacePoint {
            world: to_world.transform_point3(object),
            geometric,
            frame: DMat3::from_cols(tangent, bitangent, normal),
        }
    }
}
