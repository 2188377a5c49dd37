//! How large a box looks to rays: the projected area that takes the place of the surface area in
//! Falcone's heuristic (2024), for rays of one direction, of one point, and of one point within a
//! frustum.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};

use super::hull;
use crate::accel::Aabb;

/// The distribution of the rays that a tree is built for, or judged by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RayDistribution {
    /// From everywhere in every direction: the assumption of the surface-area heuristic.
    #[default]
    Uniform,
    /// Rays of one direction (of any length but 0): those of a sun or an orthographic camera.
    Parallel(DVec3),
    /// Rays through one point, in all directions: those of a point light.
    Point(DVec3),
    /// Rays through one point within a frustum: those of a camera.
    View(View),
}

/// A frustum with its apex at the eye. The axes are orthonormal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Apex.
    pub eye: DVec3,
    /// Axis to the right.
    pub right: DVec3,
    /// Axis upwards.
    pub up: DVec3,
    /// Axis of the view.
    pub forward: DVec3,
    /// Tangents of half the angles of view, horizontal and vertical.
    pub tangents: DVec2,
}

impl View {
    /// A view along `forward` (not zero), with tangents of half its angles. Up is y where the view
    /// does not look along it.
    pub fn new(eye: DVec3, forward: DVec3, tangents: DVec2) -> Self {
        let [right, up, forward] = frame(forward);
        Self { eye, right, up, forward, tangents }
    }

    /// Position of a point on the plane at distance 1, and its depth along the axis.
    fn project(&self, p: DVec3) -> (DVec2, f64) {
        let p = p - self.eye;
        let depth = p.dot(self.forward);
        (DVec2::new(p.dot(self.right), p.dot(self.up)) / depth, depth)
    }

    /// Area of the part of a box within the frustum, on the plane at distance 1.
    fn area(&self, bounds: &Aabb) -> f64 {
        let contour = hull::contour(hull::faces_seen(bounds, self.eye)).corners();
        if contour.is_empty() {
            // the eye is inside, and every ray meets the box
            return 4.0 * self.tangents.x * self.tangents.y;
        }
        let depths = (0..8).map(|k| (hull::corner(bounds, k) - self.eye).dot(self.forward));
        let (nearest, farthest) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |d, x| (d.0.min(x), d.1.max(x)));
        let near = 1e-6 * farthest;
        if farthest <= 0.0 {
            return 0.0;
        }
        let polygon: Vec<DVec2> = if nearest > near {
            contour.iter().map(|&k| self.project(hull::corner(bounds, k)).0).collect()
        } else {
            convex_hull(self.in_front(bounds, near).into_iter().map(|p| self.project(p).0).collect())
        };
        polygon_area(&clip_to_window(polygon, self.tangents))
    }

    /// Corners of the part of a box that lies at least `near` in front of the eye.
    fn in_front(&self, bounds: &Aabb, near: f64) -> Vec<DVec3> {
        let depth = |p: DVec3| (p - self.eye).dot(self.forward) - near;
        let corners: [DVec3; 8] = std::array::from_fn(|k| hull::corner(bounds, k as u8));
        let mut points: Vec<DVec3> = corners.into_iter().filter(|&p| depth(p) >= 0.0).collect();
        for from in 0..8usize {
            for axis in (0..3).filter(|a| from >> a & 1 == 0) {
                let (p, q) = (corners[from], corners[from | 1 << axis]);
                let (a, b) = (depth(p), depth(q));
                if (a < 0.0) != (b < 0.0) {
                    points.push(p + (q - p) * (a / (a - b)));
                }
            }
        }
        points
    }
}

impl RayDistribution {
    /// The measure of the rays that meet a box: two boxes, one in the other, are met in proportion
    /// to it. Half of the surface area; the area of the projection; the solid angle, which is the
    /// whole sphere where the eye is inside; or the area on the image.
    pub fn measure(&self, bounds: &Aabb) -> f64 {
        if !bounds.min.cmple(bounds.max).all() {
            return 0.0;
        }
        let e = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).max(DVec3::ZERO);
        let faces = DVec3::new(e.y * e.z, e.x * e.z, e.x * e.y);
        match self {
            Self::Uniform => faces.element_sum(),
            Self::Parallel(v) => v.abs().dot(faces) / v.length(),
            Self::Point(eye) => solid_angle(bounds, *eye),
            Self::View(view) => view.area(bounds),
        }
    }

    /// The direction of the rays that meet a point, of any length; `None` where they have many.
    pub fn direction_at(&self, point: DVec3) -> Option<DVec3> {
        match self {
            Self::Uniform => None,
            Self::Parallel(v) => Some(*v),
            Self::Point(eye) | Self::View(View { eye, .. }) => Some(point - *eye).filter(|d| *d != DVec3::ZERO),
        }
    }

    /// The same rays in another space. A frustum need not be one there, and becomes its eye.
    pub fn transformed(&self, by: &DAffine3) -> Self {
        match self {
            Self::Uniform => Self::Uniform,
            Self::Parallel(v) => Self::Parallel(by.transform_vector3(*v)),
            Self::Point(eye) | Self::View(View { eye, .. }) => Self::Point(by.transform_point3(*eye)),
        }
    }

    /// The same rays as seen from another origin.
    pub fn relative_to(&self, origin: DVec3) -> Self {
        match *self {
            Self::Point(eye) => Self::Point(eye - origin),
            Self::View(view) => Self::View(View { eye: view.eye - origin, ..view }),
            other => other,
        }
    }

    /// The rays in words.
    pub fn describe(&self) -> String {
        let triple = |v: &DVec3| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
        match self {
            Self::Uniform => "rays from everywhere".into(),
            Self::Parallel(v) => format!("parallel rays along {}", triple(v)),
            Self::Point(eye) => format!("rays through {}", triple(eye)),
            Self::View(view) => format!("the view from {} along {}", triple(&view.eye), triple(&view.forward)),
        }
    }
}

/// An orthonormal frame whose third axis lies along a direction (not zero): right, up, forward.
pub fn frame(forward: DVec3) -> [DVec3; 3] {
    let forward = forward.normalize_or(DVec3::NEG_Z);
    let right = forward.cross(DVec3::Y);
    let right = if right.length_squared() > 1e-12 { right.normalize() } else { DVec3::X };
    [right, right.cross(forward), forward]
}

/// Solid angle of a box as seen from a point, steradians; 4 pi from inside.
fn solid_angle(bounds: &Aabb, eye: DVec3) -> f64 {
    let contour = hull::contour(hull::faces_seen(bounds, eye)).corners();
    let Some((&first, rest)) = contour.split_first() else { return 4.0 * PI };
    let towards = |k: u8| hull::corner(bounds, k) - eye;
    // a fan of triangles over the contour (van Oosterom and Strackee 1983)
    let a = towards(first);
    rest.windows(2)
        .map(|pair| {
            let (b, c) = (towards(pair[0]), towards(pair[1]));
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let y = a.dot(b.cross(c)).abs();
            let x = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
            2.0 * y.atan2(x)
        })
        .sum()
}

/// The part of a convex polygon within |x|, |y| <= half (Sutherland and Hodgman 1974).
fn clip_to_window(mut polygon: Vec<DVec2>, half: DVec2) -> Vec<DVec2> {
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        let distance = |p: DVec2| half[axis] - sign * p[axis];
        let n = polygon.len();
        let mut kept = Vec::with_capacity(n + 1);
        for k in 0..n {
            let (p, q) = (polygon[k], polygon[(k + 1) % n]);
            let (u, v) = (distance(p), distance(q));
            if u >= 0.0 {
                kept.push(p);
            }
            if (u > 0.0 && v < 0.0) || (u < 0.0 && v > 0.0) {
                kept.push(p + (q - p) * (u / (u - v)));
            }
        }
        polygon = kept;
    }
    polygon
}

/// Area of a polygon by the shoelace formula.
fn polygon_area(polygon: &[DVec2]) -> f64 {
    let n = polygon.len();
    0.5 * (0..n).map(|k| polygon[k].perp_dot(polygon[(k + 1) % n])).sum::<f64>().abs()
}

/// The convex hull of points, counter-clockwise (Andrew's monotone chain).
pub(super) fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use glam::Vec3;

    const SEED: u64 = 0x1234_5678_9abc_def1;

    /// Numbers in [0, 1), the same on every machine.
    pub(in super::super) fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    fn some_box(next: &mut impl FnMut() -> f64) -> Aabb {
        let lo = Vec3::new(next() as f32, next() as f32, next() as f32) * 4.0 - 2.0;
        Aabb { min: lo, max: lo + Vec3::new(next() as f32, next() as f32, next() as f32) * 1.5 + 0.05 }
    }

    fn is_met(bounds: &Aabb, origin: DVec3, direction: DVec3, whole_line: bool) -> bool {
        let (mut near, mut far) = (if whole_line { f64::NEG_INFINITY } else { 0.0 }, f64::INFINITY);
        for a in 0..3 {
            let t = [bounds.min[a], bounds.max[a]].map(|p| (f64::from(p) - origin[a]) / direction[a]);
            near = near.max(t[0].min(t[1]));
            far = far.min(t[0].max(t[1]));
        }
        near <= far
    }

    fn check(name: &str, got: f64, hits: usize, tries: usize, whole: f64) {
        let p = hits as f64 / tries as f64;
        // a sliver may have no hit at all
        let expected = p.max(got / whole).min(1.0);
        let sigma = whole * (expected * (1.0 - expected) / tries as f64).sqrt();
        assert!(
            (got - whole * p).abs() <= 4.5 * sigma + 1e-9 * whole,
            "{name}: {got} against {} +- {sigma}",
            whole * p
        );
    }

    #[test]
    fn parallel_projection_is_that_of_random_lines() {
        let mut next = numbers(SEED);
        for case in 0..8 {
            let bounds = some_box(&mut next);
            let v = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5) * (1.0 + 5.0 * next());
            let v = if case == 0 { DVec3::new(0.0, -2.0, 0.0) } else { v };
            let [right, up, forward] = frame(v);
            let (tries, mut hits) = (40_000, 0);
            for _ in 0..tries {
                // lines through a square that holds the projection of the box; no exact zeros
                let at = (right * (next() - 0.5) + up * (next() - 0.5)) * 14.0;
                hits += usize::from(is_met(&bounds, at + 1e-9, forward + 1e-12, true));
            }
            check(&format!("{bounds:?} {v}"), RayDistribution::Parallel(v).measure(&bounds), hits, tries, 14.0 * 14.0);
        }
    }

    #[test]
    fn solid_angles_are_those_of_random_directions() {
        let mut next = numbers(SEED);
        for case in 0..10 {
            let bounds = some_box(&mut next);
            let eye = DVec3::new(next(), next(), next()) * 6.0 - 3.0;
            let eye = if case == 0 { ((bounds.min + bounds.max) * 0.5).as_dvec3() } else { eye };
            let (tries, mut hits) = (40_000, 0);
            for _ in 0..tries {
                let z = 1.0 - 2.0 * next();
                let (sin, cos) = (2.0 * PI * next()).sin_cos();
                let r = (1.0 - z * z).sqrt();
                hits += usize::from(is_met(&bounds, eye, DVec3::new(r * cos, r * sin, z), false));
            }
            check(&format!("{bounds:?} {eye}"), RayDistribution::Point(eye).measure(&bounds), hits, tries, 4.0 * PI);
        }
    }

    /// Boxes before, behind, around and beside the eye: the share of the image that they cover.
    #[test]
    fn areas_in_a_view_are_those_of_random_points_of_the_image() {
        let mut next = numbers(SEED);
        let mut seen = 0;
        for case in 0..80 {
            let bounds = some_box(&mut next);
            let eye = DVec3::new(next(), next(), next()) * 3.0 - 1.5;
            let forward = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5);
            let view = View::new(eye, forward, DVec2::new(0.4 + next(), 0.3 + next()));
            let (tries, mut hits) = (20_000, 0);
            for _ in 0..tries {
                let at = (DVec2::new(next(), next()) * 2.0 - 1.0) * view.tangents;
                let direction = view.forward + view.right * at.x + view.up * at.y;
                hits += usize::from(is_met(&bounds, eye, direction, false));
            }
            seen += usize::from(hits > 0);
            let whole = 4.0 * view.tangents.x * view.tangents.y;
            // the plane just before the eye cuts off a sliver of boxes that reach to it
            let got = RayDistribution::View(view).measure(&bounds);
            check(&format!("{case}: {bounds:?} {view:?}"), got, hits, tries, whole);
        }
        assert!(seen > 15 && seen < 80, "{seen} boxes in view");
    }

    #[test]
    fn empty_and_flat_boxes_have_a_measure() {
        let flat = Aabb { min: Vec3::new(0.0, 1.0, 0.0), max: Vec3::new(2.0, 1.0, 3.0) };
        for rays in [
            RayDistribution::Uniform,
            RayDistribution::Parallel(DVec3::NEG_Y),
            RayDistribution::Point(DVec3::new(1.0, 4.0, 1.0)),
            RayDistribution::View(View::new(DVec3::new(1.0, 4.0, 1.0), DVec3::NEG_Y, DVec2::ONE)),
        ] {
            assert_eq!(rays.measure(&Aabb::EMPTY), 0.0);
            let m = rays.measure(&flat);
            assert!(m > 0.0 && m.is_finite(), "{rays:?} {m}");
        }
        assert_eq!(RayDistribution::Parallel(DVec3::X).measure(&flat), 0.0);
        assert_eq!(RayDistribution::Parallel(DVec3::Y * 7.0).measure(&flat), 6.0);
    }
}
