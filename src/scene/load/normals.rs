//! Repair of shading normals: unit length, and a direction for zero normals.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::TriangleMesh;

/// Normals that a thread looks at at least.
const MIN_LENGTH: usize = 1 << 16;

/// Brings all normals to unit length. Those that are zero or not finite become the mean of the
/// adjacent triangles' normals, weighted by area. Returns how many those were.
///
/// The mesh must have normals, and indices in range.
pub(super) fn repair(mesh: &mut TriangleMesh) -> usize {
    let normals = mesh.normals.par_iter_mut().with_min_len(MIN_LENGTH);
    let bad = normals
        .filter_map(|n| {
            let wide = n.as_dvec3();
            let squared = wide.length_squared();
            if !(squared.is_finite() && squared > 0.0) {
                *n = Vec3::ZERO;
                return Some(());
            }
            if (squared - 1.0).abs() > 1e-5 {
                // normals of unit length up to rounding keep their bits
                *n = (wide / squared.sqrt()).as_vec3();
            }
            None
        })
        .count();
    if bad > 0 {
        from_triangles(mesh);
    }
    bad
}

/// Replaces the normals that are zero.
fn from_triangles(mesh: &mut TriangleMesh) {
    let mut sums = vec![DVec3::ZERO; mesh.normals.len()];
    for t in &mesh.indices {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        let area = (b - a).cross(c - a);
        for &i in t {
            sums[i as usize] += area;
        }
    }
    for (n, sum) in mesh.normals.iter_mut().zip(sums) {
        if *n == Vec3::ZERO {
            // a vertex that no triangle uses needs some direction, too
            *n = sum.try_normalize().unwrap_or(DVec3::Z).as_vec3();
        }
    }
}

/// The geometric unit normal of each corner, with every corner made a vertex of its own: flat
/// shading as explicit normals.
pub(super) fn make_flat(mesh: &mut TriangleMesh) {
    fn expand<T: Copy>(values: &mut Vec<T>, indices: &[[u32; 3]]) {
        if !values.is_empty() {
            *values = indices.iter().flatten().map(|&i| values[i as usize]).collect();
        }
    }
    let TriangleMesh { indices, texcoords, more_texcoords, .. } = mesh;
    expand(&mut mesh.positions, indices);
    expand(&mut mesh.colors, indices);
    for set in texcoords.iter_mut().chain(more_texcoords) {
        expand(set, indices);
    }
    mesh.normals = mesh
        .positions
        .chunks_exact(3)
        .flat_map(|p| {
            let [a, b, c] = [p[0], p[1], p[2]].map(|p| p.as_dvec3());
            [(b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z).as_vec3(); 3]
        })
        .collect();
    for (t, triangle) in mesh.indices.iter_mut().enumerate() {
        *triangle = [3 * t as u32, 3 * t as u32 + 1, 3 * t as u32 + 2];
    }
}
