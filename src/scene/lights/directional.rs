//! Lights from far away (KHR_lights_punctual), with an angular diameter besides.

use glam::DVec3;

use super::keys::{Keys, degrees, direction};
use super::{Emission, LightKind, LightType, PlacedLight};

/// The type.
pub const TYPE: LightType = LightType {
    word: "sun",
    name: "directional",
    gltf: Some("directional"),
    strength: "irradiance",
    keys: "direction, irradiance (lux), angle (its diameter in degrees)",
    read,
};

fn read(keys: &mut Keys) -> Result<PlacedLight, String> {
    let angle = keys.or("angle", 0.0, degrees(0.0..=180.0))? as f32;
    Ok(PlacedLight {
        kind: LightKind::Directional { angle },
        position: DVec3::ZERO,
        direction: keys.needed("direction", direction)?,
    })
}

/// How it emits.
pub fn emission(angle: f32) -> Emission {
    Emission::Distant { angle }
}
