//! Vertices whose corners differ, split into one for each kind of corner.

use std::collections::HashMap;
use std::hash::Hash;

use crate::scene::TriangleMesh;

/// The vertices of a mesh after [`split`].
pub(super) struct Split<K> {
    /// Which vertex each vertex was before.
    pub source: Vec<u32>,
    /// The key of the corners of each vertex; `None` for a vertex that no triangle uses.
    pub keys: Vec<Option<K>>,
}

/// Copies vertices until the corners of each have one key. `key` is asked for each corner: those of
/// triangle `t` are `3 t` to `3 t + 2`. Tangents are dropped: they belong to the corners before.
pub(super) fn split<K: Copy + Eq + Hash>(mesh: &mut TriangleMesh, mut key: impl FnMut(usize) -> K) -> Split<K> {
    let count = mesh.positions.len();
    let mut keys: Vec<Option<K>> = vec![None; count];
    let mut copies: HashMap<(u32, K), u32> = HashMap::new();
    let mut source: Vec<u32> = (0..count as u32).collect();
    for (corner, index) in mesh.indices.iter_mut().flatten().enumerate() {
        let key = key(corner);
        let vertex = *index as usize;
        if *keys[vertex].get_or_insert(key) == key {
            continue;
        }
        *index = *copies.entry((*index, key)).or_insert_with(|| {
            source.push(vertex as u32);
            keys.push(Some(key));
            source.len() as u32 - 1
        });
    }

    // the copies have all else of their vertex
    fn extend<T: Copy>(values: &mut Vec<T>, copies: &[u32]) {
        if !values.is_empty() {
            values.reserve_exact(copies.len());
            for &original in copies {
                values.push(values[original as usize]);
            }
        }
    }
    let copies = &source[count..];
    extend(&mut mesh.positions, copies);
    extend(&mut mesh.normals, copies);
    extend(&mut mesh.colors, copies);
    for set in mesh.texcoord_sets_mut() {
        extend(set, copies);
    }
    drop_tangents(mesh);
    Split { source, keys }
}

/// Removes tangents, which are computed again where a material needs them.
pub(super) fn drop_tangents(mesh: &mut TriangleMesh) {
    for tangents in [&mut mesh.tangents, &mut mesh.clearcoat_tangents, &mut mesh.anisotropy_tangents] {
        *tangents = Vec::new();
    }
}
