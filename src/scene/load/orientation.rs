//! Scenes of files in which another axis than y points up.

use glam::{DAffine3, DMat3, DVec3};

use super::options::UpAxis;
use crate::error::{Error, Result};
use crate::scene::{Environment, Scene};

/// Turns all of a scene so that the axis of its file that points up becomes y.
///
/// # Errors
/// [`Error::Usage`] for an animated scene, whose nodes say where it is.
pub(super) fn apply(scene: &mut Scene, up: UpAxis) -> Result<()> {
    let turn = match up {
        UpAxis::Y => return Ok(()),
        // z to y, and y away from the viewer
        UpAxis::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
    };
    if scene.rig.is_some() {
        return Err(Error::Usage(format!("--up-axis {up}: {} is animated, and +y is up in such files", scene.name)));
    }
    let to_world = DAffine3::from_mat3(turn);
    for instance in &mut scene.instances {
        instance.object_to_world = to_world * instance.object_to_world;
    }
    for camera in &mut scene.cameras {
        camera.camera_to_world = to_world * camera.camera_to_world;
    }
    for light in &mut scene.lights {
        (light.position, light.direction) = (turn * light.position, turn * light.direction);
    }
    for portal in &mut scene.portals {
        portal.corner = turn * portal.corner;
        portal.edges = portal.edges.map(|edge| turn * edge);
    }
    if let Environment::Map(map) = &mut scene.environment {
        map.to_map *= turn.transpose();
    }
    Ok(())
}
