//! Removal of unused vertices.

use crate::scene::TriangleMesh;

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
    let mut index = vec![UNUSED; count];
    let mut used = 0;
    for &i in mesh.indices.iter().flatten() {
        match index.get_mut(i as usize) {
            Some(slot) if *slot == UNUSED => {
                *slot = 0;
                used += 1;
            }
            Some(_) => {}
            None => return None,
        }
    }
    if used * 2 > count || !mesh.positions.iter().all(|p| p.is_finite()) {
        return None;
    }
    // vertices keep their order
    for (next, slot) in index.iter_mut().filter(|slot| **slot != UNUSED).enumerate() {
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
