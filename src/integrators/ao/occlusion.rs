//! Which hits occlude, and how much: the settings of ambient occlusion that stills, frames and
//! paths share.

use super::Hemisphere;
use crate::interface::records::ao::OcclusionRecord;

/// Occlusion below which no hit changes a sample: 1 minus that is 1 in single precision.
const INSIGNIFICANT: f64 = 1.0 / 33_554_432.0;
/// Occlusion below which frames do not search for hits: half a step of an 8-bit image.
const INVISIBLE: f64 = 1.0 / 510.0;

/// Which hits occlude a surface point, and how much, as shaders/ao/sample.glsl applies it. Settings
/// make it once ([`AoSettings::occlusion`](super::settings::AoSettings::occlusion)), and all that
/// computes ambient occlusion is handed it whole.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Occlusion {
    /// AO radius in scene units: hits beyond do not occlude; infinite for no limit.
    pub radius: f64,
    /// AO falloff c, at least 1: a hit at distance d occludes by c^-d; 1 is binary.
    pub falloff: f64,
    /// Axis of the hemisphere.
    #[serde(skip)]
    pub hemisphere: Hemisphere,
}

impl Default for Occlusion {
    fn default() -> Self {
        Self::new(f64::INFINITY, 1.0)
    }
}

impl Occlusion {
    /// Occlusion about the geometric normal.
    pub const fn new(radius: f64, falloff: f64) -> Self {
        Self { radius, falloff, hemisphere: Hemisphere::Geometric }
    }

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

    /// Returns true if any hit occludes fully, so that the closest one need not be found.
    pub fn is_binary(self) -> bool {
        self.falloff <= 1.0
    }

    /// Base 2 logarithm of the falloff, per scene unit, as shaders read it.
    pub fn falloff_log2(self) -> f64 {
        self.falloff.log2()
    }

    /// Returns true if the axis of the hemisphere is the shading normal, which scenes must have.
    pub fn is_about_shading_normals(self) -> bool {
        self.hemisphere == Hemisphere::Shading
    }

    /// As shaders of stills and paths read it.
    pub fn record(self) -> OcclusionRecord {
        OcclusionRecord {
            reach: self.reach() as f32,
            falloff_log2: self.falloff_log2() as f32,
            hemisphere: self.is_about_shading_normals().into(),
        }
    }

    /// Keys and values in the metadata of images.
    pub fn metadata(self) -> [(&'static str, String); 3] {
        [
            ("ao.radius", self.radius.to_string()),
            ("ao.falloff", self.falloff.to_string()),
            ("ao.normal", self.hemisphere.to_string()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_where_falloff_has_faded() {
        assert_eq!(Occlusion::new(3.0, 1.0).reach(), 3.0);
        assert_eq!(Occlusion::new(3.0, 2.0).reach(), 3.0);
        assert_eq!(Occlusion::default().reach(), f64::INFINITY);
        let faded = Occlusion::new(f64::INFINITY, 2.0);
        assert!((faded.reach() - 25.0).abs() < 1e-12 && !faded.is_binary() && faded.falloff_log2() == 1.0);
        assert_eq!(1.0 - 2f32.powf(-faded.reach() as f32), 1.0);
        assert!((2f64.powf(-faded.visible_reach()) - INVISIBLE).abs() < 1e-12);
    }
}
