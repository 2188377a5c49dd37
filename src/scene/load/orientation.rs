//! Scenes of files in which another axis than y points up.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::options::UpAxis;
use crate::scene::{AnimationRig, Environment, Scene};

/// The rotation from a file's axes to those of a scene; `None` where they are the same.
fn rotation(up: UpAxis) -> Option<DMat3> {
    match up {
        UpAxis::Y => None,
        // z to y, and y away from the viewer
        UpAxis::Z => Some(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)),
    }
}

/// Turns what animations place, before the pose at rest is applied.
pub(super) fn turn_rig(rig: &mut AnimationRig, up: UpAxis) {
    if let Some(turn) = rotation(up) {
        rig.turn(DQuat::from_mat3(&turn));
    }
}

/// Turns all of a scene that no rig places, so that the axis of its file that points up becomes y.
pub(super) fn apply(scene: &mut Scene, up: UpAxis) {
    let Some(turn) = rotation(up) else { return };
    let to_world = DAffine3::from_mat3(turn);
    let placed = scene.rig.as_ref().map(|rig| rig.placed_instances(scene)).unwrap_or_default();
    let parts = scene.rig.as_ref().map(AnimationRig::parts);
    let is_placed =
        |nodes: Option<&Vec<Option<usize>>>, i: usize| nodes.is_some_and(|n| n.get(i).is_some_and(Option::is_some));

    // instances, cameras and lights
    for (i, instance) in scene.instances.iter_mut().enumerate() {
        if !placed.get(i).is_some_and(|p| *p) {
            instance.object_to_world = to_world * instance.object_to_world;
        }
    }
    for (i, camera) in scene.cameras.iter_mut().enumerate() {
        if !is_placed(parts.map(|p| &p.cameras), i) {
            camera.camera_to_world = to_world * camera.camera_to_world;
        }
    }
    for (i, light) in scene.lights.iter_mut().enumerate() {
        if !is_placed(parts.map(|p| &p.lights), i) {
            (light.position, light.direction) = (turn * light.position, turn * light.direction);
        }
    }

    // what no node has
    for portal in &mut scene.portals {
        portal.corner = turn * portal.corner;
        portal.edges = portal.edges.map(|edge| turn * edge);
    }
    if let Environment::Map(map) = &mut scene.environment {
        map.to_map *= turn.transpose();
    }
}
