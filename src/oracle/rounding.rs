//! Decides which answers of a single-precision tracer are within its rounding error.
//!
//! **Error model.** A tracer in `f32` is taken to answer exactly, but for slightly wrong data
//! (backward error analysis, Higham 2002): every vertex and the ray's line may be displaced by
//!
//! ```text
//! delta = ulps * 2^-23 * k * (|o| + max|v| + |T|)      (lengths are Euclidean)
//! ```
//!
//! `o` is the ray's origin and `v` the primitive's vertices, relative to the tracer's zero:
//! rounding a coordinate, or a difference of two, errs in proportion to the coordinate. Where an
//! instance's transform is applied to the ray, its translation `T` is another such coordinate, and
//! going to object space and back amplifies the error by the condition number `k` of the matrix (1
//! for rotation and uniform scale). `ulps` (16) covers the chain: two transforms of three products
//! each, subtraction, shear, and the products of the edge functions, each at most a few halves of
//! an ulp. An error of the direction in proportion to `2^-23` moves the line at distance `s` by
//! `s * 2^-23`, and `s <= |o| + max|v|`.
//!
//! **Consequences**, all in double precision. Seen along the ray,
//! - a line that passes the boundary of a triangle (or the silhouette of a sphere) at more than
//!   `delta` certainly meets or misses it; nearer, it may do either: edges and vertices that
//!   triangles share, cracks between coincident ones, grazing rays, whose triangles appear as
//!   slivers;
//! - the parameter of a hit errs by at most `delta / (|d| cos)`, with `cos` between ray and normal,
//!   plus its own rounding, and never leaves the primitive's extent along the ray by more than
//!   `delta`;
//! - a triangle's edge functions are differences of products of corners' distances from the ray,
//!   which round in proportion to those (pbrt-v4, 6.8.7, `delta_e`). That moves a weight by
//!   `4 * 2^-23 * |p| |q| / area`, with `p` and `q` the ends of the edge seen along the ray: next
//!   to nothing, but for slivers, whose weights, and with them the parameter between the corners',
//!   are worth less than their corners. Signs are never wrong for it, so it makes nothing
//!   uncertain;
//! - where that interval contains `tmin` or `tmax`, the hit may count or not;
//! - where alpha crosses the cutoff within the error of the texture coordinates (and of a texture
//!   unit: 1/256 texel, 1/255 of the value), the surface may exist or not.
//!
//! So each primitive is *certainly hit*, *possibly hit* or *certainly missed*, over an interval of
//! parameters.

use super::alpha::AlphaUncertainty;
use super::primitive::{SpherePrimitive, Triangle};
use super::{Oracle, OracleRay};
use glam::DVec3;
use std::ops::ControlFlow;

/// The parameter of the error model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    /// Units of 2^-23 in `delta`; see the module's text.
    pub ulps: f64,
}

impl Default for Rounding {
    fn default() -> Self {
        Self { ulps: 16.0 }
    }
}

/// A hit that a tracer may, or must, report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Least parameter it may report.
    pub lo: f64,
    /// Greatest parameter it may report.
    pub hi: f64,
    /// A tracer must report it (unless it reports a nearer hit).
    pub certain: bool,
}

impl Candidate {
    const NEVER: Candidate = Candidate { lo: f64::INFINITY, hi: f64::NEG_INFINITY, certain: false };

    fn is_possible(&self) -> bool {
        self.lo <= self.hi
    }

    /// Restricts it to the ray's extent. Ends that fall within the interval make it uncertain.
    fn within(mut self, ray: &OracleRay) -> Self {
        if self.hi <= ray.tmin || self.lo >= ray.tmax {
            return Self::NEVER;
        }
        self.certain &= self.lo > ray.tmin && self.hi < ray.tmax;
        self
    }
}

impl Oracle {
    /// The hits with one primitive that a tracer may report for this ray (a sphere has two), or
    /// none when the primitive is certainly missed or does not exist.
    pub fn candidates(
        &self,
        ray: &OracleRay,
        instance: u32,
        primitive: u32,
        rounding: Rounding,
    ) -> impl Iterator<Item = Candidate> + use<> {
        let found =
            self.index_of(instance, primitive).map_or([Candidate::NEVER; 2], |i| self.candidates_of(i, ray, rounding));
        found.into_iter().filter(Candidate::is_possible)
    }

    /// Greatest parameter of the nearest certain hit; infinite if the ray may miss everything.
    pub fn certain_before(&self, ray: &OracleRay, rounding: Rounding) -> f64 {
        let mut best = f64::INFINITY;
        self.bvh.visit(ray, self.pad(ray), ray.tmax, |index| {
            for c in self.candidates_of(index, ray, rounding) {
                if c.certain {
                    best = best.min(c.hi);
                }
            }
            ControlFlow::Continue(best)
        });
        best
    }

    /// May the ray meet anything?
    pub fn possibly_any(&self, ray: &OracleRay, rounding: Rounding) -> bool {
        let worst = self.instances.iter().filter(|i| i.count > 0).map(|i| i.condition).fold(1.0, f64::max);
        let translation = self.instances.iter().map(|i| i.translation).fold(0.0, f64::max);
        let reach = ray.origin.length() + 2.0 * self.extent + translation;
        let pad = (rounding.ulps * f32::EPSILON as f64 * worst * reach).min(f64::MAX) + self.pad(ray);
        // extend the range before tmin and beyond tmax accordingly
        let slack = pad / ray.direction.length();
        let wide = OracleRay { tmin: ray.tmin - slack, ..*ray };
        let mut found = false;
        self.bvh.visit(&wide, pad, ray.tmax + slack, |index| {
            found = self.candidates_of(index, ray, rounding).iter().any(Candidate::is_possible);
            if found { ControlFlow::Break(()) } else { ControlFlow::Continue(f64::INFINITY) }
        });
        found
    }

    /// Barycentric weights of the three corners where the ray meets a triangle (or passes it most
    /// closely), and by how much each may be off, in a tracer's hit: a displacement of `delta`
    /// changes a weight by `delta` over the height that the triangle shows along the ray. `None`
    /// for a sphere and for what does not exist.
    pub fn weights(
        &self,
        ray: &OracleRay,
        instance: u32,
        primitive: u32,
        rounding: Rounding,
    ) -> Option<([f64; 3], [f64; 3])> {
        let triangle = self.triangles.get(self.index_of(instance, primitive)? as usize)?;
        let (delta, flat) = self.as_seen(triangle, ray, rounding);
        let [v, w] = triangle.intersect(ray).map_or_else(|| clamped_barycentrics(&flat), |(_, b)| b);
        // a weight is divided and stored in single precision besides
        let own = 8.0 * f32::EPSILON as f64;
        Some(([1.0 - v - w, v, w], weight_errors(&flat, delta).map(|e| e + own)))
    }

    /// The model's `delta` for a triangle, and its corners seen along the ray: relative to the
    /// ray's line, across it.
    fn as_seen(&self, triangle: &Triangle, ray: &OracleRay, rounding: Rounding) -> (f64, [DVec3; 3]) {
        let instance = &self.instances[triangle.instance as usize];
        let farthest = triangle.v.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
        let reach = ray.origin.length() + farthest + instance.translation;
        let delta = rounding.ulps * f32::EPSILON as f64 * instance.condition * reach;
        let d = ray.direction / ray.direction.length();
        (delta, triangle.v.map(|v| v - ray.origin).map(|c| c - d * c.dot(d)))
    }

    fn candidates_of(&self, index: u32, ray: &OracleRay, rounding: Rounding) -> [Candidate; 2] {
        match self.triangles.get(index as usize) {
            Some(triangle) => [self.triangle_candidate(triangle, ray, rounding).within(ray), Candidate::NEVER],
            None => {
                let sphere = &self.spheres[index as usize - self.triangles.len()];
                self.sphere_candidates(sphere, ray, rounding).map(|c| c.within(ray))
            }
        }
    }

    fn triangle_candidate(&self, triangle: &Triangle, ray: &OracleRay, rounding: Rounding) -> Candidate {
        let instance = &self.instances[triangle.instance as usize];

        // the triangle as the ray sees it, and how far rounding may move its corners
        let (delta, flat) = self.as_seen(triangle, ray, rounding);
        let length = ray.direction.length();
        let d = ray.direction / length;
        let corners = triangle.v.map(|v| v - ray.origin);
        let along = corners.map(|c| c.dot(d));
        let to_boundary = (0..3).map(|k| distance_to_segment(flat[k], flat[(k + 1) % 3])).fold(f64::INFINITY, f64::min);
        let inside = triangle.intersect(ray);
        if inside.is_none() && (to_boundary > delta || to_boundary.is_nan()) {
            return Candidate::NEVER;
        }

        // the interval of t by the plane, cut to the triangle's own extent (which alone holds where
        // the plane is edge-on)
        let normal = triangle.normal();
        let cos = normal.dot(d).abs();
        let t_plane = inside.map_or_else(|| normal.dot(corners[0]) / normal.dot(ray.direction), |(t, _)| t);
        let products = product_errors(&flat);
        let sliver: f64 = (0..3).map(|k| products[k] * (along[k] / length - t_plane).abs()).sum();
        let slack = 2.0 * delta / (length * cos) + 4.0 * f32::EPSILON as f64 * t_plane.abs() + sliver;
        let (first, last) =
            (along.iter().copied().fold(f64::INFINITY, f64::min), along.iter().copied().fold(f64::MIN, f64::max));
        let (first, last) = ((first - delta) / length, (last + delta) / length);
        let (mut lo, mut hi) = ((t_plane - slack).max(first), (t_plane + slack).min(last));
        if lo > hi {
            // the line passes the triangle outside: a reported hit can be anywhere on it
            (lo, hi) = (first, last);
        }

        // the reported parameter is rounded, too
        let rounded = 4.0 * f32::EPSILON as f64;
        (lo, hi) = (lo - rounded * lo.abs(), hi + rounded * hi.abs());

        // rounding of texture coordinates may change the alpha test
        let mut certain = inside.is_some() && to_boundary > delta;
        if let Some(alpha) = &instance.alpha {
            let weights = inside.map_or_else(|| clamped_barycentrics(&flat), |(_, b)| b);
            let barycentric = weight_errors(&flat, delta);
            let error = AlphaUncertainty { barycentric, texels: 1.0 / 256.0, value: 1.0 / 255.0 };
            let (always, ever) = alpha.presence(triangle.primitive, weights, &error);
            if !ever {
                return Candidate::NEVER;
            }
            certain &= always;
        }
        Candidate { lo, hi, certain }
    }

    /// In object space, where the sphere is round.
    fn sphere_candidates(&self, sphere: &SpherePrimitive, ray: &OracleRay, rounding: Rounding) -> [Candidate; 2] {
        let instance = &self.instances[sphere.instance as usize];
        if instance.alpha.as_ref().is_some_and(|a| !a.is_present(sphere.primitive, [0.0; 2])) {
            return [Candidate::NEVER; 2];
        }
        let origin = sphere.world_to_object.transform_point3(ray.origin);
        let direction = sphere.world_to_object.transform_vector3(ray.direction);
        let (length, r) = (direction.length(), sphere.radius);
        let norm = sphere.world_to_object.matrix3.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let reach = norm * (ray.origin.length() + instance.translation) + sphere.center.length() + r;
        let delta = rounding.ulps * f32::EPSILON as f64 * reach;
        let from = origin - sphere.center;
        let middle = -from.dot(direction) / (length * length);
        let miss_by = (from + direction * middle).length() - r;
        if miss_by > delta || miss_by.is_nan() {
            return [Candidate::NEVER; 2];
        }
        // between the half chords of the sphere shrunk and grown by delta lies every hit
        let b = miss_by + r;
        let half = |r: f64| ((r * r - b * b).max(0.0)).sqrt() / length;
        let (inner, outer) = (if r > delta { half(r - delta) } else { 0.0 }, half(r + delta));
        let slack = delta / length + 4.0 * f32::EPSILON as f64 * (middle.abs() + outer);
        let certain = miss_by < -delta;
        [
            Candidate { lo: middle - outer - slack, hi: middle - inner + slack, certain },
            Candidate { lo: middle + inner - slack, hi: middle + outer + slack, certain },
        ]
    }
}

/// Distance of the origin from the segment between `a` and `b`.
fn distance_to_segment(a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    let t = (-a.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    // two equal ends divide zero by zero
    if t.is_nan() { a.length() } else { (a + edge * t).length() }
}

/// Change of each corner's weight by a displacement of `delta`: `delta` over the height that the
/// triangle shows; and the rounding of the edge functions' products besides.
fn weight_errors(flat: &[DVec3; 3], delta: f64) -> [f64; 3] {
    let area = (flat[1] - flat[0]).cross(flat[2] - flat[0]).length();
    let products = product_errors(flat);
    // one that is not a number says nothing about the weight
    [0, 1, 2].map(|k| (2.0 * delta * (flat[(k + 1) % 3] - flat[(k + 2) % 3]).length() / area + products[k]).min(1.0))
}

/// Change of each corner's weight by the products of the edge functions. All weights are divided by
/// the sum of the three, which errs as they do.
fn product_errors(flat: &[DVec3; 3]) -> [f64; 3] {
    let area = (flat[1] - flat[0]).cross(flat[2] - flat[0]).length();
    let lengths = flat.map(|p| p.length());
    [0, 1, 2].map(|k| 4.0 * f32::EPSILON as f64 * lengths[(k + 1) % 3] * lengths[(k + 2) % 3] / area)
}

/// Barycentric weights of the point of the triangle's border that is nearest to the origin.
fn clamped_barycentrics(corners: &[DVec3; 3]) -> [f64; 2] {
    let mut best = (f64::INFINITY, [0.0; 2]);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let edge = b - a;
        let t = -a.dot(edge) / edge.length_squared();
        let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        let distance = (a + edge * t).length();
        if distance < best.0 {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - t;
            weights[(k + 1) % 3] += t;
            best = (distance, [weights[1], weights[2]]);
        }
    }
    best.1
}
