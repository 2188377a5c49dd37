//! Differences of a frame from its golden image that are allowed.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, Visitor};

/// The default rate of false alarms of a Z-test.
pub const FALSE_ALARMS: f64 = 1e-4;

/// Differences of a frame from its golden image that are allowed. Every condition given has to
/// hold, and values must be finite where the golden image's are.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Tolerance {
    /// Nothing may differ: every channel of the golden image, bit for bit.
    pub exact: bool,
    /// How different the images may look.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flip: Option<FlipLimit>,
    /// The images may differ by noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z_test: Option<ZTestLimit>,
    /// Pixels that may be wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bad_pixels: Option<u64>,
}

/// A percentile of FLIP, which is computed of the images as they are shown.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlipLimit {
    /// The percentile over all pixels, 0 to 100; 100 is the largest.
    #[serde(default = "default_percentile")]
    pub percentile: f64,
    /// The most that it may be, 0 to 1.
    pub max: f64,
}

fn default_percentile() -> f64 {
    99.0
}

/// A Z-test ([`crate::measure::z_test`]).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZTestLimit {
    /// The probability that an image is called different though only its seed is.
    #[serde(default = "default_false_alarms")]
    pub false_alarms: f64,
    /// The bias of the mean to find, as a share of it: golden images must be that exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias: Option<f64>,
}

fn default_false_alarms() -> f64 {
    FALSE_ALARMS
}

impl Default for ZTestLimit {
    fn default() -> Self {
        Self { false_alarms: FALSE_ALARMS, bias: None }
    }
}

/// The conditions as a table.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    flip: Option<FlipLimit>,
    z_test: Option<ZTestLimit>,
    bad_pixels: Option<u64>,
}

impl Tolerance {
    /// Is nothing but noise allowed to differ, so that the verdict does not depend on the seed?
    pub fn allows_other_seeds(&self) -> bool {
        self.z_test.is_some() && !self.exact && self.flip.is_none() && self.bad_pixels.is_none()
    }

    fn check(self) -> Result<Self, String> {
        if self == Self::default() {
            return Err("a tolerance needs a condition: \"exact\", flip, z_test or bad_pixels".into());
        }
        if self.flip.is_some_and(|f| !(0.0..=100.0).contains(&f.percentile) || !(0.0..=1.0).contains(&f.max)) {
            return Err("flip: percentile is 0 to 100, and max 0 to 1".into());
        }
        if let Some(z) = &self.z_test {
            if !(z.false_alarms > 0.0 && z.false_alarms < 1.0) {
                return Err("z_test: false_alarms is a probability, above 0 and below 1".into());
            }
            if z.bias.is_some_and(|b| !(b > 0.0 && b.is_finite())) {
                return Err("z_test: bias is a share of the mean, above 0, such as 0.005".into());
            }
        }
        Ok(self)
    }
}

impl<'de> Deserialize<'de> for Tolerance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Conditions;
        impl<'de> Visitor<'de> for Conditions {
            type Value = Tolerance;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("\"exact\", \"z_test\", or a table with flip, z_test, bad_pixels")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Tolerance, E> {
                match name {
                    "exact" => Ok(Tolerance { exact: true, ..Default::default() }),
                    "z_test" => Ok(Tolerance { z_test: Some(ZTestLimit::default()), ..Default::default() }),
                    other => Err(E::invalid_value(serde::de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Tolerance, A::Error> {
                let Table { flip, z_test, bad_pixels } = Table::deserialize(MapAccessDeserializer::new(map))?;
                Tolerance { exact: false, flip, z_test, bad_pixels }.check().map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(Conditions)
    }
}
