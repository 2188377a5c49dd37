//! Spheres for formats that know triangles only.

use std::collections::HashMap;

use glam::Vec3;

/// Maximum number of triangles for all spheres of a scene.
const BUDGET: u64 = 4_000_000;

/// An icosahedron whose triangles are split in four `level` times, on the unit sphere:
/// `20 * 4^level` triangles, counter-clockwise from outside.
pub(super) fn icosphere(level: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let phi = (1.0 + 5f32.sqrt()) * 0.5;
    let mut positions: Vec<Vec3> = [[0.0, 1.0, phi], [0.0, -1.0, phi], [0.0, 1.0, -phi], [0.0, -1.0, -phi]]
        .into_iter()
        .flat_map(|[a, b, c]| [Vec3::new(a, b, c), Vec3::new(b, c, a), Vec3::new(c, a, b)])
        .map(Vec3::normalize)
        .collect();
    let mut triangles = Vec::new();
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| positions[i as usize]);
                // the 20 triples whose three edges are all the shortest
                if p.distance(q) < 1.1 && q.distance(r) < 1.1 && r.distance(p) < 1.1 {
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..level {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (positions, triangles)
}

/// Subdivision level for a scene of `spheres` spheres: 20480 triangles each for a few, fewer for
/// many.
pub(super) fn level(spheres: u64) -> u32 {
    (1..=5).rev().find(|l| spheres.saturating_mul(20 << (2 * l)) <= BUDGET).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_a_closed_sphere() {
        for level in 0..3 {
            let (p, t) = icosphere(level);
            assert_eq!((p.len(), t.len()), (10 * (1 << (2 * level)) + 2, 20 << (2 * level)));
            let volume: f32 = t.iter().map(|t| t.map(|i| p[i as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
            assert!(volume > 2.5 && volume < 4.19, "{volume}");
        }
    }

    #[test]
    fn budget() {
        assert_eq!((level(1), level(1000), level(u64::MAX)), (5, 3, 1));
    }
}
