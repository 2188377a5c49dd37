//! Deformation of meshes: morph targets first, then skinning.

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use crate::scene::TriangleMesh;

/// Joints and weights: four for each vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    /// Indices into [`super::Skin::joints`].
    pub joints: Vec<[u16; 4]>,
    /// Weights of the joints, at least zero; they are normalized by the sum over all sets.
    pub weights: Vec<[f32; 4]>,
}

/// A morph target: differences to the mesh at weight one. Each array is empty (all zero) or has one
/// element per vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Displacements of positions.
    pub positions: Vec<Vec3>,
    /// Differences of normals.
    pub normals: Vec<Vec3>,
}

/// The deformation of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// Index into [`crate::scene::Scene::meshes`].
    pub mesh: usize,
    /// Index into [`super::RigParts::nodes`] of the node of the mesh, which has the weights of its
    /// morph targets. The node's transform does not apply to a skinned mesh.
    pub node: usize,
    /// Index into [`super::RigParts::skins`].
    pub skin: Option<usize>,
    /// Joints and weights, one set or two; empty without a skin.
    pub influences: Vec<Influences>,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
}

/// Vertices of a mesh, undeformed or posed. Normals and tangents may be empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexData {
    /// Positions in object space.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents, handedness in w: those of normal maps, and those of clearcoats and of
    /// anisotropy where they differ.
    pub tangents: [Vec<Vec4>; 3],
}

impl VertexData {
    /// Takes the vertices out of a mesh.
    pub(in crate::scene) fn take(mesh: &mut TriangleMesh) -> Self {
        let TriangleMesh { positions, normals, tangents, clearcoat_tangents, anisotropy_tangents, .. } = mesh;
        let (positions, normals) = (std::mem::take(positions), std::mem::take(normals));
        Self { positions, normals, tangents: [tangents, clearcoat_tangents, anisotropy_tangents].map(std::mem::take) }
    }

    /// Puts the vertices into a mesh.
    pub(in crate::scene) fn give(self, mesh: &mut TriangleMesh) {
        (mesh.positions, mesh.normals) = (self.positions, self.normals);
        [mesh.tangents, mesh.clearcoat_tangents, mesh.anisotropy_tangents] = self.tangents;
    }
}

impl Deformation {
    /// Whether two vertices move together in every pose.
    fn alike(&self, a: usize, b: usize) -> bool {
        self.influences.iter().all(|s| s.joints[a] == s.joints[b] && s.weights[a] == s.weights[b])
            && self.targets.iter().all(|t| t.positions.is_empty() || t.positions[a] == t.positions[b])
    }

    /// Whether a triangle that is degenerate in the undeformed mesh is degenerate in every pose:
    /// only if two of its corners coincide and move together, or all three lie on a line and move
    /// together.
    pub(in crate::scene) fn stays_flat(&self, triangle: [u32; 3], positions: &[Vec3]) -> bool {
        let [a, b, c] = triangle.map(|i| i as usize);
        let same = |a: usize, b: usize| a == b || (positions[a] == positions[b] && self.alike(a, b));
        same(a, b) || same(b, c) || same(c, a) || (self.alike(a, b) && self.alike(b, c))
    }

    /// Largest extent of the mesh, undeformed or with one morph target at weight one.
    pub(super) fn extent(&self, base: &VertexData) -> f64 {
        let size = |target: Option<&MorphTarget>| {
            let points = base.positions.iter().enumerate().map(|(v, p)| {
                let moved = target.and_then(|t| t.positions.get(v)).copied().unwrap_or_default();
                p.as_dvec3() + moved.as_dvec3()
            });
            let bounds =
                points.fold(None, |b: Option<(DVec3, DVec3)>, p| Some(b.map_or((p, p), |(l, h)| (l.min(p), h.max(p)))));
            bounds.map_or(0.0, |(lo, hi)| (hi - lo).max_element())
        };
        self.targets.iter().map(|t| size(Some(t))).fold(size(None), f64::max)
    }

    /// Reorders, drops or copies per-vertex data: the new vertex `i` is the old vertex `source[i]`.
    pub(in crate::scene) fn reorder(&mut self, source: &[u32]) {
        fn pick<T: Copy>(values: &mut Vec<T>, source: &[u32]) {
            if !values.is_empty() {
                *values = source.iter().map(|&i| values[i as usize]).collect();
            }
        }
        for set in &mut self.influences {
            pick(&mut set.joints, source);
            pick(&mut set.weights, source);
        }
        for target in &mut self.targets {
            pick(&mut target.positions, source);
            pick(&mut target.normals, source);
        }
    }

    /// Poses `base` into `out`, whose buffers are reused. `weights`: weights of the morph targets;
    /// `joints`: joint matrices of the skin; `tangents`: whether to pose tangents.
    pub(in crate::scene) fn pose(
        &self,
        base: &VertexData,
        weights: &[f64],
        joints: &[DAffine3],
        tangents: bool,
        out: &mut VertexData,
    ) {
        let active: Vec<(&MorphTarget, f64)> =
            self.targets.iter().zip(weights.iter().copied()).filter(|(_, w)| *w != 0.0).collect();

        // a vertex is moved by morph targets first, then by joints
        let matrix = |v: usize| self.matrix(v, joints);
        let position = |v: usize, m: &DAffine3| {
            let moved = active.iter().filter_map(|(t, w)| Some(t.positions.get(v)?.as_dvec3() * *w));
            m.transform_point3(base.positions[v].as_dvec3() + moved.sum::<DVec3>()).as_vec3()
        };
        let normal = |v: usize, m: &DAffine3| {
            let turned = active.iter().filter_map(|(t, w)| Some(t.normals.get(v)?.as_dvec3() * *w));
            let n = cofactor(&m.matrix3) * (base.normals[v].as_dvec3() + turned.sum::<DVec3>());
            // a normal that targets or a collapsed joint make zero keeps its undeformed direction
            n.try_normalize().map_or(base.normals[v], |n| n.as_vec3())
        };

        // positions and normals in parallel
        let count = base.positions.len();
        if base.normals.is_empty() {
            out.normals.clear();
            (0..count)
                .into_par_iter()
                .with_min_len(BLOCK)
                .map(|v| position(v, &matrix(v)))
                .collect_into_vec(&mut out.positions);
        } else {
            let both = (0..count).into_par_iter().with_min_len(BLOCK).map(|v| {
                let m = matrix(v);
                (position(v, &m), normal(v, &m))
            });
            both.unzip_into_vecs(&mut out.positions, &mut out.normals);
        }

        // tangents only at rest: tracers turn them with the normals
        for (out, base) in out.tangents.iter_mut().zip(&base.tangents) {
            out.clear();
            if tangents {
                out.extend(base.iter().enumerate().map(|(v, t)| {
                    let turned = matrix(v).transform_vector3(t.truncate().as_dvec3()).try_normalize();
                    turned.map_or(*t, |d| d.as_vec3().extend(t.w))
                }));
            }
        }
    }

    /// The skinning matrix of a vertex: the weighted mean of its joint matrices.
    fn matrix(&self, vertex: usize, joints: &[DAffine3]) -> DAffine3 {
        if self.skin.is_none() {
            return DAffine3::IDENTITY;
        }
        let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut total = 0.0;
        for set in &self.influences {
            for (&joint, &weight) in set.joints[vertex].iter().zip(&set.weights[vertex]) {
                if weight > 0.0
                    && let Some(m) = joints.get(joint as usize)
                {
                    let w = f64::from(weight);
                    sum.matrix3 += m.matrix3 * w;
                    sum.translation += m.translation * w;
                    total += w;
                }
            }
        }
        if total > 0.0 {
            return DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total };
        }
        // the specification forbids a vertex without weights; it follows its first joint
        let first = self.influences.first().map_or(0, |s| s.joints[vertex][0]);
        joints.get(first as usize).copied().unwrap_or(DAffine3::IDENTITY)
    }
}

/// Minimum number of vertices per parallel task.
const BLOCK: usize = 2048;

/// The cofactor matrix, which transforms normals: the inverse transpose up to a positive factor,
/// and defined for every `m`.
fn cofactor(m: &DMat3) -> DMat3 {
    let c = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { c * -1.0 } else { c }
}
