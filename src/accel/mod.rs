//! Bounding volume hierarchies, built on the host. This module does not depend on Vulkan.

pub mod build;
pub mod bvh2;
pub mod cache;
pub mod clip;
pub mod features;
pub mod few;
pub mod flatten;
pub mod lab;
pub mod pairs;
pub mod refit;
mod reinsert;
mod sah;
mod spatial;
pub mod wide;

pub use build::BuildPreset;
pub use bvh2::Bvh2;
pub use refit::{RefitPlan, RefitPolicy, RefitResult};
pub use wide::WideBvh;

/// An axis-aligned box in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: glam::Vec3,
    /// Upper corner.
    pub max: glam::Vec3,
}

impl Aabb {
    /// The empty box: the identity of [`Aabb::union`].
    pub const EMPTY: Aabb = Aabb { min: glam::Vec3::INFINITY, max: glam::Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of_points(points: &[glam::Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, &p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// The smallest box around both boxes.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Does this box contain the other?
    pub fn contains(&self, other: &Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }

    /// Half of the surface area; 0 for an empty box.
    pub fn half_area(&self) -> f32 {
        let d = (self.max - self.min).max(glam::Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}
