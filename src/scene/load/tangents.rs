//! Tangents by MikkTSpace, the space that normal maps are baked in. <http://www.mikktspace.com>

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};

use super::normals;
use crate::scene::TriangleMesh;

/// Brings the file's tangents to unit length with a handedness of -1 or 1. False when there are none, or unusable ones.
pub(super) fn normalize(mesh: &mut TriangleMesh) -> bool {
    for t in &mut mesh.tangents {
        let Some(direction) = t.truncate().as_dvec3().try_normalize() else { return false };
        if (t.truncate().length_squared() - 1.0).abs() > 1e-5 {
            *t = direction.as_vec3().extend(t.w);
        }
        t.w = if t.w < 0.0 { -1.0 } else { 1.0 };
    }
    !mesh.tangents.is_empty() && !mesh.normals.is_empty()
}

/// Computes tangents from set `set` of the texture coordinates, or from the other set where that one is empty or the same everywhere. Where neither
/// has a gradient, tangents are [`horizontal`]. Vertices whose triangles disagree are split; a mesh without normals becomes explicitly flat. Returns which vertex each vertex
/// was before.
pub(super) fn compute(mesh: &mut TriangleMesh, set: usize) -> Vec<u32> {
    let mut source: Vec<u32> = match mesh.normals.is_empty() {
        true => mesh.indices.iter().flatten().copied().collect(),
        false => (0..mesh.positions.len() as u32).collect(),
    };
    if mesh.normals.is_empty() {
        normals::make_flat(mesh);
    }
    let set = [set, 1 - set].into_iter().find(|&s| varies(&mesh.texcoords[s]));
    let mut corners = Corners { mesh, set: set.unwrap_or(0), tangents: vec![Vec4::ZERO; mesh.indices.len() * 3] };
    // its error type has no values
    let made = set.is_some() && generate_tangents(&mut corners).is_ok();
    let mut tangents = corners.tangents;
    for (corner, tangent) in tangents.iter_mut().enumerate() {
        let normal = mesh.normals[mesh.indices[corner / 3][corner % 3] as usize];
        // without a gradient MikkTSpace gives the x axis, whatever the normal
        let has_gradient = made
            && tangent.is_finite()
            && tangent.truncate().length_squared() > 0.5
            && tangent.truncate().dot(normal).abs() < 0.01;
        if !has_gradient {
            *tangent = horizontal(normal);
        }
    }
    for original in weld(mesh, &tangents) {
        source.push(source[original as usize]);
    }
    source
}

/// Texture coordinates that are not all the same.
pub(super) fn varies(texcoords: &[Vec2]) -> bool {
    texcoords.windows(2).any(|w| w[0] != w[1])
}

/// The tangent of a surface without texture coordinates: around the y axis of the mesh, as the lines of latitude of a globe run; along x at the poles.
fn horizontal(normal: Vec3) -> Vec4 {
    let t = Vec3::new(normal.z, 0.0, -normal.x);
    if t.length_squared() > 1e-6 { t.normalize().extend(1.0) } else { Vec4::new(1.0, 0.0, 0.0, 1.0) }
}

struct Corners<'a> {
    mesh: &'a TriangleMesh,
    set: usize,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.indices.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, vert)].into()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, vert)].into()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        // glTF's v points down, the algorithm's up; the sign of the bitangent depends on it
        let uv = self.mesh.texcoords[self.set][self.vertex(face, vert)];
        [uv.x, 1.0 - uv.y]
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(space) = tangent_space {
            self.tangents[3 * face + vert] = space.tangent_encoded().into();
        }
    }
}

/// Gives each vertex the tangent of its corners (three per triangle), with a copy of the vertex for each other tangent.
/// Returns what each copy is one of.
fn weld(mesh: &mut TriangleMesh, corners: &[Vec4]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let mut tangents = vec![Vec4::ZERO; mesh.positions.len()];
    let mut taken = vec![false; mesh.positions.len()];
    // chains of copies: next[v] is another copy of the vertex that v copies
    let mut next = vec![NONE; mesh.positions.len()];
    let mut copies: Vec<u32> = Vec::new();
    for (index, &tangent) in mesh.indices.iter_mut().flatten().zip(corners) {
        let mut v = *index as usize;
        while taken[v] && (tangents[v] - tangent).abs().max_element() > 1e-5 && next[v] != NONE {
            v = next[v] as usize;
        }
        if !taken[v] {
            (taken[v], tangents[v]) = (true, tangent);
        } else if (tangents[v] - tangent).abs().max_element() > 1e-5 {
            let copy = tangents.len();
            next[v] = copy as u32;
            copies.push(*index);
            tangents.push(tangent);
            taken.push(true);
            next.push(NONE);
            v = copy;
        }
        *index = v as u32;
    }
    fn extend<T: Copy>(values: &mut Vec<T>, copies: &[u32]) {
        if !values.is_empty() {
            for &original in copies {
                values.push(values[original as usize]);
            }
        }
    }
    extend(&mut mesh.positions, &copies);
    extend(&mut mesh.normals, &copies);
    extend(&mut mesh.colors, &copies);
    for set in &mut mesh.texcoords {
        extend(set, &copies);
    }
    // vertices that no triangle uses
    for (tangent, normal) in tangents.iter_mut().zip(&mesh.normals).filter(|(t, _)| t.w == 0.0) {
        *tangent = horizontal(*normal);
    }
    mesh.tangents = tangents;
    copies
}
