//! Lights at a position, with the same intensity in all directions (KHR_lights_punctual).

use std::f64::consts::PI;

use glam::DVec3;

use super::keys::{Keys, position};
use super::{Emission, LightKind, LightType, PlacedLight};

/// The type.
pub const TYPE: LightType = LightType {
    word: "point",
    name: "point",
    gltf: Some("point"),
    strength: "intensity",
    keys: "position, intensity (cd)",
    read,
};

fn read(keys: &mut Keys) -> Result<PlacedLight, String> {
    Ok(PlacedLight { kind: LightKind::Point, position: keys.needed("position", position)?, direction: DVec3::NEG_Z })
}

/// How it emits.
pub fn emission() -> Emission {
    Emission::Placed { spread: PI, falloff: 0.5 * PI, parameters: [0.0; 2] }
}
