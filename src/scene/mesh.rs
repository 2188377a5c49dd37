//! Shapes in object space.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3, Vec4};

/// An indexed triangle mesh. All vertex arrays are empty or as long as `positions`.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Object-space positions. All finite.
    pub positions: Vec<Vec3>,
    /// Corners, counter-clockwise seen from the front; every index is below `positions.len()`.
    pub indices: Vec<[u32; 3]>,
    /// Unit shading normals; empty means flat shading by the geometric normal.
    pub normals: Vec<Vec3>,
    /// Unit tangents with handedness in w (glTF convention); empty unless a normal map needs them.
    pub tangents: Vec<Vec4>,
    /// Tangents of the clearcoat's normal map; empty where they are the same.
    pub clearcoat_tangents: Vec<Vec4>,
    /// Tangents of the anisotropy texture; empty where they are the same.
    pub anisotropy_tangents: Vec<Vec4>,
    /// Texture coordinate sets 0 and 1, glTF convention (v down).
    pub texcoords: [Vec<Vec2>; 2],
    /// Texture coordinate sets from 2 on, which few meshes have: those that a material with
    /// textures on more than two sets uses.
    pub more_texcoords: Vec<Vec<Vec2>>,
    /// Linear vertex colours with alpha.
    pub colors: Vec<Vec4>,
}

impl TriangleMesh {
    /// Number of sets of texture coordinates, of which some may be empty.
    pub fn texcoord_sets(&self) -> usize {
        self.texcoords.len() + self.more_texcoords.len()
    }

    /// A set of texture coordinates, empty where the mesh does not have it.
    pub fn texcoord_set(&self, set: usize) -> &[Vec2] {
        let mut sets = self.texcoords.iter().chain(&self.more_texcoords);
        sets.nth(set).map_or(&[], Vec::as_slice)
    }

    /// A set of texture coordinates to be changed, which is made, empty, where the mesh does not
    /// have it.
    pub fn texcoord_set_mut(&mut self, set: usize) -> &mut Vec<Vec2> {
        match set.checked_sub(self.texcoords.len()) {
            None => &mut self.texcoords[set],
            Some(more) => {
                if self.more_texcoords.len() <= more {
                    self.more_texcoords.resize_with(more + 1, Vec::new);
                }
                &mut self.more_texcoords[more]
            }
        }
    }

    /// All sets of texture coordinates, to be changed.
    pub fn texcoord_sets_mut(&mut self) -> impl Iterator<Item = &mut Vec<Vec2>> {
        self.texcoords.iter_mut().chain(&mut self.more_texcoords)
    }
}

/// An analytic sphere in object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, above 0.
    pub radius: f32,
}

impl Sphere {
    /// The texture coordinates of the point with this unit normal, in object space: pbrt's, which
    /// are u = phi / (2 pi), from the x axis around the z axis, and v = 1 - theta / pi; here v goes
    /// down, from 0 at the pole on the z axis. Shaders have theirs in shaders/scene/sphere.glsl.
    pub fn texcoord(normal: Vec3) -> Vec2 {
        let turn = normal.y.atan2(normal.x) / TAU;
        Vec2::new(if turn < 0.0 { turn + 1.0 } else { turn }, normal.z.clamp(-1.0, 1.0).acos() / PI)
    }
}

/// Geometry of a mesh.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nearly all geometry is triangles, and vertices are what takes memory")]
pub enum Geometry {
    /// Indexed triangles.
    Triangles(TriangleMesh),
    /// Analytic spheres.
    Spheres(Vec<Sphere>),
}

impl Geometry {
    /// Object-space bounds `(min, max)`, or `None` when empty. Only corners that a triangle uses
    /// count.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut b: Option<(Vec3, Vec3)> = None;
        let mut add = |lo: Vec3, hi: Vec3| b = Some(b.map_or((lo, hi), |(l, h)| (l.min(lo), h.max(hi))));
        match self {
            Geometry::Triangles(t) => {
                for p in t.indices.iter().flatten().map(|&i| t.positions[i as usize]) {
                    add(p, p);
                }
            }
            Geometry::Spheres(s) => {
                for s in s {
                    add(s.center - s.radius, s.center + s.radius);
                }
            }
        }
        b.map(|(l, h)| (l.as_dvec3(), h.as_dvec3()))
    }

    /// The vertices that triangles use, each once with 0, or the centres of spheres with their
    /// radii.
    pub fn points(&self) -> Vec<Vec4> {
        match self {
            Geometry::Triangles(t) => {
                let mut is_used = vec![false; t.positions.len()];
                t.indices.iter().flatten().for_each(|&i| is_used[i as usize] = true);
                t.positions.iter().zip(is_used).filter(|(_, used)| *used).map(|(p, _)| p.extend(0.0)).collect()
            }
            Geometry::Spheres(spheres) => spheres.iter().map(|s| s.center.extend(s.radius)).collect(),
        }
    }

    /// Number of triangles or spheres.
    pub fn primitive_count(&self) -> usize {
        match self {
            Geometry::Triangles(t) => t.indices.len(),
            Geometry::Spheres(s) => s.len(),
        }
    }
}

/// Geometry with one material (a glTF primitive is one mesh here).
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name in the file; may be empty.
    pub name: String,
    /// Triangles or spheres.
    pub geometry: Geometry,
    /// Index into [`super::Scene::materials`].
    pub material: usize,
    /// Where a glTF file has it; `None` where it comes from elsewhere.
    pub source: Option<MeshSource>,
}

/// A primitive of a glTF file, by the file's own numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshSource {
    /// Index of the mesh.
    pub mesh: usize,
    /// Index of the primitive in the mesh.
    pub primitive: usize,
    /// Index of its material, whatever the variant; `None` for the default material.
    pub material: Option<usize>,
    /// Numbers of the sets of texture coordinates that were read, in the order of
    /// [`TriangleMesh::texcoord_set`].
    pub texcoord_sets: Vec<u32>,
}
