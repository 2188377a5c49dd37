//! Collecting lights: how bright one is, what does not change while they move, and the lists to
//! which each kind adds its own.

use std::collections::HashMap;

use glam::{DVec3, Vec3, Vec4};

use super::super::light_tree::Bounds;
use super::super::params::INVALID;
use super::pictures::Part;
use crate::accel::features::AlphaClass;
use crate::interface::records::lights::LightRecord;

/// Importance of a light of this radiance (or intensity, or irradiance; linear RGB): the root mean
/// square of its channels. Sampling in proportion to it minimizes the squared error summed over
/// channels; in proportion to luminance, blue lights would be undersampled and noisy.
pub(in super::super) fn brightness(c: Vec3) -> f64 {
    (c.as_dvec3().length_squared() / 3.0).sqrt()
}

/// Makes the lights of a scene, again and again if they move: what does not depend on where they
/// are is found once.
pub(in super::super) struct LightBuilder {
    pub(super) origin: DVec3,
    /// Radiance of what surrounds the scene, averaged over the sphere.
    pub(super) environment: Vec3,
    pub(super) alpha: Vec<AlphaClass>,
    /// For each instance: it moves or deforms.
    pub(super) moves: Vec<bool>,
    /// Lights of the scene that become dark and bright again.
    pub(super) changing: Vec<usize>,
    /// Materials that emit at times.
    pub(super) emitters: Vec<usize>,
    /// Means of the textures of emitters, by index.
    pub(super) means: HashMap<Option<usize>, Vec4>,
    /// Number of parts along an edge of each triangle with a picture.
    pub(super) side: u32,
    /// Parts of each triangle of the meshes with a picture, by mesh.
    pub(super) parts: HashMap<usize, Vec<Vec<Part>>>,
}

/// Brightness of a light that is dark at a time: it stays in the list, so that shaders that were
/// compiled for it fit, and gets next to no samples.
pub(super) const DARK: f64 = 1e-20;

/// Collects lights: placed ones with their bounds, then distant ones with the weights by which they
/// are chosen.
#[derive(Default)]
pub(super) struct LightCollector {
    pub(super) records: Vec<LightRecord>,
    pub(super) bounds: Vec<Bounds>,
    /// For each placed light its weight in a choice that the point does not matter to: 1, and for
    /// the parts of a triangle 1 together.
    pub(super) even_shares: Vec<f64>,
    pub(super) weights: Vec<f64>,
}

impl LightCollector {
    /// Adds a placed light and returns its index. A light that emits nothing is not sampled:
    /// [`INVALID`].
    pub(super) fn push_placed(&mut self, record: LightRecord, bounds: Bounds) -> u32 {
        self.push_part(record, bounds, 1.0)
    }

    /// Adds a placed light that is a part of one, `share` of its power, and returns its index. One
    /// that emits nothing is not sampled: [`INVALID`].
    pub(super) fn push_part(&mut self, record: LightRecord, bounds: Bounds, share: f64) -> u32 {
        debug_assert!(self.weights.is_empty(), "placed lights come first");
        if bounds.intensity.is_nan() || bounds.intensity <= 0.0 {
            return INVALID;
        }
        self.records.push(record);
        self.bounds.push(bounds);
        self.even_shares.push(share);
        self.records.len() as u32 - 1
    }

    /// Adds a distant light and returns its index. `weight`: irradiance that it brings, by which it
    /// is chosen among its like. Without any it is not sampled: [`INVALID`].
    pub(super) fn push_distant(&mut self, record: LightRecord, weight: f64) -> u32 {
        if weight.is_nan() || weight <= 0.0 {
            return INVALID;
        }
        self.records.push(record);
        self.weights.push(weight);
        self.records.len() as u32 - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The importance of a light does not depend on the channel of its radiance.
    #[test]
    fn colours_count_alike() {
        let colours = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let counts = colours.map(brightness);
        assert!(counts[0] == counts[1] && counts[1] == counts[2] && (counts[3] - 1.0).abs() < 1e-12, "{counts:?}");
        assert_eq!(brightness(3.0 * Vec3::Z), 3.0 * counts[2]);
    }
}
