//! The contour of a box as seen from a point: which of its corners, in which order, make the convex
//! hull of its projection. A table of six bits has it (Schmalstieg and Tobler, "Real-Time Bounding
//! Box Area Computation", 1999; algorithm 5.4 of Falcone 2024): which faces the eye is beyond.
//!
//! The table is computed instead of typed: an edge belongs to the contour where one of its two
//! faces is seen and the other is not, and such edges form one loop.

use std::sync::LazyLock;

use glam::DVec3;

use crate::accel::Aabb;

/// Corners of a box on its contour, in order around it: bit 0, 1, 2 of a corner is set where it is
/// the upper one along x, y, z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contour {
    corners: [u8; 6],
    count: u8,
}

impl Contour {
    /// The corners, 4 or 6; none where the eye is in the box, or where the bits contradict.
    pub fn corners(&self) -> &[u8] {
        &self.corners[..self.count as usize]
    }
}

static TABLE: LazyLock<[Contour; 64]> = LazyLock::new(|| std::array::from_fn(contour_of_faces));

/// The faces of a box that a point is beyond, as bits: lower and upper along x, y, z.
pub fn faces_seen(bounds: &Aabb, eye: DVec3) -> usize {
    let (lo, hi) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    (0..3).fold(0, |bits, a| bits | usize::from(eye[a] < lo[a]) << (2 * a) | usize::from(eye[a] > hi[a]) << (2 * a + 1))
}

/// The contour of a box of which these faces are seen ([`faces_seen`]).
pub fn contour(faces: usize) -> &'static Contour {
    &TABLE[faces & 63]
}

/// The position of a corner.
pub fn corner(bounds: &Aabb, corner: u8) -> DVec3 {
    let pick = |a: usize| f64::from(if corner >> a & 1 == 0 { bounds.min[a] } else { bounds.max[a] });
    DVec3::new(pick(0), pick(1), pick(2))
}

fn contour_of_faces(faces: usize) -> Contour {
    if (0..3).any(|a| faces >> (2 * a) & 3 == 3) {
        return Contour::default();
    }

    // edges between a face that is seen and one that is not
    let mut edges = Vec::new();
    for along in 0..3 {
        let (b, c) = ((along + 1) % 3, (along + 2) % 3);
        for (side_b, side_c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let is_seen = |axis: usize, side: usize| faces >> (2 * axis + side) & 1 == 1;
            if is_seen(b, side_b) != is_seen(c, side_c) {
                let from = (side_b << b | side_c << c) as u8;
                edges.push([from, from | 1 << along]);
            }
        }
    }

    // from edge to edge around the loop
    let mut out = Contour::default();
    let Some(mut at) = edges.first().map(|e| e[0]) else { return out };
    while let Some(next) = edges.iter().position(|e| e.contains(&at)) {
        out.corners[out.count as usize] = at;
        out.count += 1;
        let [a, b] = edges.swap_remove(next);
        at = if a == at { b } else { a };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::projection::convex_hull;
    use super::*;
    use glam::{DVec2, Vec3};

    /// Eyes in all 27 regions around a box: the contour is the convex hull of the eight projected
    /// corners, corner for corner.
    #[test]
    fn contours_are_convex_hulls_in_all_regions() {
        let bounds = Aabb { min: Vec3::new(-1.0, -2.0, -0.5), max: Vec3::new(1.5, 2.5, 0.75) };
        let mut outside = 0;
        for region in 0..27 {
            let place = |a: usize, k: usize| {
                let (lo, hi) = (f64::from(bounds.min[a]), f64::from(bounds.max[a]));
                [lo - 3.7 - 0.3 * a as f64, lo + (hi - lo) * (0.4 + 0.07 * a as f64), hi + 2.9 + 0.4 * a as f64][k]
            };
            let eye = DVec3::new(place(0, region % 3), place(1, region / 3 % 3), place(2, region / 9));
            let corners = contour(faces_seen(&bounds, eye)).corners();
            if region == 13 {
                assert!(corners.is_empty(), "the eye is inside");
                continue;
            }
            outside += 1;
            let centre = ((bounds.min + bounds.max) * 0.5).as_dvec3();
            let forward = (centre - eye).normalize();
            let right = forward.any_orthonormal_vector();
            let up = forward.cross(right);
            let project = |k: u8| {
                let p = corner(&bounds, k) - eye;
                DVec2::new(p.dot(right), p.dot(up)) / p.dot(forward)
            };
            let all: Vec<DVec2> = (0..8).map(project).collect();
            let hull = convex_hull(all.clone());
            let seen: Vec<DVec2> = corners.iter().map(|&k| all[usize::from(k)]).collect();
            assert_eq!(seen.len(), hull.len(), "region {region}: {corners:?}");
            // the same loop, from another start or the other way round
            let start = hull.iter().position(|p| *p == seen[0]).unwrap();
            let n = hull.len();
            let forwards = (0..n).all(|k| hull[(start + k) % n] == seen[k]);
            let backwards = (0..n).all(|k| hull[(start + n - k) % n] == seen[k]);
            assert!(forwards || backwards, "region {region}: {corners:?}");
        }
        assert_eq!(outside, 26);
    }

    /// Bits of both faces of an axis are of no point.
    #[test]
    fn codes_of_no_region_have_no_contour() {
        let valid = (0..64).filter(|&k| !contour(k).corners().is_empty()).count();
        assert_eq!(valid, 26);
        assert!(contour(3).corners().is_empty() && contour(0).corners().is_empty());
    }
}
