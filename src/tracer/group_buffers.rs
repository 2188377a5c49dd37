//! Vertices, indices and spheres of a group in device memory.

use std::sync::Arc;

use crate::accel::flatten::{BlasGroup, FlatScene, Submesh};
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
use crate::scene::{Geometry, TriangleMesh};

/// Buffers of a group, over which its BLAS is built.
pub(super) struct GroupBuffers {
    /// 3 floats per vertex, or 4 per sphere.
    pub positions: Buffer,
    /// 3 uints per triangle; `None` for spheres.
    pub indices: Option<Buffer>,
    /// The submesh index of each primitive; `None` for a group of one submesh.
    pub submesh_of: Option<Buffer>,
}

impl GroupBuffers {
    /// Writes the vertices, or spheres, and indices of a group.
    pub fn upload(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<Self> {
        let (positions, indices) = if group.spheres {
            (write_spheres(device, flat, group)?, None)
        } else {
            (write_vertices(device, flat, group)?, Some(write_indices(device, flat, group)?))
        };
        Ok(Self { positions, indices, submesh_of: write_submeshes(device, group)? })
    }

    /// Size in device memory, in bytes.
    pub fn bytes(&self) -> u64 {
        [Some(&self.positions), self.indices.as_ref(), self.submesh_of.as_ref()]
            .into_iter()
            .flatten()
            .map(Buffer::size)
            .sum()
    }
}

/// Writes the centre and radius of each sphere.
fn write_spheres(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<Buffer> {
    let size = 16 * group.primitive_count as u64;
    let mut spheres = Buffer::new(device, "spheres", size, Memory::Device)?;
    spheres.fill(size, 16, |first, bytes| {
        for (k, out) in bytes.chunks_exact_mut(16).enumerate() {
            let primitive = first as usize + k;
            let part = flat.submesh_of(group, primitive);
            let s = flat.sphere(part, primitive - part.first_primitive);
            out.copy_from_slice(bytemuck::bytes_of(&[s.center.x, s.center.y, s.center.z, s.radius]));
        }
    })?;
    Ok(spheres)
}

/// The triangles of a submesh; a group of triangles has no others.
fn triangles<'a>(flat: &'a FlatScene, part: &Submesh) -> &'a TriangleMesh {
    match &flat.scene.meshes[part.mesh].geometry {
        Geometry::Triangles(t) => t,
        Geometry::Spheres(_) => unreachable!("a triangle group holds triangles"),
    }
}

/// Writes the positions of all vertices, submesh after submesh.
fn write_vertices(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<Buffer> {
    let size = 12 * group.vertex_count as u64;
    let mut positions = Buffer::new(device, "vertices", size, Memory::Device)?;
    let mut cursor = Cursor::new(group.submeshes.iter().map(|p| triangles(flat, p).positions.len()));
    positions.fill(size, 12, |_, bytes| {
        for out in bytes.chunks_exact_mut(12) {
            let (part, vertex) = cursor.next();
            out.copy_from_slice(bytemuck::bytes_of(&flat.vertex(&group.submeshes[part], vertex).to_array()));
        }
    })?;
    Ok(positions)
}

/// Writes the vertices of each triangle, as indices in the group.
fn write_indices(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<Buffer> {
    let size = 12 * group.primitive_count as u64;
    let mut indices = Buffer::new(device, "indices", size, Memory::Device)?;
    let mut cursor = Cursor::new(group.submeshes.iter().map(|p| triangles(flat, p).indices.len()));
    indices.fill(size, 12, |_, bytes| {
        for out in bytes.chunks_exact_mut(12) {
            let (part, triangle) = cursor.next();
            let part = &group.submeshes[part];
            let corners = triangles(flat, part).indices[triangle].map(|i| i + part.first_vertex as u32);
            out.copy_from_slice(bytemuck::bytes_of(&corners));
        }
    })?;
    Ok(indices)
}

/// Writes the submesh index of each primitive; `None` for a group of one submesh.
fn write_submeshes(device: &Arc<Device>, group: &BlasGroup) -> Result<Option<Buffer>> {
    if group.submeshes.len() <= 1 {
        return Ok(None);
    }
    let ends = group.submeshes.iter().skip(1).map(|p| p.first_primitive).chain([group.primitive_count]);
    let sizes: Vec<_> = group.submeshes.iter().zip(ends).map(|(p, end)| end - p.first_primitive).collect();
    let mut buffer =
        Buffer::new(device, "submesh of each primitive", 4 * group.primitive_count as u64, Memory::Device)?;
    let mut cursor = Cursor::new(sizes.into_iter());
    buffer.fill(4 * group.primitive_count as u64, 4, |_, bytes| {
        for out in bytes.chunks_exact_mut(4) {
            out.copy_from_slice(&(cursor.next().0 as u32).to_le_bytes());
        }
    })?;
    Ok(Some(buffer))
}

/// Walks over the items of consecutive ranges of given lengths: (range, item within it).
struct Cursor<I> {
    lengths: I,
    range: usize,
    item: usize,
    length: usize,
}

impl<I: Iterator<Item = usize>> Cursor<I> {
    fn new(mut lengths: I) -> Self {
        let length = lengths.next().unwrap_or(0);
        Self { lengths, range: 0, item: 0, length }
    }

    fn next(&mut self) -> (usize, usize) {
        while self.item >= self.length {
            self.length = self.lengths.next().unwrap_or(usize::MAX);
            self.range += 1;
            self.item = 0;
        }
        self.item += 1;
        (self.range, self.item - 1)
    }
}
