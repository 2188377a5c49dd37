//! Convex regions with six faces, an oriented box or a frustum: what is in them, what touches them
//! (by the separating-axis theorem), and where a ray leaves them.

use glam::{DVec2, DVec3};

use super::body::{LabRay, Shape};
use super::projection::View;
use crate::accel::Aabb;

/// A convex region: eight corners, of which those at the apex of a frustum may coincide.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    corners: [DVec3; 8],
    /// Outward normals of unit length and distances from the origin: inside is n.p <= d.
    planes: [(DVec3, f64); 6],
    /// Directions of the edges.
    edges: Vec<DVec3>,
    /// Distance within which things count as touching: far above the rounding of single precision,
    /// in which rays are recorded.
    slack: f64,
}

impl Region {
    /// A box: a corner in the middle of its first face, axes of unit length at right angles, half
    /// extents along the first two, and the length along the third.
    pub fn oriented_box(from: DVec3, axes: [DVec3; 3], half: DVec2, length: f64) -> Self {
        let [right, up, forward] = axes;
        Self::new(|k, depth| {
            let side = DVec2::new(sign(k), sign(k >> 1)) * half;
            from + right * side.x + up * side.y + forward * (depth * length)
        })
    }

    /// The part of a view between two distances; `near` may be 0.
    pub fn frustum(view: &View, near: f64, far: f64) -> Self {
        Self::new(|k, depth| {
            let depth = near + (far - near) * depth;
            let side = DVec2::new(sign(k), sign(k >> 1)) * view.tangents * depth;
            view.eye + view.right * side.x + view.up * side.y + view.forward * depth
        })
    }

    /// A region from its corners: numbers 0 to 3 (right in bit 0, up in bit 1) on the near face (0)
    /// and on the far one (1).
    fn new(corner: impl Fn(usize, f64) -> DVec3) -> Self {
        let corners: [DVec3; 8] = std::array::from_fn(|k| corner(k & 3, (k >> 2) as f64));
        let middle = corners.iter().sum::<DVec3>() / 8.0;
        let far_side = |a: usize, b: usize| corners[b] - corners[a];
        let (right, up) = (far_side(4, 5), far_side(4, 6));
        let sides: [DVec3; 4] = std::array::from_fn(|k| far_side(k, k + 4));

        // faces: near, far, and the four between the side edges
        let normals = [
            (right.cross(up), 0),
            (right.cross(up), 4),
            (up.cross(sides[0]), 4),
            (up.cross(sides[1]), 5),
            (right.cross(sides[0]), 4),
            (right.cross(sides[2]), 6),
        ];
        let planes = normals.map(|(n, at)| {
            let n = n.normalize_or_zero();
            let n = if n.dot(middle - corners[at]) > 0.0 { -n } else { n };
            (n, n.dot(corners[at]))
        });
        let reach = corners.iter().fold(0.0, |m: f64, c| m.max(c.abs().max_element()));
        Self { corners, planes, edges: [&[right, up], &sides[..]].concat(), slack: 1e-6 * reach }
    }

    /// The same region with more slack: within this distance of it, too, things count as touching.
    pub fn widened(&self, by: f64) -> Self {
        Self { slack: self.slack + by, ..self.clone() }
    }

    /// The same region as seen from another origin.
    pub fn relative_to(&self, origin: DVec3) -> Self {
        let corners = self.corners.map(|c| c - origin);
        Self { corners, planes: self.planes.map(|(n, d)| (n, d - n.dot(origin))), ..self.clone() }
    }

    /// The distance within which things count as touching.
    pub fn slack(&self) -> f64 {
        self.slack
    }

    /// The largest coordinate of a corner.
    pub fn reach(&self) -> f64 {
        self.corners.iter().fold(0.0, |m: f64, c| m.max(c.abs().max_element()))
    }

    /// Outward normals of unit length of its faces, and their distances from the origin: a point p
    /// is inside where n.p is at most the distance.
    pub fn planes(&self) -> &[(DVec3, f64); 6] {
        &self.planes
    }

    /// The corners.
    pub fn corners(&self) -> &[DVec3; 8] {
        &self.corners
    }

    /// The box around it, rounded outwards.
    pub fn bounds(&self) -> Aabb {
        let (lo, hi) =
            self.corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, c| (b.0.min(*c), b.1.max(*c)));
        let out = |v: DVec3, f: fn(f32) -> f32| glam::Vec3::from_array(v.to_array().map(|x| f(x as f32)));
        Aabb { min: out(lo - self.slack, f32::next_down), max: out(hi + self.slack, f32::next_up) }
    }

    /// Whether a point is in it or on its surface.
    pub fn contains(&self, p: DVec3) -> bool {
        self.planes.iter().all(|(n, d)| n.dot(p) <= d + self.slack)
    }

    /// Whether a box lies in it as a whole.
    pub fn contains_box(&self, b: &Aabb) -> bool {
        (0..8).all(|k| self.contains(super::hull::corner(b, k)))
    }

    /// Whether a box has a common point with it. It may say so of boxes that are within rounding.
    pub fn touches_box(&self, b: &Aabb) -> bool {
        let corners: [DVec3; 8] = std::array::from_fn(|k| super::hull::corner(b, k as u8));
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let crossed = self.edges.iter().flat_map(|e| axes.map(|a| e.cross(a)));
        !self.is_separated(&corners, axes.into_iter().chain(crossed))
    }

    /// Whether a primitive has a common point with it. It may say so of primitives that are within
    /// rounding, and of a sphere near an edge.
    pub fn touches(&self, shape: &Shape) -> bool {
        match shape {
            Shape::Triangle(corners) => {
                let corners = corners.map(|c| c.as_dvec3());
                let sides: [DVec3; 3] = std::array::from_fn(|k| corners[(k + 1) % 3] - corners[k]);
                let crossed = self.edges.iter().flat_map(|e| sides.map(|s| e.cross(s)));
                // a triangle without area has no normal; its sides across that of the region remain
                let normal = sides[0].cross(sides[1]);
                !self.is_separated(&corners, std::iter::once(normal).chain(crossed))
            }
            Shape::Sphere(centre, radius) => {
                let reach = f64::from(*radius) + self.slack;
                self.planes.iter().all(|(n, d)| n.dot(centre.as_dvec3()) <= d + reach)
            }
        }
    }

    /// Whether a plane lies between it and the hull of some points: one of its faces, or one across
    /// one of these axes.
    fn is_separated(&self, points: &[DVec3], axes: impl Iterator<Item = DVec3>) -> bool {
        let range = |points: &[DVec3], axis: DVec3| {
            points.iter().map(|p| p.dot(axis)).fold((f64::INFINITY, f64::NEG_INFINITY), |r, x| (r.0.min(x), r.1.max(x)))
        };
        let by_faces = self.planes.iter().any(|(n, d)| range(points, *n).0 > d + self.slack);
        by_faces
            || axes.filter_map(DVec3::try_normalize).any(|axis| {
                let (a, b) = (range(&self.corners, axis), range(points, axis));
                a.0 > b.1 + self.slack || b.0 > a.1 + self.slack
            })
    }

    /// The parameter at which a ray that starts inside leaves it; infinite for a ray without end
    /// inside, which there is none of.
    pub fn exit(&self, ray: &LabRay) -> f64 {
        let leave = |(n, d): &(DVec3, f64)| {
            let along = n.dot(ray.direction);
            if along > 0.0 { (d - n.dot(ray.origin)) / along } else { f64::INFINITY }
        };
        self.planes.iter().map(leave).fold(f64::INFINITY, f64::min)
    }
}

fn sign(bit: usize) -> f64 {
    if bit & 1 == 0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::projection::frame;
    use super::super::projection::tests::numbers;
    use super::*;
    use glam::Vec3;

    const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

    fn regions(next: &mut impl FnMut() -> f64) -> Vec<Region> {
        let mut triple = || DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
        let (a, b, c) = (triple(), triple(), triple());
        let view = View::new(a, b, DVec2::new(0.3 + next(), 0.3 + next()));
        vec![
            Region::oriented_box(c, frame(b), DVec2::new(0.2 + next(), 0.1 + next()), 0.3 + next()),
            Region::frustum(&view, 0.0, 1.5),
            Region::frustum(&view, 0.4, 1.2),
        ]
    }

    /// The distance between a region and the hull of points, from above, by alternating projections
    /// on both (von Neumann): a brute-force oracle that knows no separating axis.
    fn distance(region: &Region, points: &[DVec3]) -> f64 {
        // Frank and Wolfe's method for the nearest point of the Minkowski difference to 0, whose
        // support is that of both sets
        let support = |d: DVec3| {
            let far = |p: &[DVec3], d: DVec3| *p.iter().max_by(|a, b| a.dot(d).total_cmp(&b.dot(d))).unwrap();
            far(region.corners(), d) - far(points, -d)
        };
        let mut x = support(DVec3::X);
        for _ in 0..4000 {
            let s = support(-x);
            let step = x - s;
            if x.dot(step) <= 1e-12 {
                break;
            }
            x -= step * (x.dot(step) / step.length_squared()).clamp(0.0, 1.0);
        }
        x.length()
    }

    #[test]
    fn touching_is_what_a_search_for_the_distance_finds() {
        let mut next = numbers(SEED);
        let (mut apart, mut touching, mut close) = (0, 0, 0);
        for _ in 0..150 {
            for region in regions(&mut next) {
                for _ in 0..6 {
                    let mut point = || Vec3::new(next() as f32, next() as f32, next() as f32) * 4.0 - 2.0;
                    let (a, b, c) = (point(), point(), point());
                    let size = 0.2 + 0.8 * next() as f32;
                    let corners = [a, a + (b - a) * size, a + (c - a) * size];
                    let found = distance(&region, &corners.map(|v| v.as_dvec3()));
                    let bounds = Aabb::of_points(&corners);
                    let of_box = distance(
                        &region,
                        &std::array::from_fn::<_, 8, _>(|k| super::super::hull::corner(&bounds, k as u8)),
                    );
                    for (claim, distance) in
                        [(region.touches(&Shape::Triangle(corners)), found), (region.touches_box(&bounds), of_box)]
                    {
                        // the search converges slowly: what it leaves open is counted
                        if distance > 0.02 {
                            assert!(!claim, "{distance}: {corners:?} {region:?}");
                            apart += 1;
                        } else if distance < 1e-7 {
                            assert!(claim, "{distance}: {corners:?} {region:?}");
                            touching += 1;
                        } else {
                            close += 1;
                        }
                    }
                }
            }
        }
        assert!(apart > 1000 && touching > 500 && close < (apart + touching) / 4, "{apart} {touching} {close}");
    }

    /// A point of a triangle in the region is a proof: no triangle with one may be denied.
    #[test]
    fn triangles_with_a_point_inside_touch() {
        let mut next = numbers(SEED);
        for _ in 0..300 {
            for region in regions(&mut next) {
                let mut weights = || next();
                let mut inside = DVec3::ZERO;
                let w: Vec<f64> = (0..8).map(|_| weights()).collect();
                for (k, c) in region.corners().iter().enumerate() {
                    inside += *c * (w[k] / w.iter().sum::<f64>());
                }
                assert!(region.contains(inside));
                let direction = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
                let other = direction.any_orthogonal_vector();
                // a large triangle around the point, whose corners are all outside
                let corners =
                    [direction, -direction + other, -direction - other].map(|d| (inside + d * 30.0).as_vec3());
                let corners = corners.map(|c| c + (inside.as_vec3() - (corners[0] + corners[1] + corners[2]) / 3.0));
                assert!(region.touches(&Shape::Triangle(corners)), "{inside} {corners:?} {region:?}");
                assert!(region.touches(&Shape::Sphere(inside.as_vec3(), 0.0)));
            }
        }
    }

    #[test]
    fn rays_leave_where_they_are_no_longer_inside() {
        let mut next = numbers(SEED);
        for _ in 0..200 {
            for region in regions(&mut next) {
                let start = region.corners().iter().sum::<DVec3>() / 8.0;
                let direction = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
                let ray = LabRay::new(start, direction, 0.0, f64::INFINITY);
                let t = region.exit(&ray);
                assert!(region.contains(ray.at(t * 0.9999)) && !region.contains(ray.at(t * 1.0001)), "{t}");
            }
        }
    }
}
