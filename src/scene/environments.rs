//! Built-in environments: light for models that bring none.

use glam::{DMat3, DVec3, Vec3};

use super::EnvironmentMap;
use crate::settings::choices;

choices! {
    /// A built-in environment. The mean of its radiance over all directions is 1.
    pub enum BuiltinEnvironment {
        /// A dark room with a large light at the left, a weak one at the right and two strips behind
        Studio = "studio",
        /// One soft light above, before a bright background
        Softbox = "softbox",
        /// An overcast sky (CIE type 16: three times as bright at the zenith as at the horizon) over grey ground
        Overcast = "overcast",
    }
}

/// Pixels of the map.
const SIZE: [usize; 2] = [512, 256];
/// Albedo of the ground below an overcast sky.
const GROUND: f64 = 0.2;

/// A rectangle that emits, seen from the middle of the room.
struct Panel {
    /// Direction to its middle: azimuth clockwise from -z, and elevation, degrees.
    at: [f64; 2],
    /// Half of its width and height at a distance of 1.
    half: [f64; 2],
    radiance: f64,
}

/// Width of the edge over which a panel fades, at a distance of 1.
const EDGE: f64 = 0.12;

const STUDIO: [Panel; 4] = [
    Panel { at: [300.0, 35.0], half: [0.55, 0.7], radiance: 14.0 },
    Panel { at: [75.0, 15.0], half: [0.7, 0.8], radiance: 2.5 },
    Panel { at: [215.0, 25.0], half: [0.12, 0.9], radiance: 12.0 },
    Panel { at: [150.0, 25.0], half: [0.12, 0.9], radiance: 8.0 },
];

impl Panel {
    /// Radiance from a direction.
    fn radiance(&self, direction: DVec3) -> f64 {
        let [azimuth, elevation] = self.at.map(f64::to_radians);
        let towards = DMat3::from_rotation_y(-azimuth) * DMat3::from_rotation_x(elevation);
        let ahead = -direction.dot(towards.z_axis);
        if ahead <= 0.0 {
            return 0.0;
        }
        let inside = |axis: DVec3, half: f64| {
            let distance = (direction.dot(axis) / ahead).abs();
            let t = ((half + EDGE - distance) / EDGE).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        self.radiance * inside(towards.x_axis, self.half[0]) * inside(towards.y_axis, self.half[1])
    }
}

impl BuiltinEnvironment {
    /// The environment of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|e| e.name() == name)
    }

    /// Radiance from a direction, up to a factor.
    fn radiance(self, direction: DVec3) -> DVec3 {
        match self {
            Self::Studio => DVec3::splat(0.08 + STUDIO.iter().map(|panel| panel.radiance(direction)).sum::<f64>()),
            Self::Softbox => {
                let panel = Panel { at: [330.0, 65.0], half: [0.8, 0.8], radiance: 6.0 };
                // the background fades downwards into the floor
                let background = 0.55 + 0.25 * direction.y;
                DVec3::splat(background + panel.radiance(direction))
            }
            Self::Overcast if direction.y >= 0.0 => DVec3::new(0.96, 1.0, 1.06) * (1.0 + 2.0 * direction.y) / 3.0,
            // irradiance below a zenith of 1 is 7 pi / 9
            Self::Overcast => DVec3::splat(GROUND * 7.0 / 9.0),
        }
    }

    /// Computes the map. `factor` multiplies its radiance; `turn` turns it about the vertical axis,
    /// radians, counter-clockwise from above.
    pub fn map(self, factor: f64, turn: f64) -> EnvironmentMap {
        let [width, height] = SIZE;
        let mut radiance = Vec::with_capacity(width * height);
        let (mut sum, mut weights) = (0.0, 0.0);
        for y in 0..height {
            let (sin, cos) = (std::f64::consts::PI * (y as f64 + 0.5) / height as f64).sin_cos();
            for x in 0..width {
                // the middle of a map is at -z
                let azimuth = std::f64::consts::TAU * ((x as f64 + 0.5) / width as f64 - 0.5);
                let colour = self.radiance(DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos()));
                sum += sin * colour.element_sum() / 3.0;
                weights += sin;
                radiance.push(colour.as_vec3());
            }
        }
        EnvironmentMap {
            name: self.name().to_owned(),
            width: width as u32,
            height: height as u32,
            radiance: radiance.into_iter().map(|c| c * (weights / sum) as f32).collect(),
            factor: Vec3::splat(factor as f32),
            to_map: DMat3::from_rotation_y(-turn),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiance of a map in a direction, of the nearest texel.
    fn seen(map: &EnvironmentMap, direction: DVec3) -> f32 {
        let d = map.to_map * direction.normalize();
        let x = (d.x.atan2(-d.z) / std::f64::consts::TAU + 0.5) * f64::from(map.width);
        let y = d.y.acos() / std::f64::consts::PI * f64::from(map.height);
        let [x, y] = [(x as u32).min(map.width - 1), (y as u32).min(map.height - 1)];
        map.radiance[(y * map.width + x) as usize].element_sum() / 3.0
    }

    #[test]
    fn means_are_one() {
        for builtin in BuiltinEnvironment::ALL {
            let map = builtin.map(1.0, 0.0);
            let mut sums = [0.0f64; 2];
            for (k, colour) in map.radiance.iter().enumerate() {
                let row = k / map.width as usize;
                let weight = (std::f64::consts::PI * (row as f64 + 0.5) / f64::from(map.height)).sin();
                sums = [sums[0] + weight * f64::from(colour.element_sum()) / 3.0, sums[1] + weight];
            }
            assert!((sums[0] / sums[1] - 1.0).abs() < 1e-4, "{builtin}: {}", sums[0] / sums[1]);
            assert!(map.radiance.iter().all(|c| c.is_finite() && c.min_element() > 0.0), "{builtin}");
            assert_eq!(BuiltinEnvironment::from_name(builtin.name()), Some(builtin));
        }
        assert_eq!(BuiltinEnvironment::from_name("studio.hdr"), None);
    }

    /// CIE S 011: an overcast sky is three times as bright above as at the horizon.
    #[test]
    fn lights_are_where_they_are_said_to_be() {
        let overcast = BuiltinEnvironment::Overcast.map(1.0, 0.0);
        let [above, horizon] = [DVec3::Y, DVec3::new(0.0, 1e-3, -1.0)].map(|d| seen(&overcast, d));
        assert!((above / horizon - 3.0).abs() < 0.05, "{above} {horizon}");

        // 60 degrees to the left and 35 above: the key light; turned left by 30 degrees more, 90
        let towards = |azimuth: f64, elevation: f64| {
            let ([sin, cos], [up, across]) = (
                [azimuth.to_radians().sin(), azimuth.to_radians().cos()],
                [elevation.to_radians().sin(), elevation.to_radians().cos()],
            );
            DVec3::new(across * sin, up, -across * cos)
        };
        let [studio, turned] = [0.0, 30.0f64].map(|turn| BuiltinEnvironment::Studio.map(2.0, turn.to_radians()));
        let key = seen(&studio, towards(-60.0, 35.0));
        assert!(studio.radiance.iter().all(|c| c.element_sum() / 3.0 <= 1.001 * key));
        assert_eq!(seen(&turned, towards(-90.0, 35.0)), key);
        assert!(seen(&turned, towards(-20.0, 35.0)) < 0.1 * key);
    }
}
