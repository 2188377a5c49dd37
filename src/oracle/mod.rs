//! The oracle: a CPU tracer in double precision, and closed-form solutions of ambient occlusion.
//!
//! [`Oracle`] answers every ray twice, by testing all primitives and by a BVH, with the same
//! result; tests compare both with each other and every other tracer with them. [`rounding`]
//! decides which answers of a single-precision tracer are within its rounding; [`closed_form`] and
//! [`ao`] are references for ambient occlusion itself.
//!
//! The code is kept simple rather than fast, so that its correctness is easy to verify.

pub mod alpha;
pub mod ao;
mod bvh;
pub mod camera;
pub mod closed_form;
pub mod primitive;
pub mod rounding;

use crate::ray::{Hit, Ray};
use crate::scene::{Geometry, Scene};
use alpha::AlphaTest;
use bvh::Bvh;
use glam::DVec3;
use primitive::{SpherePrimitive, Triangle};
use rayon::prelude::*;
use std::sync::Arc;

/// A [`Ray`] in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleRay {
    /// Start, relative to the oracle's origin.
    pub origin: DVec3,
    /// Direction, not necessarily of unit length.
    pub direction: DVec3,
    /// Hits at or before this parameter do not count.
    pub tmin: f64,
    /// Hits at or beyond this parameter do not count.
    pub tmax: f64,
}

impl OracleRay {
    /// The point at parameter `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

impl From<Ray> for OracleRay {
    fn from(r: Ray) -> Self {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        Self { origin: wide(r.origin), direction: wide(r.direction), tmin: r.tmin as f64, tmax: r.tmax as f64 }
    }
}

impl From<&Ray> for OracleRay {
    fn from(r: &Ray) -> Self {
        (*r).into()
    }
}

/// A [`Hit`] in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleHit {
    /// Ray parameter; infinite for a miss.
    pub t: f64,
    /// Index into [`Scene::instances`]; `u32::MAX` for a miss.
    pub instance: u32,
    /// Index of the triangle or sphere in its mesh; `u32::MAX` for a miss.
    pub primitive: u32,
    /// Barycentric weights of the second and third vertex (0 for a sphere).
    pub barycentrics: [f64; 2],
}

impl OracleHit {
    /// The record of a miss.
    pub const MISS: OracleHit =
        OracleHit { t: f64::INFINITY, instance: u32::MAX, primitive: u32::MAX, barycentrics: [0.0; 2] };

    /// Is it a hit?
    pub fn is_hit(&self) -> bool {
        self.t < f64::INFINITY
    }

    /// The hit in single precision.
    pub fn to_hit(&self) -> Hit {
        let [u, v] = self.barycentrics.map(|x| x as f32);
        Hit { t: self.t as f32, instance: self.instance, primitive: self.primitive, u, v }
    }
}

/// Range of an instance's primitives in the oracle's numbering, and the error bounds of its
/// transform.
#[derive(Clone, Debug)]
struct OracleInstance {
    first: u32,
    count: u32,
    /// Alpha test of its mesh; `None` for opaque materials.
    alpha: Option<Arc<AlphaTest>>,
    /// Bound on how much a round trip to object space amplifies rounding: Frobenius norms of the
    /// matrix and its inverse, scaled to 1 for rotations and uniform scales; infinite for a
    /// singular matrix.
    condition: f64,
    /// Length of the translation relative to the oracle's origin.
    translation: f64,
}

/// A scene as double-precision triangles and spheres in world space.
#[derive(Clone, Debug)]
pub struct Oracle {
    origin: DVec3,
    // primitives are numbered: all triangles, then all spheres
    triangles: Vec<Triangle>,
    spheres: Vec<SpherePrimitive>,
    instances: Vec<OracleInstance>,
    bvh: Bvh,
    /// Greatest coordinate magnitude of any primitive.
    extent: f64,
}

impl Oracle {
    /// The scene as seen from `origin` (usually [`Scene::origin`]): every `f32` vertex is placed in
    /// `f64`, minus `origin`. Instances with a broken transform or mesh index contribute nothing.
    pub fn new(scene: &Scene, origin: DVec3) -> Self {
        Self::with_bvh(scene, origin, Bvh::build)
    }

    /// [`Oracle::new`] for a few thousand rays: its hierarchy is built in a fraction of the time.
    /// Rays, whose hits are the same, take longer.
    pub fn for_few_rays(scene: &Scene, origin: DVec3) -> Self {
        Self::with_bvh(scene, origin, Bvh::build_quickly)
    }

    fn with_bvh(scene: &Scene, origin: DVec3, build: impl FnOnce(&[(DVec3, DVec3)]) -> Bvh) -> Self {
        let (mut triangles, mut spheres, mut instances) = (Vec::new(), Vec::new(), Vec::new());

        // one alpha test per mesh, shared by its instances
        let tests: Vec<_> = scene.meshes.iter().map(|mesh| AlphaTest::new(scene, mesh).map(Arc::new)).collect();

        // primitives in world space, around the origin, in double precision
        for (id, instance) in (0u32..).zip(&scene.instances) {
            let mut to_world = instance.object_to_world;
            to_world.translation -= origin;
            let inverse = to_world.inverse();
            let norm = |m: glam::DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
            let condition = norm(to_world.matrix3) * norm(inverse.matrix3) / 3.0;
            let mut entry = OracleInstance {
                first: 0,
                count: 0,
                alpha: tests.get(instance.mesh).cloned().flatten(),
                condition: if condition.is_finite() { condition.max(1.0) } else { f64::INFINITY },
                translation: to_world.translation.length(),
            };
            // nothing is hit of a hidden one
            let shown = scene.meshes.get(instance.mesh).filter(|_| !scene.hidden.contains(&(id as usize)));
            match shown.map(|m| &m.geometry) {
                Some(Geometry::Triangles(mesh)) => {
                    let points: Vec<_> =
                        mesh.positions.iter().map(|p| to_world.transform_point3(p.as_dvec3())).collect();
                    entry.first = triangles.len() as u32;
                    entry.count = mesh.indices.len() as u32;
                    triangles.extend((0u32..).zip(&mesh.indices).map(|(primitive, corners)| {
                        // an index that is out of range makes a triangle that no ray hits
                        let v = corners.map(|i| points.get(i as usize).copied().unwrap_or(DVec3::NAN));
                        Triangle { v, instance: id, primitive }
                    }));
                }
                Some(Geometry::Spheres(list)) => {
                    entry.first = spheres.len() as u32;
                    entry.count = list.len() as u32;
                    spheres.extend((0u32..).zip(list).map(|(primitive, s)| SpherePrimitive {
                        center: s.center.as_dvec3(),
                        radius: s.radius as f64,
                        object_to_world: to_world,
                        world_to_object: inverse,
                        instance: id,
                        primitive,
                    }));
                }
                None => {}
            }
            instances.push(entry);
        }

        // spheres are numbered after all triangles
        for (entry, instance) in instances.iter_mut().zip(&scene.instances) {
            if matches!(scene.meshes.get(instance.mesh).map(|m| &m.geometry), Some(Geometry::Spheres(_))) {
                entry.first += triangles.len() as u32;
            }
        }

        // one BVH over both
        let bounds: Vec<_> =
            triangles.iter().map(Triangle::bounds).chain(spheres.iter().map(SpherePrimitive::bounds)).collect();
        let bvh = build(&bounds);
        let extent = bvh.bounds().map_or(0.0, |(lo, hi)| lo.abs().max(hi.abs()).max_element());
        Self { origin, triangles, spheres, instances, bvh, extent }
    }

    /// World position of the oracle's coordinate origin.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Bounds of all primitives relative to [`Oracle::origin`].
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.bvh.bounds()
    }

    /// Number of triangles and spheres.
    pub fn primitive_count(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// All triangles, relative to [`Oracle::origin`].
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// All spheres, relative to [`Oracle::origin`].
    pub fn spheres(&self) -> &[SpherePrimitive] {
        &self.spheres
    }

    /// The nearest hit. Of several at the same parameter the one with the lowest instance and
    /// primitive wins, triangles first.
    pub fn closest(&self, ray: impl Into<OracleRay>) -> OracleHit {
        let ray = ray.into();
        let mut best = (OracleHit::MISS, u32::MAX);
        self.bvh.visit(&ray, self.pad(&ray), ray.tmax, |index| {
            self.keep_nearer(index, &ray, &mut best);
            std::ops::ControlFlow::Continue(best.0.t)
        });
        best.0
    }

    /// Is there any hit?
    pub fn any(&self, ray: impl Into<OracleRay>) -> bool {
        let ray = ray.into();
        let mut found = false;
        self.bvh.visit(&ray, self.pad(&ray), ray.tmax, |index| {
            found = self.hit(index, &ray).is_some();
            if found { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(f64::INFINITY) }
        });
        found
    }

    /// Every primitive that a ray meets, at its nearest hit, in no order.
    pub fn all(&self, ray: impl Into<OracleRay>, mut see: impl FnMut(&OracleHit)) {
        let ray = ray.into();
        self.bvh.visit(&ray, self.pad(&ray), ray.tmax, |index| {
            if let Some(hit) = self.hit(index, &ray) {
                see(&hit);
            }
            std::ops::ControlFlow::Continue(ray.tmax)
        });
    }

    /// [`Oracle::closest`] without the BVH.
    pub fn brute_force_closest(&self, ray: impl Into<OracleRay>) -> OracleHit {
        let ray = ray.into();
        let mut best = (OracleHit::MISS, u32::MAX);
        for index in 0..self.primitive_count() as u32 {
            self.keep_nearer(index, &ray, &mut best);
        }
        best.0
    }

    /// [`Oracle::any`] without the BVH.
    pub fn brute_force_any(&self, ray: impl Into<OracleRay>) -> bool {
        let ray = ray.into();
        (0..self.primitive_count() as u32).any(|index| self.hit(index, &ray).is_some())
    }

    /// [`Oracle::closest`] for many rays, on all cores.
    pub fn trace_closest(&self, rays: &[Ray]) -> Vec<OracleHit> {
        rays.par_iter().with_min_len(256).map(|r| self.closest(r)).collect()
    }

    /// [`Oracle::any`] for many rays, on all cores.
    pub fn trace_any(&self, rays: &[Ray]) -> Vec<bool> {
        rays.par_iter().with_min_len(256).map(|r| self.any(r)).collect()
    }

    /// The geometric normal at a hit, of unit length, on the side that `direction` comes from. Zero
    /// for a miss and for a triangle without area.
    pub fn facing_normal(&self, ray: &OracleRay, hit: &OracleHit) -> DVec3 {
        let Some(index) = self.index_of(hit.instance, hit.primitive) else { return DVec3::ZERO };
        let n = match self.triangles.get(index as usize) {
            Some(t) => t.normal(),
            None => self.spheres[index as usize - self.triangles.len()].normal(ray.at(hit.t)),
        };
        if n.dot(ray.direction) > 0.0 { -n } else { n }
    }

    /// Index of a primitive in the oracle's numbering.
    fn index_of(&self, instance: u32, primitive: u32) -> Option<u32> {
        let i = self.instances.get(instance as usize)?;
        (primitive < i.count).then(|| i.first + primitive)
    }

    /// The nearest hit of the ray with one primitive within (tmin, tmax), alpha respected.
    fn hit(&self, index: u32, ray: &OracleRay) -> Option<OracleHit> {
        match self.triangles.get(index as usize) {
            Some(triangle) => {
                let (t, barycentrics) = triangle.intersect(ray)?;
                let hit = OracleHit { t, instance: triangle.instance, primitive: triangle.primitive, barycentrics };
                let present = self.instances[hit.instance as usize]
                    .alpha
                    .as_ref()
                    .is_none_or(|a| a.is_present(hit.primitive, barycentrics));
                (t > ray.tmin && t < ray.tmax && present).then_some(hit)
            }
            None => {
                let sphere = &self.spheres[index as usize - self.triangles.len()];
                let hit =
                    |t| OracleHit { t, instance: sphere.instance, primitive: sphere.primitive, barycentrics: [0.0; 2] };
                let present = self.instances[sphere.instance as usize]
                    .alpha
                    .as_ref()
                    .is_none_or(|a| a.is_present(sphere.primitive, [0.0; 2]));
                let near_then_far = sphere.intersect(ray)?;
                near_then_far.into_iter().find(|&t| t > ray.tmin && t < ray.tmax).filter(|_| present).map(hit)
            }
        }
    }

    fn keep_nearer(&self, index: u32, ray: &OracleRay, best: &mut (OracleHit, u32)) {
        if let Some(hit) = self.hit(index, ray)
            && (hit.t < best.0.t || hit.t == best.0.t && index < best.1)
        {
            *best = (hit, index);
        }
    }

    /// Widening of boxes in traversal, which covers [`primitive::RESIDUAL`] and the rounding of the
    /// slab test.
    fn pad(&self, ray: &OracleRay) -> f64 {
        4.0 * primitive::RESIDUAL * (self.extent + ray.origin.abs().max_element())
    }
}
