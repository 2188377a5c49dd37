//! Removal of unused vertices.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::scene::TriangleMesh;

/// Triangles that a thread looks at at least.
const MIN_LENGTH: usize = 1 << 16;

/// Drops unused vertices where they are more than half. Exporters let many meshes share one large
/// array, of which each uses a part; whole copies for each would multiply the memory.
///
/// A mesh that is broken (indices out of range, positions that are not finite) stays as it is, so
/// that the error can name the file's own indices.
///
/// Returns which vertices are left, in their order, if some were dropped.
pub(super) fn compact(mesh: &mut TriangleMesh) -> Option<Vec<u32>> {
    const UNUSED: u32 = u32::MAX;
    let count = mesh.positions.len();

    // which are used
    let is_used: Vec<AtomicBool> = (0..count).map(|_| AtomicBool::new(false)).collect();
    let in_range = mesh.indices.par_iter().with_min_len(MIN_LENGTH).flatten_iter().all(|&i| {
        let Some(used) = is_used.get(i as usize) else { return false };
        // a store where nothing changes would take the line of the cache from other threads
        if !used.load(Ordering::Relaxed) {
            used.store(true, Ordering::Relaxed);
        }
        true
    });
    if !in_range {
        return None;
    }
    let used = is_used.iter().filter(|used| used.load(Ordering::Relaxed)).count();
    if used * 2 > count || !mesh.positions.iter().all(|p| p.is_finite()) {
        return None;
    }

    // vertices keep their order
    let mut index = vec![UNUSED; count];
    for (next, (slot, _)) in index.iter_mut().zip(&is_used).filter(|(_, used)| used.load(Ordering::Relaxed)).enumerate()
    {
        *slot = next as u32;
    }
    for i in mesh.indices.iter_mut().flatten() {
        *i = index[*i as usize];
    }
    fn keep<T>(values: &mut Vec<T>, index: &[u32]) {
        let mut used = index.iter().map(|&i| i != UNUSED);
        values.retain(|_| used.next().unwrap_or(false));
        values.shrink_to_fit();
    }
    keep(&mut mesh.positions, &index);
    keep(&mut mesh.normals, &index);
    keep(&mut mesh.tangents, &index);
    keep(&mut mesh.colors, &index);
    for set in mesh.texcoord_sets_mut() {
        keep(set, &index);
    }
    Some((0..).zip(&index).filter(|(_, slot)| **slot != UNUSED).map(|(i, _)| i).collect())
}
