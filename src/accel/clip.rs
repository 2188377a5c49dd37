//! The part of a primitive that lies in a cell, as a box: what a spatial split leaves of it on
//! either side.
//!
//! Conservative: rounding only ever makes the box larger, so the boxes of all parts together hold
//! the primitive.

use glam::{DVec3, Vec3};

use super::Aabb;

/// The triangles that a primitive consists of.
pub trait Triangles: Sync {
    /// Calls `see` with each triangle of a primitive; with none for a primitive that must not be
    /// split.
    fn each(&self, primitive: u32, see: &mut dyn FnMut([Vec3; 3]));
}

impl<F: Fn(u32, &mut dyn FnMut([Vec3; 3])) + Sync> Triangles for F {
    fn each(&self, primitive: u32, see: &mut dyn FnMut([Vec3; 3])) {
        self(primitive, see)
    }
}

/// A box around the part of a primitive that lies in a cell, itself in the cell. None if there is
/// no such part.
pub fn clip(primitive: u32, cell: Aabb, triangles: &impl Triangles) -> Option<Aabb> {
    let (mut min, mut max, mut reach) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0f64);
    triangles.each(primitive, &mut |t| {
        let t = t.map(Vec3::as_dvec3);
        reach = t.iter().fold(reach, |r, p| r.max(p.abs().max_element()));
        let mut polygon = Polygon::from_corners(t);
        for axis in 0..3 {
            polygon.keep(axis, cell.min[axis] as f64, 1.0);
            polygon.keep(axis, cell.max[axis] as f64, -1.0);
        }
        if polygon.overflowed {
            (min, max) = (min.min(cell.min.as_dvec3()), max.max(cell.max.as_dvec3()));
        }
        for &p in polygon.points() {
            (min, max) = (min.min(p), max.max(p));
        }
    });
    if min.x > max.x {
        return None;
    }
    // points of the clipped polygon are off by some 1e-15 of the triangle's largest coordinate
    let slack = 1e-13 * reach;
    let down = |v: DVec3| Vec3::from_array((v - slack).to_array().map(|x| (x as f32).next_down()));
    let up = |v: DVec3| Vec3::from_array((v + slack).to_array().map(|x| (x as f32).next_up()));
    let out = Aabb { min: down(min).max(cell.min), max: up(max).min(cell.max) };
    out.min.cmple(out.max).all().then_some(out)
}

/// A convex polygon: a triangle clipped by six planes, which is nine corners, or a few more where
/// rounding bends a sliver.
struct Polygon {
    points: [DVec3; 12],
    count: usize,
    /// The polygon had more corners than the array.
    overflowed: bool,
}

impl Polygon {
    fn from_corners([a, b, c]: [DVec3; 3]) -> Self {
        let mut points = [DVec3::ZERO; 12];
        points[..3].copy_from_slice(&[a, b, c]);
        Self { points, count: 3, overflowed: false }
    }

    fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// Clips the polygon against a plane and keeps one side (Sutherland and Hodgman 1974).
    fn keep(&mut self, axis: usize, at: f64, sign: f64) {
        let (old, n) = (self.points, self.count);
        self.count = 0;
        for k in 0..n {
            let (p, q) = (old[k], old[(k + 1) % n]);
            let (u, v) = ((p[axis] - at) * sign, (q[axis] - at) * sign);
            if u >= 0.0 {
                self.push(p);
            }
            if (u > 0.0 && v < 0.0) || (u < 0.0 && v > 0.0) {
                let mut x = p + (q - p) * (u / (u - v));
                x[axis] = at;
                self.push(x);
            }
        }
    }

    fn push(&mut self, p: DVec3) {
        match self.points.get_mut(self.count) {
            Some(to) => {
                *to = p;
                self.count += 1;
            }
            None => self.overflowed = true,
        }
    }
}
