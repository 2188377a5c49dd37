//! Lights at a position whose intensity is a power of the cosine of the angle from an axis, as data
//! sheets describe LEDs and downlights: by the angle at which it is half. An angle of 60 degrees is
//! a small Lambertian emitter; a beam angle is twice that angle.

use std::f64::consts::{FRAC_PI_2, LN_2};

use super::keys::{Keys, degrees, direction, position};
use super::{Emission, LightKind, LightType, PlacedLight};

/// The type.
pub const TYPE: LightType = LightType {
    word: "led",
    name: "LED",
    gltf: None,
    strength: "intensity",
    keys: "position, direction, intensity (cd), half_angle (degrees from the axis where it is half)",
    read,
};

fn read(keys: &mut Keys) -> Result<PlacedLight, String> {
    let half_angle = keys.or("half_angle", 60f64.to_radians(), degrees(1.0..=89.0))? as f32;
    Ok(PlacedLight {
        kind: LightKind::Led { half_angle },
        position: keys.needed("position", position)?,
        direction: keys.needed("direction", direction)?,
    })
}

/// How it emits. The first parameter is the exponent of the cosine.
pub fn emission(half_angle: f32) -> Emission {
    let exponent = LN_2 / -f64::from(half_angle).cos().ln();
    Emission::Placed { spread: 0.0, falloff: FRAC_PI_2, parameters: [exponent as f32, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_intensity_is_at_the_half_angle() {
        for degrees in [1.0f32, 15.0, 60.0, 89.0] {
            let Emission::Placed { parameters: [exponent, _], .. } = emission(degrees.to_radians()) else {
                panic!("it has a position")
            };
            let share = |angle: f64| angle.cos().powf(f64::from(exponent));
            assert!((share(f64::from(degrees.to_radians())) - 0.5).abs() < 1e-6, "{degrees}");
        }
    }
}
