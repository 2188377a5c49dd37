//! Attenuation of ambient occlusion with distance, for stills and real-time frames.

use super::Hemisphere;
use crate::interface::records::ao::OcclusionRecord;

/// Occlusion below which no hit changes a sample: 1 minus that is 1 in single precision.
const INSIGNIFICANT: f64 = 1.0 / 33_554_432.0;
/// Occlusion below which frames do not search for hits: half a step of an 8-bit image.
const INVISIBLE: f64 = 1.0 / 510.0;

/// Attenuation of occlusion with distance, as shaders/ao/sample.glsl applies it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attenuation {
    /// AO radius in scene units: hits beyond do not occlude; infinite for no limit.
    pub radius: f64,
    /// AO falloff c, at least 1: a hit at distance d occludes by c^-d; 1 is binary.
    pub falloff: f64,
}

impl Attenuation {
    /// Length of occlusion rays of stills in scene units: the radius, or where the falloff leaves
    /// nothing that single precision could add to a sample.
    pub fn reach(self) -> f64 {
        self.distance_of(INSIGNIFICANT)
    }

    /// Length of occlusion rays of frames in scene units: the radius, or where the falloff makes
    /// the occlusion of a hit invisible. The sum of many such hits may be visible.
    pub fn visible_reach(self) -> f64 {
        self.distance_of(INVISIBLE)
    }

    /// Distance at which a hit occludes this much, or the radius if that is less.
    fn distance_of(self, occlusion: f64) -> f64 {
        if self.is_binary() { self.radius } else { self.radius.min(-occlusion.ln() / self.falloff.ln()) }
    }

    /// As shaders of stills and paths read it, with the axis of the hemisphere.
    pub fn record(self, hemisphere: Hemisphere) -> OcclusionRecord {
        OcclusionRecord {
            reach: self.reach() as f32,
            falloff_log2: self.falloff_log2() as f32,
            hemisphere: (hemisphere == Hemisphere::Shading).into(),
        }
    }

    /// Returns true if any hit occludes fully, so that the closest one need not be found.
    pub fn is_binary(self) -> bool {
        self.falloff <= 1.0
    }

    /// Base 2 logarithm of the falloff, per scene unit, as shaders read it.
    pub fn falloff_log2(self) -> f64 {
        self.falloff.log2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_where_falloff_has_faded() {
        let of = |radius, falloff| Attenuation { radius, falloff };
        assert_eq!(of(3.0, 1.0).reach(), 3.0);
        assert_eq!(of(3.0, 2.0).reach(), 3.0);
        assert_eq!(of(f64::INFINITY, 1.0).reach(), f64::INFINITY);
        let faded = of(f64::INFINITY, 2.0);
        assert!((faded.reach() - 25.0).abs() < 1e-12 && !faded.is_binary() && faded.falloff_log2() == 1.0);
        assert_eq!(1.0 - 2f32.powf(-faded.reach() as f32), 1.0);
        assert!((2f64.powf(-faded.visible_reach()) - INVISIBLE).abs() < 1e-12);
    }
}
