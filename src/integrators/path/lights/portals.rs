//! The environment, and the portals through which it is sampled.

use std::f64::consts::PI;

use super::super::params::INVALID;
use super::Gathered;
use crate::accel::flatten::FlatScene;
use crate::interface::LightKind as Kind;
use crate::interface::records::lights::LightRecord;

/// Share of its samples that the environment keeps where there are portals: light may come in elsewhere.
const KEPT: f64 = 0.2;

/// Adds the environment, of this mean brightness and power, and behind it the scene's portals; returns its index. With portals the power is what comes through
/// them, as through a lamp of their size: the environment's own would leave other lights of a room hardly any samples.
pub(super) fn add_environment(all: &mut Gathered, flat: &FlatScene, brightness: f64, power: f64) -> Option<u32> {
    let portals: Vec<_> = flat.scene.portals.iter().filter(|p| p.area() > 0.0).collect();
    let through = |area: f64| PI * area * brightness;
    let of_portals: f64 = portals.iter().map(|p| through(p.area())).sum();
    let own = if portals.is_empty() { power } else { of_portals * KEPT / (1.0 - KEPT) };
    let record = LightRecord {
        kind: Kind::Environment as u32,
        instance: INVALID,
        primitive: portals.len() as u32,
        ..Default::default()
    };
    let index = all.push(record, own, None);
    if index == INVALID {
        return None;
    }
    for portal in portals {
        let record = LightRecord {
            kind: Kind::Portal as u32,
            instance: INVALID,
            position: (portal.corner - flat.origin).as_vec3().to_array(),
            axis: portal.edges[0].as_vec3().to_array(),
            edge: portal.edges[1].as_vec3().to_array(),
            ..Default::default()
        };
        all.push(record, through(portal.area()), None);
    }
    Some(index)
}
