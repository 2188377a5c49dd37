//! Tangents by MikkTSpace, the space that normal maps are baked in. <http://www.mikktspace.com>

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Affine2, Vec2, Vec3, Vec4};

use super::normals;
use crate::scene::{Material, TextureSlot, TriangleMesh};

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

/// Textures whose values are directions, in the order of [`TriangleMesh`]'s tangents: the one that the mesh's tangents are those of, and that of the clearcoat and that of anisotropy
/// where they lie differently.
fn textures(material: &Material) -> (Option<TextureSlot>, [Option<TextureSlot>; 2]) {
    let clearcoat = material.clearcoat.normal_texture.filter(|_| material.clearcoat.factor > 0.0);
    let anisotropy = material.anisotropy.texture.filter(|_| material.anisotropy.strength > 0.0);
    // without a texture of its own anisotropy follows the normal map
    let first = material.normal_texture.or(material.clearcoat.normal_texture).or(material.anisotropy.texture);
    (first, [clearcoat, anisotropy].map(|slot| slot.filter(|s| first.is_some_and(|f| !lie_alike(&f, s)))))
}

/// Whether the tangents of two textures are the same: their coordinates differ by scales of u and v above zero, and by where they begin.
fn lie_alike(a: &TextureSlot, b: &TextureSlot) -> bool {
    let between = b.transform.matrix2 * a.transform.matrix2.inverse();
    let (x, y) = (between.x_axis, between.y_axis);
    let is_scale = x.x > 0.0 && y.y > 0.0 && x.y.abs().max(y.x.abs()) <= 1e-5 * x.x.min(y.y);
    a.texcoord == b.texcoord && (is_scale || a.transform.matrix2 == b.transform.matrix2)
}

/// Computes tangents for the textures of a material ([`corner_tangents`]). Vertices whose triangles disagree are split; a mesh without normals becomes explicitly flat. Returns which
/// vertex each vertex was before.
pub(super) fn compute(mesh: &mut TriangleMesh, material: &Material) -> Vec<u32> {
    let mut source: Vec<u32> = match mesh.normals.is_empty() {
        true => mesh.indices.iter().flatten().copied().collect(),
        false => (0..mesh.positions.len() as u32).collect(),
    };
    if mesh.normals.is_empty() {
        normals::make_flat(mesh);
    }
    let (first, others) = textures(material);
    let first = corner_tangents(mesh, first);
    let [clearcoat, anisotropy] = others.map(|slot| slot.map_or_else(Vec::new, |slot| corner_tangents(mesh, Some(slot))));
    for original in weld(mesh, [&first, &clearcoat, &anisotropy]) {
        source.push(source[original as usize]);
    }
    source
}

/// The tangent at each corner of each triangle, from the texture coordinates of a texture, transformed as the texture's are: what a map says about right and up is of its own image.
/// Where these are the same everywhere, or there is no texture, from the first set that is not. Where none has a gradient, tangents are [`horizontal`].
fn corner_tangents(mesh: &TriangleMesh, texture: Option<TextureSlot>) -> Vec<Vec4> {
    let own = texture.map(|t| (t.texcoord, t.transform)).filter(|(_, transform)| transform.matrix2.determinant() != 0.0);
    let candidates = own.into_iter().chain([0, 1].map(|set| (set, Affine2::IDENTITY)));
    let chosen = candidates.into_iter().find(|(set, _)| varies(&mesh.texcoords[*set]));
    let (set, transform) = chosen.unwrap_or_default();
    let mut corners = Corners { mesh, set, transform, tangents: vec![Vec4::ZERO; mesh.indices.len() * 3] };
    // its error type has no values
    let made = chosen.is_some() && generate_tangents(&mut corners).is_ok();
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
    tangents
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
    /// Applied to the coordinates of the set.
    transform: Affine2,
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
        let uv = self.transform.transform_point2(self.mesh.texcoords[self.set][self.vertex(face, vert)]);
        [uv.x, 1.0 - uv.y]
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(space) = tangent_space {
            self.tangents[3 * face + vert] = space.tangent_encoded().into();
        }
    }
}

/// Gives each vertex the tangents of its corners (three per triangle, for each array that is not empty), with a copy of the vertex for each other tangents.
/// Returns what each copy is one of.
fn weld(mesh: &mut TriangleMesh, corners: [&[Vec4]; 3]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    type Tangents = [Vec4; 3];
    let at = |corner: usize| corners.map(|c| c.get(corner).copied().unwrap_or_default());
    let differ = |a: &Tangents, b: &Tangents| a.iter().zip(b).any(|(a, b)| (*a - *b).abs().max_element() > 1e-5);
    let mut tangents: Vec<Tangents> = vec![Tangents::default(); mesh.positions.len()];
    let mut taken = vec![false; mesh.positions.len()];
    // chains of copies: next[v] is another copy of the vertex that v copies
    let mut next = vec![NONE; mesh.positions.len()];
    let mut copies: Vec<u32> = Vec::new();
    for (corner, index) in mesh.indices.iter_mut().flatten().enumerate() {
        let tangent = at(corner);
        let mut v = *index as usize;
        while taken[v] && differ(&tangents[v], &tangent) && next[v] != NONE {
            v = next[v] as usize;
        }
        if !taken[v] {
            (taken[v], tangents[v]) = (true, tangent);
        } else if differ(&tangents[v], &tangent) {
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
    for ((tangents, normal), _) in tangents.iter_mut().zip(&mesh.normals).zip(&taken).filter(|(_, taken)| !**taken) {
        *tangents = [horizontal(*normal); 3];
    }
    let array = |k: usize| match corners[k].is_empty() {
        true => Vec::new(),
        false => tangents.iter().map(|t| t[k]).collect(),
    };
    (mesh.tangents, mesh.clearcoat_tangents, mesh.anisotropy_tangents) = (array(0), array(1), array(2));
    copies
}
