//! The environment, and the portals through which it is sampled.

use std::f64::consts::PI;

use super::super::params::INVALID;
use super::{LightBuilder, LightCollector, brightness};
use crate::interface::LightKind as Kind;
use crate::interface::records::lights::LightRecord;
use crate::scene::Scene;

/// Fraction of the environment's samples that do not use portals, because light may enter
/// elsewhere.
const ENVIRONMENT_SHARE: f64 = 0.2;

/// Adds the environment, followed by the scene's portals; returns its index. Portals are chosen by
/// the light that enters through them.
pub(super) fn add_environment(all: &mut LightCollector, builder: &LightBuilder, scene: &Scene) -> Option<u32> {
    let brightness = brightness(builder.environment);
    let portals: Vec<_> = scene.portals.iter().filter(|p| p.area() > 0.0).collect();
    let through = |area: f64| PI * area * brightness;
    let of_portals: f64 = portals.iter().map(|p| through(p.area())).sum();
    let own =
        if portals.is_empty() { PI * brightness } else { of_portals * ENVIRONMENT_SHARE / (1.0 - ENVIRONMENT_SHARE) };
    let record = LightRecord {
        kind: Kind::Environment as u32,
        instance: INVALID,
        primitive: portals.len() as u32,
        ..Default::default()
    };
    let index = all.push_distant(record, own);
    if index == INVALID {
        return None;
    }
    for portal in portals {
        let record = LightRecord {
            kind: Kind::Portal as u32,
            instance: INVALID,
            position: (portal.corner - builder.origin).as_vec3().to_array(),
            axis: portal.edges[0].as_vec3().to_array(),
            edge: portal.edges[1].as_vec3().to_array(),
            ..Default::default()
        };
        all.push_distant(record, through(portal.area()));
    }
    Some(index)
}
