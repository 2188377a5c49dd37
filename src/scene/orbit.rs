//! A camera that goes round.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DVec3};

use super::Camera;
use crate::error::{Error, Result};

/// Turns a camera about an axis, always the same way and at the same speed. It keeps its distance and what it sees of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    around: DVec3,
    axis: DVec3,
    frames_per_turn: f64,
}

impl Orbit {
    /// About the axis through `around`, once in `frames_per_turn` frames: counter-clockwise as seen from where the axis points,
    /// clockwise when negative.
    ///
    /// # Errors
    /// [`Error::Usage`] for a point that is not finite, an axis without a direction, or a turn of no frames.
    pub fn new(around: DVec3, axis: DVec3, frames_per_turn: f64) -> Result<Self> {
        let wrong = |what: &str| Err(Error::Usage(format!("orbit: {what}")));
        let Some(axis) = axis.try_normalize() else { return wrong("the axis has no direction") };
        if !around.is_finite() {
            return wrong("the point to turn about is not finite");
        }
        if !frames_per_turn.is_finite() || frames_per_turn == 0.0 {
            return wrong("the frames of a turn must be finite and not 0");
        }
        Ok(Self { around, axis, frames_per_turn })
    }

    /// About the vertical, +y, through `around`; see [`Orbit::new`].
    pub fn vertical(around: DVec3, frames_per_turn: f64) -> Result<Self> {
        Self::new(around, DVec3::Y, frames_per_turn)
    }

    /// The camera at a frame, which need not be whole; at frame 0, and after every whole turn, `camera` itself.
    pub fn camera_at(&self, camera: &Camera, frame: f64) -> Camera {
        let turn = (frame / self.frames_per_turn).fract();
        if turn == 0.0 {
            return camera.clone();
        }
        let rotation = DMat3::from_axis_angle(self.axis, turn * TAU);
        let DAffine3 { matrix3, translation } = camera.camera_to_world;
        let eye = self.around + rotation * (translation - self.around);
        Camera { camera_to_world: DAffine3::from_mat3_translation(rotation * matrix3, eye), ..camera.clone() }
    }
}
