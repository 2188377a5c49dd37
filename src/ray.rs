//! Rays and hits as they lie in files and in device memory.

use bytemuck::{Pod, Zeroable};

/// One ray: the points `origin + t * direction` with `tmin < t < tmax`. 32 bytes, the record of RAYS.bin.
///
/// The direction need not be of unit length; `t` is measured in units of it. Lengths are world units (metres in glTF)
/// relative to the scene's origin ([`crate::scene::Scene::origin`]).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Start.
    pub origin: [f32; 3],
    /// Hits at or before this parameter do not count. At least 0.
    pub tmin: f32,
    /// Direction, not necessarily of unit length, never zero.
    pub direction: [f32; 3],
    /// Hits at or beyond this parameter do not count. May be infinite.
    pub tmax: f32,
}

/// What a ray met. 20 bytes, the record of HITS.bin.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Ray parameter of the hit; infinite for a miss. A stream that only asks whether something is in the way writes 0
    /// for "occluded".
    pub t: f32,
    /// Index into [`crate::scene::Scene::instances`]; `u32::MAX` for a miss.
    pub instance: u32,
    /// Index of the triangle or sphere in the instance's mesh; `u32::MAX` for a miss.
    pub primitive: u32,
    /// Barycentric weight of the triangle's second vertex (0 for a sphere).
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex (0 for a sphere).
    pub v: f32,
}

impl Hit {
    /// The record of a ray that met nothing.
    pub const MISS: Hit = Hit { t: f32::INFINITY, instance: u32::MAX, primitive: u32::MAX, u: 0.0, v: 0.0 };

    /// Did the ray meet something?
    pub fn is_hit(&self) -> bool {
        self.t < f32::INFINITY
    }
}

/// Moves rays: between the world of files and the tracers' coordinates, which differ for a scene far from the origin.
pub fn translate(rays: &mut [Ray], by: glam::DVec3) {
    if by != glam::DVec3::ZERO {
        for r in rays {
            r.origin = (glam::DVec3::from(r.origin.map(f64::from)) + by).as_vec3().to_array();
        }
    }
}
