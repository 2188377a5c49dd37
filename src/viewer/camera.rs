//! The camera of the viewer: orbit, pan, zoom and fly.

use glam::{DAffine3, DMat3, DVec3};

use crate::scene::{Camera, Projection};

/// Angle per point of the screen that a drag turns the camera by, radians.
const TURN: f64 = 0.006;
/// Closest that the view direction comes to the vertical, radians.
const POLE: f64 = 1e-3;

/// A camera that a user moves: its position, and a pivot in front of it around which it orbits.
/// World up is +y.
#[derive(Clone, Debug)]
pub struct CameraControl {
    camera: Camera,
    /// Distance of the pivot along the view direction, scene units.
    distance: f64,
    /// Diagonal of the scene's bounds, scene units.
    scene_size: f64,
    /// Speed of flight, as a factor of what suits the scene.
    pub speed: f64,
}

impl CameraControl {
    /// A control of this camera. `bounds` are the scene's, in its world space.
    pub fn new(camera: Camera, bounds: (DVec3, DVec3)) -> Self {
        let (lo, hi) = bounds;
        let scene_size = (hi - lo).length().max(1e-30);
        let mut control = Self { camera, distance: 1.0, scene_size, speed: 1.0 };
        control.set_camera(control.camera.clone(), (lo + hi) * 0.5);
        control
    }

    /// Replaces the camera. The pivot is where the view direction is closest to `centre`.
    pub fn set_camera(&mut self, camera: Camera, centre: DVec3) {
        let ahead = (centre - camera.camera_to_world.translation).dot(-camera.camera_to_world.matrix3.z_axis);
        self.camera = camera;
        self.distance = ahead.max(0.02 * self.scene_size);
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Diagonal of the scene's bounds, scene units.
    pub fn scene_size(&self) -> f64 {
        self.scene_size
    }

    fn eye(&self) -> DVec3 {
        self.camera.camera_to_world.translation
    }

    fn forward(&self) -> DVec3 {
        -self.camera.camera_to_world.matrix3.z_axis
    }

    /// The point that it orbits.
    pub fn pivot(&self) -> DVec3 {
        self.eye() + self.forward() * self.distance
    }

    /// Points it in a direction, given as turns about the vertical and about its own horizontal
    /// axis; roll is kept out.
    fn turn(&mut self, yaw: f64, pitch: f64) {
        let forward = self.forward();
        let elevation = forward.y.clamp(-1.0, 1.0).asin();
        // a camera that looks straight up or down takes its heading from its up vector
        let flat = DVec3::new(forward.x, 0.0, forward.z);
        let up = self.camera.camera_to_world.matrix3.y_axis;
        let flat = if flat.length() > 1e-6 { flat } else { DVec3::new(up.x, 0.0, up.z) * -forward.y.signum() };
        let heading = flat.x.atan2(-flat.z) + yaw;
        let most = std::f64::consts::FRAC_PI_2 - POLE;
        let elevation = (elevation + pitch).clamp(-most, most);
        let forward = DVec3::new(heading.sin() * elevation.cos(), elevation.sin(), -heading.cos() * elevation.cos());
        let right = forward.cross(DVec3::Y).normalize();
        self.camera.camera_to_world.matrix3 = DMat3::from_cols(right, right.cross(forward), -forward);
        self.become_free();
    }

    /// Turns around the pivot by a drag of so many points.
    pub fn orbit(&mut self, dx: f64, dy: f64) {
        let pivot = self.pivot();
        self.turn(dx * TURN, -dy * TURN);
        self.camera.camera_to_world.translation = pivot - self.forward() * self.distance;
    }

    /// Turns around its own position by a drag of so many points.
    pub fn look(&mut self, dx: f64, dy: f64) {
        self.turn(dx * TURN * 0.5, -dy * TURN * 0.5);
    }

    /// Moves sideways and up, so that the pivot follows a drag of so many points in a view of
    /// `height` points.
    pub fn pan(&mut self, dx: f64, dy: f64, height: f64) {
        let visible = match self.camera.projection {
            Projection::Perspective { fov_y } => 2.0 * self.distance * (0.5 * fov_y).tan(),
            Projection::Orthographic { half_height } => 2.0 * half_height,
        };
        let unit = visible / height.max(1.0);
        let m = self.camera.camera_to_world.matrix3;
        self.shift((m.y_axis * dy - m.x_axis * dx) * unit);
    }

    /// Moves towards the pivot: at 1 not at all, at 0.5 half the way, at 2 back to twice the
    /// distance.
    pub fn zoom(&mut self, factor: f64) {
        let factor = factor.clamp(0.05, 20.0);
        if let Projection::Orthographic { half_height } = &mut self.camera.projection {
            *half_height *= factor;
            return;
        }
        let pivot = self.pivot();
        self.distance = (self.distance * factor).clamp(1e-6 * self.scene_size, 1e4 * self.scene_size);
        self.camera.camera_to_world.translation = pivot - self.forward() * self.distance;
        self.become_free();
    }

    /// Flies for some seconds: right, up and forward, each from -1 to 1.
    pub fn fly(&mut self, [right, up, forward]: [f64; 3], seconds: f64) {
        let m = self.camera.camera_to_world.matrix3;
        // a scene is crossed in five seconds
        let step = 0.2 * self.scene_size * self.speed * seconds;
        self.shift((m.x_axis * right + DVec3::Y * up - m.z_axis * forward) * step);
    }

    /// Turns towards a point and comes to half its distance; it is the pivot from then on.
    pub fn focus(&mut self, point: DVec3) {
        let offset = point - self.eye();
        let distance = offset.length();
        if distance < 1e-9 * self.scene_size {
            return;
        }
        let camera = Camera::look_at(self.eye() + offset * 0.5, point, DVec3::Y, 1.0);
        self.camera.camera_to_world = camera.camera_to_world;
        self.become_free();
        self.distance = 0.5 * distance;
    }

    /// Turns around the vertical axis through the pivot by an angle in radians.
    pub fn turntable(&mut self, angle: f64) {
        let pivot = self.pivot();
        let turned = DMat3::from_rotation_y(angle);
        let m = &mut self.camera.camera_to_world;
        *m = DAffine3::from_mat3_translation(turned * m.matrix3, pivot + turned * (m.translation - pivot));
        self.become_free();
    }

    /// Sets the vertical field of view, radians; without effect on orthographic cameras.
    pub fn set_fov_y(&mut self, radians: f64) {
        if let Projection::Perspective { fov_y } = &mut self.camera.projection {
            *fov_y = radians;
        }
    }

    fn shift(&mut self, by: DVec3) {
        self.camera.camera_to_world.translation += by;
        self.become_free();
    }

    /// It is no longer one of the file's, whose far clipping plane would hide the scene from
    /// whoever steps back.
    fn become_free(&mut self) {
        self.camera.name.clear();
        self.camera.clip.far = f64::INFINITY;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control() -> CameraControl {
        let camera = Camera::look_at(DVec3::new(0.0, 1.0, 5.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 0.8);
        CameraControl::new(camera, (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 2.0, 1.0)))
    }

    fn is_rigid(camera: &Camera) -> bool {
        let m = camera.camera_to_world.matrix3;
        (m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, 1e-9) && m.determinant() > 0.0
    }

    #[test]
    fn orbits_keep_the_pivot_and_its_distance() {
        let mut c = control();
        assert!((c.pivot() - DVec3::Y).length() < 1e-12);
        for k in 0..200 {
            c.orbit(17.0, if k % 3 == 0 { 40.0 } else { -25.0 });
            assert!((c.pivot() - DVec3::Y).length() < 1e-9 && (c.eye() - DVec3::Y).length() - 5.0 < 1e-9);
            assert!(is_rigid(c.camera()) && c.camera().camera_to_world.matrix3.x_axis.y.abs() < 1e-9, "no roll");
        }
        // beyond the pole it stops
        c.orbit(0.0, 1e5);
        assert!(is_rigid(c.camera()) && c.forward().y.abs() < 1.0);
    }

    #[test]
    fn drags_move_what_is_under_the_pointer() {
        let mut c = control();
        // the pivot's plane is 2 * 5 * tan(0.4) high: a drag over the whole height moves the camera
        // by that
        c.pan(0.0, 600.0, 600.0);
        assert!((c.eye().y - (1.0 + 10.0 * 0.4f64.tan())).abs() < 1e-9);
        c.zoom(0.5);
        assert!((c.distance - 2.5).abs() < 1e-12);
        let before = c.pivot();
        c.turntable(1.0);
        assert!((c.pivot() - before).length() < 1e-9 && is_rigid(c.camera()));
        c.focus(DVec3::new(1.0, 2.0, 3.0));
        assert!((c.pivot() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-9);
    }

    #[test]
    fn a_camera_that_looks_down_turns_without_roll() {
        let mut c = control();
        c.set_camera(Camera::look_at(DVec3::new(0.0, 9.0, 0.0), DVec3::ZERO, DVec3::NEG_Z, 0.8), DVec3::ZERO);
        c.orbit(0.0, 0.0);
        assert!(is_rigid(c.camera()));
        assert!((c.camera().camera_to_world.matrix3.y_axis - DVec3::NEG_Z).length() < 0.01, "{:?}", c.camera());
    }
}
