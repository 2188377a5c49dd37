//! What a rasteriser has to know of a scene in device memory: what lies where, and what can be left out together.

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene};

/// Primitives that follow each other and are left out or drawn together.
pub const CHUNK: u32 = 256;

/// Host-side outline of a group.
pub struct RasterGeometry {
    /// Spheres or triangles.
    pub spheres: bool,
    /// Triangles or spheres.
    pub primitives: u32,
    /// Primitives before the first alpha-tested one.
    pub opaque: u32,
    /// Of all primitives, group space.
    pub bounds: Aabb,
    /// Of each [`CHUNK`] primitives, the last of fewer; none when there is one, or when the vertices may move.
    pub chunks: Vec<Aabb>,
}

/// An entry of the top level, and the group below it.
pub struct RasterInstance<'a> {
    /// Number of the entry.
    pub entry: u32,
    /// Group space to world relative to the scene's origin: three rows.
    pub to_world: [[f32; 4]; 3],
    /// The group.
    pub shape: &'a RasterGeometry,
    /// Address of its vertices, 3 floats each; of a sphere 4.
    pub positions: u64,
    /// Address of its triangles' corners, 3 words each; 0 for spheres.
    pub indices: u64,
}

impl RasterGeometry {
    pub(super) fn new(flat: &FlatScene, group: &BlasGroup) -> Self {
        let primitives = group.primitive_count;
        let chunk = |k: usize| {
            let first = k * CHUNK as usize;
            let (mut part, mut bounds) = (flat.submesh_of(group, first), Aabb::EMPTY);
            for primitive in first..primitives.min(first + CHUNK as usize) {
                if part.end(flat) <= primitive {
                    part = flat.submesh_of(group, primitive);
                }
                bounds = bounds.union(flat.primitive_bounds(group, part, primitive));
            }
            bounds
        };
        let mut chunks: Vec<Aabb> =
            (0..primitives.div_ceil(CHUNK as usize)).into_par_iter().with_min_len(16).map(chunk).collect();
        let bounds = chunks.iter().copied().fold(Aabb::EMPTY, Aabb::union);
        if chunks.len() == 1 {
            chunks.clear();
        }
        Self { spheres: group.spheres, primitives: primitives as u32, opaque: group.opaque_count as u32, bounds, chunks }
    }

    /// Its vertices have moved.
    pub(super) fn deform(&mut self, positions: &[Vec3]) {
        self.chunks.clear();
        let pieces = positions.par_chunks(1 << 14).map(Aabb::of_points);
        self.bounds = pieces.reduce(|| Aabb::EMPTY, Aabb::union);
    }
}
