//! Ray and hit records, with the same layout in files and in device memory.

use glam::DVec3;

pub use crate::interface::records::ray::{Hit, Ray};

impl Ray {
    /// A ray between two parameters, rounded to single precision.
    pub fn new(origin: DVec3, direction: DVec3, [tmin, tmax]: [f64; 2]) -> Self {
        let [origin, direction] = [origin, direction].map(|v| v.as_vec3().to_array());
        Self { origin, tmin: tmin as f32, direction, tmax: tmax as f32 }
    }
}

impl Hit {
    /// The record of a miss.
    pub const MISS: Hit = Hit { t: f32::INFINITY, instance: u32::MAX, primitive: u32::MAX, u: 0.0, v: 0.0 };

    /// Is it a hit?
    pub fn is_hit(&self) -> bool {
        self.t < f32::INFINITY
    }
}

/// Translates ray origins between the world coordinates of files and the tracers' coordinates,
/// which differ for a scene far from the origin.
pub fn translate(rays: &mut [Ray], by: DVec3) {
    if by != DVec3::ZERO {
        for r in rays {
            r.origin = (DVec3::from(r.origin.map(f64::from)) + by).as_vec3().to_array();
        }
    }
}
