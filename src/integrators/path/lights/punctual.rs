//! Lights that no surface emits: those of src/scene/lights.

use std::f64::consts::PI;

use glam::DVec3;

use super::super::light_tree::Bounds;
use super::super::params::INVALID;
use super::collect::DARK;
use super::{LightBuilder, LightCollector, brightness};
use crate::interface::records::lights::LightRecord;
use crate::scene::Light;
use crate::scene::lights::Emission;

/// Adds a light, which is light `index` of its scene.
pub(super) fn add(all: &mut LightCollector, builder: &LightBuilder, light: &Light, index: usize) {
    let position = light.position - builder.origin;
    let least = if builder.changing.contains(&index) { DARK } else { 0.0 };
    let brightness = brightness(light.intensity).max(least);
    let base = LightRecord {
        kind: light.kind.number() as u32,
        position: position.as_vec3().to_array(),
        axis: light.direction.as_vec3().to_array(),
        intensity: light.intensity.to_array(),
        range: light.range as f32,
        instance: INVALID,
        ..Default::default()
    };
    match light.kind.emission() {
        Emission::Placed { spread, falloff, parameters: [parameter_0, parameter_1] } => {
            let bounds = Bounds {
                lo: position,
                hi: position,
                // what emits everywhere has none
                axis: if spread < PI { light.direction.normalize_or(DVec3::NEG_Z) } else { DVec3::Z },
                spread,
                falloff,
                two_sided: false,
                intensity: brightness,
            };
            all.push_placed(LightRecord { parameter_0, parameter_1, ..base }, bounds);
        }
        Emission::Distant { angle } => {
            // 1 - cos, without cancellation
            let one_minus_cos = 2.0 * (0.25 * f64::from(angle)).sin().powi(2);
            all.push_distant(LightRecord { radius: one_minus_cos as f32, ..base }, brightness);
        }
    }
}
