//! Normals from the shape alone: smooth across edges at which a surface bends little.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::split::{Split, split};
use crate::scene::TriangleMesh;

/// Half-edges of one edge that are compared with one another; those beyond are sharp. Few edges
/// have more than two, and a file in which a thousand triangles share one must not cost its square.
const MAX_AROUND: usize = 16;

/// Cosine of the bend at which a surface counts as folded onto itself, as a sheet of paper that is
/// modelled from both sides is at its border: never smooth.
const FOLDED: f64 = -0.999;

/// A side of a triangle.
struct HalfEdge {
    /// Numbers of its two positions, the smaller first.
    ends: [u32; 2],
    /// The corner at the first of them, and the one at the second.
    corners: [u32; 2],
    /// Whether the triangle runs from the first to the second.
    is_forward: bool,
}

/// Replaces the normals of meshes that are parts of one surface, also where they touch: a vertex
/// has the mean of the normals of the triangles around it, weighted by angle, as far as these are
/// joined by edges at which the surface bends by `max_angle` (radians) or less. An edge joins two
/// triangles that wind the same way; where more share it, those that bend least. Returns which
/// vertex each vertex of each mesh was before.
pub(super) fn smooth(meshes: &mut [&mut TriangleMesh], max_angle: f64) -> Vec<Vec<u32>> {
    // positions by number: vertices at one position are one point of the surface
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
    let mut points: Vec<u32> = Vec::new();
    let mut normals: Vec<DVec3> = Vec::new();
    let mut angles: Vec<f32> = Vec::new();
    for mesh in &*meshes {
        for triangle in &mesh.indices {
            let p = triangle.map(|i| mesh.positions[i as usize]);
            // without negative zeros
            let bits = p.map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
            for (k, bits) in bits.into_iter().enumerate() {
                let next = numbers.len() as u32;
                points.push(*numbers.entry(bits).or_insert(next));
                let [a, b] = [p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]].map(|v| v.as_dvec3());
                let angle = a.angle_between(b);
                angles.push(if angle.is_finite() { angle as f32 } else { 0.0 });
            }
            let [a, b, c] = p.map(|p| p.as_dvec3());
            normals.push((b - a).cross(c - a).normalize_or_zero());
        }
    }
    drop(numbers);

    // corners are joined across edges that are not sharp
    let mut groups: Vec<u32> = (0..points.len() as u32).collect();
    let cosine = max_angle.cos().max(FOLDED) - 1e-9;
    let mut edges = half_edges(&points);
    edges.sort_unstable_by_key(|e| (e.ends, e.corners[0]));
    for around in edges.chunk_by(|a, b| a.ends == b.ends) {
        let around = &around[..around.len().min(MAX_AROUND)];
        let bend =
            |a: &HalfEdge, b: &HalfEdge| normals[a.corners[0] as usize / 3].dot(normals[b.corners[0] as usize / 3]);
        for edge in around.iter().filter(|e| e.is_forward) {
            let others = around.iter().filter(|o| !o.is_forward).map(|o| (bend(edge, o), o));
            let least = others.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(cos, _)| *cos >= cosine);
            for (k, other) in least.iter().flat_map(|(_, o)| o.corners.iter().enumerate()) {
                join(&mut groups, edge.corners[k], *other);
            }
        }
    }
    drop(edges);

    // the sum of each group, which its first corner has
    let mut sums = vec![DVec3::ZERO; points.len()];
    for corner in 0..points.len() {
        let root = find(&mut groups, corner as u32);
        sums[root as usize] += normals[corner / 3] * f64::from(angles[corner]);
    }

    // vertices have the normal of their group
    let mut first = 0;
    let mut sources = Vec::with_capacity(meshes.len());
    for mesh in meshes {
        let corners = 3 * mesh.indices.len();
        mesh.normals = Vec::new();
        let Split { source, keys } = split(mesh, |corner| find(&mut groups, (first + corner) as u32));
        let normal = |root: Option<u32>| {
            root.map_or(Vec3::Z, |root| {
                // a triangle without an area has no normal, and will not be seen
                let own = Some(normals[root as usize / 3]).filter(|n| *n != DVec3::ZERO);
                sums[root as usize].try_normalize().or(own).unwrap_or(DVec3::Z).as_vec3()
            })
        };
        mesh.normals = keys.into_iter().map(normal).collect();
        sources.push(source);
        first += corners;
    }
    sources
}

/// The sides of all triangles, whose corners are at these points.
fn half_edges(points: &[u32]) -> Vec<HalfEdge> {
    let side = |corner: usize| {
        let next = corner - corner % 3 + (corner + 1) % 3;
        let [a, b] = [corner, next].map(|c| (points[c], c as u32));
        let is_forward = a.0 < b.0;
        let [from, to] = if is_forward { [a, b] } else { [b, a] };
        HalfEdge { ends: [from.0, to.0], corners: [from.1, to.1], is_forward }
    };
    (0..points.len()).map(side).filter(|e| e.ends[0] != e.ends[1]).collect()
}

/// The first corner of a group; the way to it gets shorter.
fn find(groups: &mut [u32], mut corner: u32) -> u32 {
    while groups[corner as usize] != corner {
        let next = groups[corner as usize];
        groups[corner as usize] = groups[next as usize];
        corner = next;
    }
    corner
}

fn join(groups: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(groups, a), find(groups, b));
    groups[a.max(b) as usize] = a.min(b);
}
