//! Lights at a position, in a cone (KHR_lights_punctual).

use std::f64::consts::FRAC_PI_4;

use super::keys::{Keys, degrees, direction, position};
use super::{Emission, LightKind, LightType, PlacedLight};

/// The type.
pub const TYPE: LightType = LightType {
    word: "spot",
    name: "spot",
    gltf: Some("spot"),
    strength: "intensity",
    keys: "position, direction, intensity (cd), outer, inner (degrees from the axis)",
    read,
};

fn read(keys: &mut Keys) -> Result<PlacedLight, String> {
    let outer = keys.or("outer", FRAC_PI_4, degrees(0.0..=90.0))?;
    let inner = keys.or("inner", 0.0, degrees(0.0..=90.0))?.min(outer);
    Ok(PlacedLight {
        kind: LightKind::Spot { inner_angle: inner as f32, outer_angle: outer as f32 },
        position: keys.needed("position", position)?,
        direction: keys.needed("direction", direction)?,
    })
}

/// How it emits. The parameters are the cosines of its angles.
pub fn emission(inner_angle: f32, outer_angle: f32) -> Emission {
    let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
    let (spread, reach) = (f64::from(inner_angle), f64::from(outer_angle));
    Emission::Placed { spread, falloff: reach - spread, parameters: [inner, outer] }
}
