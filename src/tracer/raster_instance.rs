//! The geometry of a scene in device memory for a rasterizer: buffer addresses, and bounds for
//! frustum culling.

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene};

/// Number of consecutive primitives that are culled or drawn together.
pub const CHUNK: u32 = 256;

/// Counts and bounds of a group, on the host.
pub struct RasterGeometry {
    /// Whether the primitives are spheres; otherwise they are triangles.
    pub spheres: bool,
    /// Number of primitives.
    pub primitives: u32,
    /// Number of primitives before the first alpha-tested one.
    pub opaque: u32,
    /// Bounds of all primitives, in group space.
    pub bounds: Aabb,
    /// Bounds of each run of [`CHUNK`] primitives; empty for a single run, and after vertices have
    /// moved.
    pub chunks: Vec<Aabb>,
}

/// A TLAS instance, and the group below it.
pub struct RasterInstance<'a> {
    /// Index of the TLAS instance.
    pub entry: u32,
    /// Nothing of it is to be seen.
    pub hidden: bool,
    /// Group space to world relative to the scene's origin: three rows.
    pub to_world: [[f32; 4]; 3],
    /// Geometry of the instance.
    pub shape: &'a RasterGeometry,
    /// Device address of its vertices, 3 floats each, or of its spheres, 4 floats each.
    pub positions: u64,
    /// Device address of its vertex indices, 3 words per triangle; 0 for spheres.
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
        Self {
            spheres: group.spheres,
            primitives: primitives as u32,
            opaque: group.opaque_count as u32,
            bounds,
            chunks,
        }
    }

    /// Recomputes the bounds after its vertices have moved.
    pub(super) fn deform(&mut self, positions: &[Vec3]) {
        self.chunks.clear();
        let pieces = positions.par_chunks(1 << 14).map(Aabb::of_points);
        self.bounds = pieces.reduce(|| Aabb::EMPTY, Aabb::union);
    }
}
