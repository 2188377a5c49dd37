//! A clear sky with its sun, as an environment map and a directional light.

mod atmosphere;

use std::fmt;

use glam::{DMat3, DVec3, Vec3};

use super::{EnvironmentMap, Light, LightKind};
use crate::settings::parse::parse_number;
use atmosphere::Atmosphere;

/// Luminance of a radiance of 1, in candela per square metre.
pub const UNIT: f64 = 25_000.0;
/// Angular diameter of the sun in degrees.
pub const SUN_DIAMETER: f64 = 0.5332;

/// Pixels of the map.
const SIZE: [usize; 2] = [512, 256];

/// A clear sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Elevation of the sun above the horizon, -6 to 90 degrees.
    pub elevation: f64,
    /// Azimuth of the sun in degrees, clockwise from above: 0 at -z, 90 at +x.
    pub azimuth: f64,
    /// Optical thickness of air and haze over that of air: 1 (no haze) to 10.
    pub turbidity: f64,
}

impl Default for Sky {
    /// The sun is to the left of and behind a camera that looks towards -z.
    fn default() -> Self {
        Self { elevation: 35.0, azimuth: 215.0, turbidity: 2.5 }
    }
}

impl fmt::Display for Sky {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "sky:{},{},{}", self.elevation, self.azimuth, self.turbidity)
    }
}

impl Sky {
    /// Reads `sky` or `sky:ELEVATION,AZIMUTH,TURBIDITY`, of which the last may be left out; `None`
    /// for anything else.
    ///
    /// # Errors
    /// What is wrong with a number, in words.
    pub fn parse(text: &str) -> Option<Result<Self, String>> {
        match text.strip_prefix("sky")?.split_at_checked(1) {
            None => Some(Ok(Self::default())),
            Some((":", numbers)) => Some(Self::parse_numbers(numbers)),
            Some(_) => None,
        }
    }

    fn parse_numbers(text: &str) -> Result<Self, String> {
        let mut sky = Self::default();
        let texts: Vec<&str> = text.split(',').collect();
        let places: [(&str, &mut f64, f64, f64); 3] = [
            ("elevation", &mut sky.elevation, -6.0, 90.0),
            ("azimuth", &mut sky.azimuth, -360.0, 360.0),
            ("turbidity", &mut sky.turbidity, 1.0, 10.0),
        ];
        if texts.len() > places.len() {
            return Err(format!("expected sky:ELEVATION,AZIMUTH,TURBIDITY, and there are {} numbers", texts.len()));
        }
        for (text, (name, value, least, most)) in texts.into_iter().zip(places) {
            let number = parse_number(text).ok().filter(|v| (least..=most).contains(v));
            *value = number.ok_or_else(|| format!("{name} '{text}': must be a number from {least} to {most}"))?;
        }
        Ok(sky)
    }

    /// Direction to the sun, in the world.
    pub fn to_sun(&self) -> DVec3 {
        let ((sin, cos), (up, across)) = (self.azimuth.to_radians().sin_cos(), self.elevation.to_radians().sin_cos());
        DVec3::new(across * sin, up, -across * cos)
    }

    /// Computes the sky and the ground below it as a map, and the sun as a directional light;
    /// without it below the horizon. `factor` multiplies both.
    pub fn light(&self, factor: f64) -> (EnvironmentMap, Option<Light>) {
        let atmosphere = Atmosphere::new(self.turbidity);
        let [width, height] = SIZE;
        let radiance = atmosphere.map(self.elevation, width, height);
        let map = EnvironmentMap {
            name: self.to_string(),
            width: width as u32,
            height: height as u32,
            radiance: radiance.into_iter().map(|c| c / UNIT as f32).collect(),
            factor: Vec3::splat(factor as f32),
            to_map: DMat3::from_rotation_y(self.azimuth.to_radians()),
        };
        let sun = (self.elevation >= 0.0).then(|| Light {
            name: "sun".into(),
            kind: LightKind::Directional { angle: SUN_DIAMETER.to_radians() as f32 },
            intensity: (atmosphere.sun(self.elevation) * (factor / UNIT)).as_vec3(),
            position: DVec3::ZERO,
            direction: -self.to_sun(),
            range: f64::INFINITY,
        });
        (map, sun)
    }
}
