//! A camera on an orbit.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DVec3};

use super::Camera;
use crate::error::{Error, Result};

/// Rotates a camera about an axis at constant speed; its position and orientation relative to the
/// axis stay the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    centre: DVec3,
    axis: DVec3,
    frames_per_turn: f64,
}

impl Orbit {
    /// An orbit about the axis through `centre`, with one revolution in `frames_per_turn` frames:
    /// counter-clockwise seen against the direction of the axis, clockwise when negative.
    ///
    /// # Errors
    /// [`Error::Usage`] for a centre that is not finite, an axis of zero length, or zero frames per
    /// revolution.
    pub fn new(centre: DVec3, axis: DVec3, frames_per_turn: f64) -> Result<Self> {
        let wrong = |what: &str| Err(Error::Usage(format!("orbit: {what}")));
        let Some(axis) = axis.try_normalize() else { return wrong("the axis has no direction") };
        if !centre.is_finite() {
            return wrong("the centre is not finite");
        }
        if !frames_per_turn.is_finite() || frames_per_turn == 0.0 {
            return wrong("the number of frames per revolution must be finite and not 0");
        }
        Ok(Self { centre, axis, frames_per_turn })
    }

    /// An orbit about the vertical axis, +y, through `centre`; see [`Orbit::new`].
    pub fn vertical(centre: DVec3, frames_per_turn: f64) -> Result<Self> {
        Self::new(centre, DVec3::Y, frames_per_turn)
    }

    /// The camera at a frame, which may be fractional; at frame 0, and after every whole
    /// revolution, `camera` itself.
    pub fn camera_at(&self, camera: &Camera, frame: f64) -> Camera {
        let turn = (frame / self.frames_per_turn).fract();
        if turn == 0.0 {
            return camera.clone();
        }
        let rotation = DMat3::from_axis_angle(self.axis, turn * TAU);
        let DAffine3 { matrix3, translation } = camera.camera_to_world;
        let eye = self.centre + rotation * (translation - self.centre);
        Camera { camera_to_world: DAffine3::from_mat3_translation(rotation * matrix3, eye), ..camera.clone() }
    }
}
