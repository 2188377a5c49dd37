//! Tangents by MikkTSpace, the space that normal maps are baked in. <http://www.mikktspace.com>

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Affine2, Vec2, Vec3, Vec4};

use super::normals;
use crate::scene::{Material, TextureSlot, TriangleMesh};

/// Brings the file's tangents to unit length with a handedness of -1 or 1. False when there are
/// none, or unusable ones.
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

/// Textures whose values are directions, in the order of [`TriangleMesh`]'s tangents: the one that
/// the mesh's tangents are those of, and that of the clearcoat and that of anisotropy where they
/// lie differently.
fn textures(material: &Material) -> (Option<TextureSlot>, [Option<TextureSlot>; 2]) {
    let clearcoat = material.clearcoat.normal_texture.filter(|_| material.clearcoat.factor > 0.0);
    let anisotropy = material.anisotropy.texture.filter(|_| material.anisotropy.strength > 0.0);
    // without a texture of its own anisotropy follows the normal map
    let first = material.normal_texture.or(material.clearcoat.normal_texture).or(material.anisotropy.texture);
    (first, [clearcoat, anisotropy].map(|slot| slot.filter(|s| first.is_some_and(|f| !lie_alike(&f, s)))))
}

/// Whether the tangents of two textures are the same: their coordinates differ by scales of u and v
/// above zero, and by where they begin.
fn lie_alike(a: &TextureSlot, b: &TextureSlot) -> bool {
    let between = b.transform.matrix2 * a.transform.matrix2.inverse();
    let (x, y) = (between.x_axis, between.y_axis);
    let is_scale = x.x > 0.0 && y.y > 0.0 && x.y.abs().max(y.x.abs()) <= 1e-5 * x.x.min(y.y);
    a.texcoord == b.texcoord && (is_scale || a.transform.matrix2 == b.transform.matrix2)
}

/// Computes tangents for the textures of a material ([`corner_tangents`]). Vertices whose triangles
/// disagree are split; a mesh without normals becomes explicitly flat. Returns which vertex each
/// vertex was before.
pub(super) fn compute(mesh: &mut TriangleMesh, material: &Material) -> Vec<u32> {
    let mut source: Vec<u32> = if mesh.normals.is_empty() {
        mesh.indices.iter().flatten().copied().collect()
    } else {
        (0..mesh.positions.len() as u32).collect()
    };
    if mesh.normals.is_empty() {
        normals::make_flat(mesh);
    }
    let (first, others) = textures(material);
    let first = corner_tangents(mesh, first);
    let [clearcoat, anisotropy] =
        others.map(|slot| slot.map_or_else(Vec::new, |slot| corner_tangents(mesh, Some(slot))));
    for original in weld(mesh, [&first, &clearcoat, &anisotropy]) {
        source.push(source[original as usize]);
    }
    source
}

/// The tangent at each corner of each triangle for these texture coordinates of the corners: unit
/// length, with the handedness in w.
pub fn tangents_of_corners(mesh: &TriangleMesh, corners: &[[Vec2; 3]]) -> Vec<Vec4> {
    let vertices: Vec<usize> = mesh.indices.iter().flatten().map(|&v| v as usize).collect();
    let mut apart = TriangleMesh {
        positions: vertices.iter().map(|&v| mesh.positions[v]).collect(),
        indices: (0..mesh.indices.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        normals: if mesh.normals.is_empty() { Vec::new() } else { vertices.iter().map(|&v| mesh.normals[v]).collect() },
        ..TriangleMesh::default()
    };
    apart.texcoords[0] = corners.iter().flatten().copied().collect();
    if apart.normals.is_empty() {
        normals::make_flat(&mut apart);
    }
    let slot = TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY };
    corner_tangents(&apart, Some(slot))
}

/// The tangent at each corner of each triangle, from the texture coordinates of a texture,
/// transformed as the texture's are: what a map says about right and up is of its own image. Where
/// these are the same everywhere, or there is no texture, from the first set that is not. Where
/// none has a gradient, tangents are [`horizontal`].
fn corner_tangents(mesh: &TriangleMesh, texture: Option<TextureSlot>) -> Vec<Vec4> {
    let own =
        texture.map(|t| (t.texcoord, t.transform)).filter(|(_, transform)| transform.matrix2.determinant() != 0.0);
    let candidates = own.into_iter().chain((0..mesh.texcoord_sets()).map(|set| (set, Affine2::IDENTITY)));
    let chosen = candidates.into_iter().find(|(set, _)| varies(mesh.texcoord_set(*set)));
    let (set, transform) = chosen.unwrap_or_default();
    let mut corners = Corners { mesh, set, transform, faces: None, tangents: vec![Vec4::ZERO; mesh.indices.len() * 3] };
    if chosen.is_some() {
        corners.set_crowded_apart();
    }
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

/// The tangent of a surface without texture coordinates: around the y axis of the mesh, as the
/// lines of latitude of a globe run; along x at the poles.
fn horizontal(normal: Vec3) -> Vec4 {
    let t = Vec3::new(normal.z, 0.0, -normal.x);
    if t.length_squared() > 1e-6 { t.normalize().extend(1.0) } else { Vec4::new(1.0, 0.0, 0.0, 1.0) }
}

/// The first member of a group; the way to it gets shorter.
fn first(group: &mut [usize], mut member: usize) -> usize {
    while group[member] != member {
        group[member] = group[group[member]];
        member = group[member];
    }
    member
}

/// Most triangles around a vertex that MikkTSpace is asked about: it takes the square of their
/// number, and recurses as deep.
const MAX_AROUND: u32 = 1024;

struct Corners<'a> {
    mesh: &'a TriangleMesh,
    set: usize,
    /// Applied to the coordinates of the set.
    transform: Affine2,
    /// The triangles that MikkTSpace is asked about; `None`: all.
    faces: Option<Vec<u32>>,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn triangle(&self, face: usize) -> usize {
        self.faces.as_ref().map_or(face, |faces| faces[face] as usize)
    }

    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[self.triangle(face)][corner] as usize
    }

    /// Without negative zeros, which are other bits of the same number.
    fn texcoord(&self, vertex: usize) -> [f32; 2] {
        // glTF's v points down, the algorithm's up; the sign of the bitangent depends on it
        let uv = self.transform.transform_point2(self.mesh.texcoord_set(self.set)[vertex]);
        [uv.x + 0.0, 1.0 - uv.y]
    }

    /// Key by which vertices are one: bits of position, normal and texture coordinates.
    fn key(&self, vertex: usize) -> [u32; 8] {
        let ([x, y, z], [nx, ny, nz]) = (self.mesh.positions[vertex].to_array(), self.mesh.normals[vertex].to_array());
        let [u, v] = self.texcoord(vertex);
        [x, y, z, nx, ny, nz, u, v].map(|value| (value + 0.0).to_bits())
    }

    /// For each triangle, whether it is at a vertex with more than [`MAX_AROUND`]; `None` if none
    /// is.
    fn crowded(&self) -> Option<Vec<bool>> {
        let indices = &self.mesh.indices;
        if indices.len() <= MAX_AROUND as usize {
            return None;
        }
        let mut triangles_at = vec![0_u32; self.mesh.positions.len()];
        indices.iter().flatten().for_each(|&v| triangles_at[v as usize] += 1);

        // vertices by a hash first: hardly a mesh has so many triangles with one
        let slots = self.mesh.positions.len().next_power_of_two();
        let mut counts = vec![0_u32; slots];
        for (vertex, &count) in triangles_at.iter().enumerate().filter(|(_, count)| **count > 0) {
            let mix =
                |hash: u64, bits: u32| (hash ^ u64::from(bits)).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(23);
            let hash = self.key(vertex).into_iter().fold(0, mix);
            counts[hash as usize & (slots - 1)] += count;
        }
        if counts.iter().all(|&count| count <= MAX_AROUND) {
            return None;
        }

        // then by what they are
        let mut exact: HashMap<[u32; 8], u32> = HashMap::new();
        for (vertex, count) in triangles_at.iter().enumerate() {
            *exact.entry(self.key(vertex)).or_default() += count;
        }
        let is_crowded = |v: u32| exact[&self.key(v as usize)] > MAX_AROUND;
        let crowded: Vec<bool> = indices.iter().map(|t| t.iter().any(|&v| is_crowded(v))).collect();
        crowded.contains(&true).then_some(crowded)
    }

    /// Leaves triangles at crowded vertices out, and gives their corners the mean of the tangents
    /// of the triangles around the vertex that share edges with each other, weighted by angle: that
    /// is MikkTSpace's, where an edge has two triangles.
    fn set_crowded_apart(&mut self) {
        let Some(crowded) = self.crowded() else { return };
        let apart: Vec<usize> = (0..crowded.len()).filter(|&t| crowded[t]).collect();

        // each triangle's own tangent at its corners, and the vertices that these are of
        let (mut numbers, mut vertices): (HashMap<[u32; 8], u32>, Vec<u32>) = (HashMap::new(), Vec::new());
        let (mut tangents, mut handedness): (Vec<Vec3>, Vec<bool>) = (Vec::new(), Vec::new());
        for &t in &apart {
            let corners = self.mesh.indices[t].map(|v| v as usize);
            let p = corners.map(|v| self.mesh.positions[v]);
            let uv = corners.map(|v| Vec2::from(self.texcoord(v)));
            let [(e1, d1), (e2, d2)] = [1, 2].map(|k| (p[k] - p[0], uv[k] - uv[0]));
            let preserves = d1.perp_dot(d2) > 0.0;
            let along = (e1 * d2.y - e2 * d1.y) * if preserves { 1.0 } else { -1.0 };
            for k in 0..3 {
                let normal = self.mesh.normals[corners[k]];
                let angle = (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]);
                let tangent = (along - normal * normal.dot(along)).normalize_or_zero();
                tangents.push(tangent * if angle.is_finite() { angle } else { 0.0 });
                let next = numbers.len() as u32;
                vertices.push(*numbers.entry(self.key(corners[k])).or_insert(next));
            }
            handedness.push(preserves);
        }

        // corners of triangles that share an edge belong together
        let mut group: Vec<usize> = (0..vertices.len()).collect();
        let mut edges: HashMap<(u32, u32, bool), [usize; 2]> = HashMap::new();
        for (t, &preserves) in handedness.iter().enumerate() {
            for k in 0..3 {
                let [mut a, mut b] = [3 * t + k, 3 * t + (k + 1) % 3];
                if vertices[a] > vertices[b] {
                    (a, b) = (b, a);
                }
                let others = *edges.entry((vertices[a], vertices[b], preserves)).or_insert([a, b]);
                for (corner, other) in [a, b].into_iter().zip(others) {
                    let (corner, other) = (first(&mut group, corner), first(&mut group, other));
                    group[corner.max(other)] = corner.min(other);
                }
            }
        }

        // sums of each group, which its first corner has
        let mut sums = vec![Vec3::ZERO; tangents.len()];
        for (corner, tangent) in tangents.iter().enumerate() {
            sums[first(&mut group, corner)] += *tangent;
        }
        for (t, &triangle) in apart.iter().enumerate() {
            let w = if handedness[t] { 1.0 } else { -1.0 };
            for k in 0..3 {
                self.tangents[3 * triangle + k] = sums[first(&mut group, 3 * t + k)].normalize_or_zero().extend(w);
            }
        }
        self.faces = Some((0..).zip(&crowded).filter(|(_, crowded)| !**crowded).map(|(t, _)| t).collect());
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.faces.as_ref().map_or(self.mesh.indices.len(), Vec::len)
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        // without negative zeros: vertices are told apart by bits
        (self.mesh.positions[self.vertex(face, vert)] + Vec3::ZERO).into()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        (self.mesh.normals[self.vertex(face, vert)] + Vec3::ZERO).into()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.texcoord(self.vertex(face, vert))
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(space) = tangent_space {
            let corner = 3 * self.triangle(face) + vert;
            self.tangents[corner] = space.tangent_encoded().into();
        }
    }
}

/// A vertex's tangents, of each texture that has its own.
type Tangents = [Vec4; 3];

/// Tangents that differ by no more than this are the same.
const TOLERANCE: f32 = 1e-5;
/// Side of the cells that tangents are sorted into: a component and all that are the same lie in
/// two cells at most.
const CELL: f64 = 2.5e-5;
/// Copies of a vertex that are compared one after another. Of those that have more, cells are
/// looked into.
const MAX_CHAIN: usize = 16;

fn differ(a: &Tangents, b: &Tangents) -> bool {
    a.iter().zip(b).any(|(a, b)| (*a - *b).abs().max_element() > TOLERANCE)
}

/// The cell of each component of tangents, and of each the last cell in which the same may lie.
fn cells(tangents: &Tangents) -> [[i32; 2]; 12] {
    let at = |x: f64| (x / CELL + 0.5).floor() as i32;
    let reach = 1.1 * f64::from(TOLERANCE);
    let mut cells = [[0; 2]; 12];
    for (cell, x) in cells.iter_mut().zip(tangents.iter().flat_map(|t| t.to_array()).map(f64::from)) {
        *cell = [at(x - reach), at(x + reach)];
    }
    cells
}

/// Vertices with their tangents, and the copies of each vertex.
struct Copies {
    tangents: Vec<Tangents>,
    /// Whether a vertex has tangents yet.
    taken: Vec<bool>,
    /// Another copy of the vertex that a vertex copies, or itself.
    next: Vec<u32>,
    /// Copies of vertices that have many of them, by the cells of their tangents.
    sorted: HashMap<(u32, [i32; 12]), Vec<u32>>,
    /// The last copy of each of these vertices.
    last: HashMap<u32, u32>,
    #[cfg(test)]
    comparisons: usize,
}

impl Copies {
    fn new(vertices: usize) -> Self {
        Self {
            tangents: vec![Tangents::default(); vertices],
            taken: vec![false; vertices],
            next: (0..vertices as u32).collect(),
            sorted: HashMap::new(),
            last: HashMap::new(),
            #[cfg(test)]
            comparisons: 0,
        }
    }

    fn is_same(&mut self, vertex: u32, tangents: &Tangents) -> bool {
        #[cfg(test)]
        {
            self.comparisons += 1;
        }
        !differ(&self.tangents[vertex as usize], tangents)
    }

    /// The copy of a vertex, or the vertex, with these tangents: the first of several. `true`: it
    /// is a new copy.
    fn find(&mut self, vertex: u32, tangents: Tangents) -> (u32, bool) {
        if !self.taken[vertex as usize] {
            (self.taken[vertex as usize], self.tangents[vertex as usize]) = (true, tangents);
            return (vertex, false);
        }

        // most vertices have few copies
        let mut last = vertex;
        for _ in 0..MAX_CHAIN {
            if self.is_same(last, &tangents) {
                return (last, false);
            }
            match self.next[last as usize] {
                next if next == last => return (self.push(last, tangents), true),
                next => last = next,
            }
        }

        // a vertex with many: its copies are sorted once, and each new one where it belongs
        if !self.last.contains_key(&vertex) {
            let mut copy = vertex;
            loop {
                self.sort(vertex, copy);
                match self.next[copy as usize] {
                    next if next == copy => break,
                    next => copy = next,
                }
            }
            self.last.insert(vertex, copy);
        }
        if let Some(copy) = self.find_sorted(vertex, &tangents) {
            return (copy, false);
        }
        let copy = self.push(self.last[&vertex], tangents);
        self.sort(vertex, copy);
        self.last.insert(vertex, copy);
        (copy, true)
    }

    /// Adds a copy behind another.
    fn push(&mut self, before: u32, tangents: Tangents) -> u32 {
        let copy = self.tangents.len() as u32;
        self.next[before as usize] = copy;
        self.tangents.push(tangents);
        self.taken.push(true);
        self.next.push(copy);
        copy
    }

    fn sort(&mut self, vertex: u32, copy: u32) {
        let cell =
            self.tangents[copy as usize].map(|t| t.to_array().map(|x| (f64::from(x) / CELL + 0.5).floor() as i32));
        let mut key = [0; 12];
        key.copy_from_slice(cell.as_flattened());
        self.sorted.entry((vertex, key)).or_default().push(copy);
    }

    /// The first copy with these tangents among those that are sorted.
    fn find_sorted(&mut self, vertex: u32, tangents: &Tangents) -> Option<u32> {
        let cells = cells(tangents);
        // bits of a number choose among the two cells of those components that have two
        let two: Vec<usize> = (0..cells.len()).filter(|&k| cells[k][0] != cells[k][1]).collect();
        let mut found: Option<u32> = None;
        for choice in 0..1_u32 << two.len() {
            let mut key = cells.map(|c| c[0]);
            for (bit, &k) in two.iter().enumerate() {
                key[k] = cells[k][(choice >> bit & 1) as usize];
            }
            // copies of a cell are few: they differ, and lie within it
            for k in 0..self.sorted.get(&(vertex, key)).map_or(0, Vec::len) {
                let copy = self.sorted[&(vertex, key)][k];
                if found.is_none_or(|f| copy < f) && self.is_same(copy, tangents) {
                    found = Some(copy);
                }
            }
        }
        found
    }
}

/// Gives each vertex the tangents of its corners (three per triangle, for each array that is not
/// empty), with a copy of the vertex for each other tangents. Returns what each copy is one of.
fn weld(mesh: &mut TriangleMesh, corners: [&[Vec4]; 3]) -> Vec<u32> {
    let at = |corner: usize| corners.map(|c| c.get(corner).copied().unwrap_or_default());
    let mut vertices = Copies::new(mesh.positions.len());
    let mut copies: Vec<u32> = Vec::new();
    for (corner, index) in mesh.indices.iter_mut().flatten().enumerate() {
        let (vertex, is_new) = vertices.find(*index, at(corner));
        if is_new {
            copies.push(*index);
        }
        *index = vertex;
    }
    let Copies { mut tangents, taken, .. } = vertices;
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
    for set in mesh.texcoord_sets_mut() {
        extend(set, &copies);
    }
    // vertices that no triangle uses
    for ((tangents, normal), _) in tangents.iter_mut().zip(&mesh.normals).zip(&taken).filter(|(_, taken)| !**taken) {
        *tangents = [horizontal(*normal); 3];
    }
    let array = |k: usize| if corners[k].is_empty() { Vec::new() } else { tangents.iter().map(|t| t[k]).collect() };
    (mesh.tangents, mesh.clearcoat_tangents, mesh.anisotropy_tangents) = (array(0), array(1), array(2));
    copies
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As [`Copies::find`] without cells: each copy is compared with.
    fn one_by_one(copies: &mut Vec<Tangents>, tangents: Tangents) -> usize {
        copies.iter().position(|c| !differ(c, &tangents)).unwrap_or_else(|| {
            copies.push(tangents);
            copies.len() - 1
        })
    }

    /// Numbers that look random, 0 to 1.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1_u32;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        }
    }

    #[test]
    fn copies_are_the_same_as_one_by_one() {
        // tangents that are close to each other, on both sides of the tolerance
        for (spread, textures) in [(1e-4, 1), (3e-5, 3), (2.0, 2)] {
            let (mut number, mut expected, mut copies) = (numbers(), Vec::new(), Copies::new(1));
            for _ in 0..2000 {
                let mut tangents = Tangents::default();
                for tangent in tangents.iter_mut().take(textures) {
                    let [x, y, z] = [(); 3].map(|()| spread * (number() - 0.5));
                    *tangent = Vec4::new(x, y + 0.5, z, if number() < 0.5 { -1.0 } else { 1.0 });
                }
                let before = expected.len();
                let index = one_by_one(&mut expected, tangents);
                assert_eq!(copies.find(0, tangents), (index as u32, before > 0 && expected.len() > before));
            }
            assert!(expected.len() > 2 * MAX_CHAIN, "{}", expected.len());
        }
    }

    /// Every corner at one vertex has tangents of its own: comparisons grow with their number, not
    /// with its square.
    #[test]
    fn many_copies_of_a_vertex_cost_little_each() {
        const CORNERS: u32 = 60_000;
        let mut copies = Copies::new(1);
        for k in 0..CORNERS {
            let (sin, cos) = (k as f32 * 1e-4).sin_cos();
            let (copy, is_new) = copies.find(0, [Vec4::new(cos, sin, 0.0, 1.0), Vec4::ZERO, Vec4::ZERO]);
            assert!(copy == k && is_new == (k > 0));
        }
        let each = copies.comparisons as f64 / f64::from(CORNERS);
        assert!(each < 2.0 * MAX_CHAIN as f64, "{each} comparisons a corner");
    }

    /// A disk of triangles around its centre, with one vertex for each two neighbours.
    fn disk(count: u32, flip: f32) -> TriangleMesh {
        let mut mesh = TriangleMesh { positions: vec![Vec3::new(0.0, 0.0, 0.25)], ..Default::default() };
        mesh.texcoords[0].push(Vec2::ZERO);
        for k in 0..count {
            let at = Vec2::from_angle(std::f32::consts::TAU * k as f32 / count as f32);
            mesh.positions.push(at.extend(0.0));
            mesh.texcoords[0].push(Vec2::new(at.x, flip * at.y));
            mesh.indices.push([0, k + 1, (k + 1) % count + 1]);
        }
        mesh.normals = vec![Vec3::Z; mesh.positions.len()];
        mesh
    }

    /// Around a vertex with too many triangles tangents are what MikkTSpace has around one with
    /// fewer.
    #[test]
    fn crowded_vertices_have_the_same_tangents() {
        for flip in [1.0, -1.0] {
            let few = corner_tangents(&disk(MAX_AROUND, flip), None);
            let many = corner_tangents(&disk(MAX_AROUND + 1, flip), None);
            for (k, (a, b)) in few.iter().zip(&many).enumerate() {
                assert!((*a - *b).abs().max_element() < 2e-2, "{k}: {a} {b}");
            }
        }
        // a hundred thousand neither overflow the stack nor take long
        assert!(corner_tangents(&disk(100_000, 1.0), None).iter().all(|t| t.is_finite()));
    }

    /// A fan of triangles that share a vertex and nothing else, each with a texture that lies
    /// another way.
    #[test]
    fn a_fan_of_many_triangles() {
        let count = 60_000;
        let mut mesh = TriangleMesh { positions: vec![Vec3::ZERO], normals: vec![Vec3::Z], ..Default::default() };
        mesh.texcoords[0].push(Vec2::ZERO);
        for k in 0..count {
            for turn in [0.0, 1.0] {
                let [p, uv] = [turn + 1e-4 * k as f32, turn].map(Vec2::from_angle);
                mesh.positions.push(p.extend(0.0));
                mesh.normals.push(Vec3::Z);
                mesh.texcoords[0].push(Vec2::new(uv.x, -uv.y));
            }
            mesh.indices.push([0, 2 * k + 1, 2 * k + 2]);
        }
        let start = std::time::Instant::now();
        let corners = corner_tangents(&mesh, None);
        println!("tangents: {:?}", start.elapsed());
        let start = std::time::Instant::now();
        let copies = weld(&mut mesh, [&corners, &[], &[]]);
        println!("welding: {:?}, {} copies", start.elapsed(), copies.len());
        assert!(copies.len() > 10_000 && mesh.tangents.len() == mesh.positions.len());
    }
}
