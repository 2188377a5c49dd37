//! Lights without a surface: at a position, or parallel.

use std::f64::consts::PI;

use glam::DVec3;

use super::super::light_tree::Bounds;
use super::super::params::INVALID;
use super::{Gathered, brightness, radius};
use crate::accel::flatten::FlatScene;
use crate::interface::LightKind as Kind;
use crate::interface::records::lights::LightRecord;
use crate::scene::{Light, LightKind};

/// Adds one.
pub(super) fn add(all: &mut Gathered, flat: &FlatScene, light: &Light) {
    let position = light.position - flat.origin;
    let brightness = brightness(light.intensity);
    let base = LightRecord {
        position: position.as_vec3().to_array(),
        axis: light.direction.as_vec3().to_array(),
        intensity: light.intensity.to_array(),
        range: light.range as f32,
        instance: INVALID,
        ..Default::default()
    };
    let place = |axis, spread, falloff| Bounds {
        lo: position,
        hi: position,
        axis,
        spread,
        falloff,
        both_ways: false,
        intensity: brightness,
    };
    match light.kind {
        LightKind::Point => {
            all.push(
                LightRecord { kind: Kind::Point as u32, ..base },
                4.0 * PI * brightness,
                Some(place(DVec3::Z, PI, 0.5 * PI)),
            );
        }
        LightKind::Spot { inner_angle, outer_angle } => {
            let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
            // as if it fell off half-way between the two
            let solid = 2.0 * PI * (1.0 - 0.5 * f64::from(inner + outer));
            let record = LightRecord { kind: Kind::Spot as u32, cos_inner: inner, cos_outer: outer, ..base };
            let (spread, reach) = (f64::from(inner_angle), f64::from(outer_angle));
            all.push(
                record,
                solid * brightness,
                Some(place(light.direction.normalize_or(DVec3::NEG_Z), spread, reach - spread)),
            );
        }
        LightKind::Directional { angle } => {
            // 1 - cos, without cancellation
            let one_minus_cos = 2.0 * (0.25 * f64::from(angle)).sin().powi(2);
            let record = LightRecord { kind: Kind::Directional as u32, radius: one_minus_cos as f32, ..base };
            all.push(record, PI * radius(flat).powi(2) * brightness, None);
        }
    }
}
