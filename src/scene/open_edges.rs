//! Edges where a surface ends: those of one triangle only.
//!
//! Vertices and edges are divided into parts that fit into a core's cache, by a hash of the
//! position and by the smaller vertex, and each part is counted by itself. So a mesh of 25 million
//! triangles takes no hash map of its vertices and no sort of its 75 million edges.

use std::hash::{BuildHasher, RandomState};

use glam::Vec3;
use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::TriangleMesh;

/// Number of vertices of a part.
const PART: usize = 1 << 15;
/// Least number of elements that a thread divides.
const CHUNK: usize = 1 << 20;
/// Largest number of parts: each thread writes to all of them in turn.
const MAX_PARTS: usize = 1 << 10;

/// The number of edges of one triangle only, where vertices at the same place are one. Indices must
/// be in range.
pub(crate) fn open_edges(mesh: &TriangleMesh) -> u64 {
    let first = first_at_place(&mesh.positions);
    let vertex = |i: u32| first.as_ref().map_or(i, |first| first[i as usize]);

    // edges by parts of the smaller vertex
    let vertices = mesh.positions.len();
    let width = PART.max(vertices.div_ceil(MAX_PARTS)).next_power_of_two();
    let (parts, shift) = (vertices.div_ceil(width), width.ilog2());
    let edges = divide(mesh.indices.len(), parts, |t| {
        let [a, b, c] = mesh.indices[t].map(vertex);
        [(a, b), (b, c), (c, a)].map(|(a, b)| ((a.min(b) >> shift) as usize, (a.min(b), a.max(b))))
    });
    (0..parts).into_par_iter().map(|part| single_edges(&edges, part, part * width, width)).sum()
}

/// Elements by chunk and by part.
type Divided<T> = Vec<Vec<Vec<T>>>;

/// Divides what `each` makes of the numbers below `count` into parts, in parallel: `N` elements,
/// each with the number of its part.
fn divide<T: Send, const N: usize>(
    count: usize,
    parts: usize,
    each: impl Fn(usize) -> [(usize, T); N] + Sync,
) -> Divided<T> {
    let chunk = CHUNK.max(count.div_ceil(2 * rayon::current_num_threads()));
    let chunks = (0..count.div_ceil(chunk)).into_par_iter();
    chunks
        .map(|k| {
            let mut divided: Vec<Vec<T>> = Vec::new();
            divided.resize_with(parts, Vec::new);
            for (part, element) in (k * chunk..count.min((k + 1) * chunk)).flat_map(&each) {
                divided[part].push(element);
            }
            divided
        })
        .collect()
}

/// For each vertex the first one at its place, if any two share one. The hash has a random seed:
/// no file can have vertices that all fall into one part.
fn first_at_place(positions: &[Vec3]) -> Option<Vec<u32>> {
    // vertices by parts of a hash
    let seed = RandomState::new().hash_one(0);
    let parts = positions.len().div_ceil(PART).clamp(1, MAX_PARTS).next_power_of_two();
    let divided = divide(positions.len(), parts, |i| {
        // 0 and -0 are one place
        let place = (positions[i] + Vec3::ZERO).to_array().map(f32::to_bits);
        let hash = xxh3_64_with_seed(bytemuck::bytes_of(&place), seed);
        [(hash as usize & (parts - 1), (place, (hash >> 32) as u32, i as u32))]
    });

    // those that are not the first at their place
    let later: Vec<Vec<(u32, u32)>> = (0..parts)
        .into_par_iter()
        .map(|part| {
            const FREE: u32 = u32::MAX;
            let all: Vec<_> = divided.iter().flat_map(|chunk| &chunk[part]).collect();
            let slots = (2 * all.len()).next_power_of_two();
            let mut table = vec![FREE; slots];
            let mut later = Vec::new();
            for (k, (place, hash, i)) in all.iter().enumerate() {
                let mut slot = *hash as usize & (slots - 1);
                while table[slot] != FREE && all[table[slot] as usize].0 != *place {
                    slot = (slot + 1) & (slots - 1);
                }
                match table[slot] {
                    FREE => table[slot] = k as u32,
                    known => later.push((*i, all[known as usize].2)),
                }
            }
            later
        })
        .collect();
    if later.iter().all(Vec::is_empty) {
        return None;
    }
    let mut first: Vec<u32> = (0..positions.len() as u32).collect();
    later.into_iter().flatten().for_each(|(i, known)| first[i as usize] = known);
    Some(first)
}

/// Number of edges that a part has once. Its edges begin at the `width` vertices from `start` on.
fn single_edges(edges: &Divided<(u32, u32)>, part: usize, start: usize, width: usize) -> u64 {
    let edges = || edges.iter().flat_map(|chunk| &chunk[part]);

    // the other ends, by vertices
    let mut ends = vec![0u32; width + 1];
    edges().for_each(|(a, _)| ends[*a as usize - start + 1] += 1);
    for k in 1..ends.len() {
        ends[k] += ends[k - 1];
    }
    let mut others = vec![0u32; ends[width] as usize];
    let mut next = ends.clone();
    for (a, b) in edges() {
        let at = &mut next[*a as usize - start];
        others[*at as usize] = *b;
        *at += 1;
    }

    // those that a vertex has once
    let mut count = 0;
    for bounds in ends.windows(2) {
        let others = &mut others[bounds[0] as usize..bounds[1] as usize];
        others.sort_unstable();
        count += others.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).count() as u64;
    }
    count
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::scene::{Geometry, builtin};

    fn mesh(name: &str) -> TriangleMesh {
        match builtin::by_name(name).unwrap().meshes.swap_remove(0).geometry {
            Geometry::Triangles(mesh) => mesh,
            Geometry::Spheres(_) => panic!("{name} has triangles"),
        }
    }

    #[test]
    fn edges_of_one_triangle_are_open() {
        let mut closed = mesh("closed-box");
        // its sides have vertices of their own, at the same places
        assert_eq!(open_edges(&closed), 0);
        closed.indices.pop();
        assert_eq!(open_edges(&closed), 3);
        assert_eq!(open_edges(&TriangleMesh::default()), 0);
    }

    /// A soup of triangles in many parts, some of whose vertices share a place, and with edges of
    /// three triangles.
    #[test]
    fn parts_count_as_the_whole() {
        let mut soup = mesh("terrain:200000");
        let places = soup.positions.clone();
        let far = |k: u32| k.wrapping_mul(2_654_435_761) as usize % places.len();
        soup.positions.extend((0..50_000).map(|k| places[far(k)]));
        let count = soup.positions.len() as u32;
        let corner = |k: u32| k.wrapping_mul(747_796_405) % count;
        soup.indices.extend((0..30_000).map(|k| [3 * k, 3 * k + 1, 3 * k + 2].map(corner)));
        let again = soup.indices[..1000].to_vec();
        soup.indices.extend(again);
        assert!(soup.positions.len() > 4 * PART);

        let mut first: HashMap<[u32; 3], u32> = HashMap::new();
        let place = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
        let vertex: Vec<u32> = (0..).zip(&soup.positions).map(|(i, p)| *first.entry(place(p)).or_insert(i)).collect();
        let mut uses: HashMap<(u32, u32), u32> = HashMap::new();
        for t in &soup.indices {
            let [a, b, c] = t.map(|i| vertex[i as usize]);
            for (a, b) in [(a, b), (b, c), (c, a)] {
                *uses.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let expected = uses.values().filter(|n| **n == 1).count() as u64;
        assert!(expected > 1000 && first.len() < places.len() + 1);
        assert_eq!(open_edges(&soup), expected);
    }
}
