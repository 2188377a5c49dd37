//! The camera of the viewer: orbit, pan, zoom and fly.

use glam::{DAffine3, DMat3, DVec3};

use crate::renderer::settings::DEFAULT_FOV_Y;
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
    /// The camera at the beginning.
    opening: Camera,
    /// Distance of the pivot along the view direction, scene units.
    distance: f64,
    /// Diagonal of the scene's bounds, scene units.
    scene_size: f64,
    /// Distance of what is ahead, scene units, where something is.
    pub near: Option<f64>,
    /// Speed of flight, as a factor of what suits the scene and what is near.
    pub speed: f64,
}

impl CameraControl {
    /// A control of this camera. `bounds` are the scene's, in its world space.
    pub fn new(camera: Camera, bounds: (DVec3, DVec3)) -> Self {
        let (lo, hi) = bounds;
        let scene_size = (hi - lo).length().max(1e-30);
        let mut control = Self { opening: camera.clone(), camera, distance: 1.0, scene_size, near: None, speed: 1.0 };
        control.set_camera(control.camera.clone(), (lo + hi) * 0.5);
        control
    }

    /// Replaces the camera. The pivot is where the view direction is closest to `centre`.
    pub fn set_camera(&mut self, camera: Camera, centre: DVec3) {
        let ahead = (centre - camera.camera_to_world.translation).dot(-camera.camera_to_world.matrix3.z_axis);
        self.camera = camera;
        self.near = None;
        self.distance = ahead.max(0.02 * self.scene_size);
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The camera at the beginning.
    pub fn opening(&self) -> &Camera {
        &self.opening
    }

    /// Diagonal of the scene's bounds, scene units.
    pub fn scene_size(&self) -> f64 {
        self.scene_size
    }

    /// The position of the camera.
    pub fn eye(&self) -> DVec3 {
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
        let unit = 2.0 * self.camera.half_height_at(self.distance) / height.max(1.0);
        let m = self.camera.camera_to_world.matrix3;
        self.shift((m.y_axis * dy - m.x_axis * dx) * unit);
    }

    /// Looks along an axis at the pivot, from the same distance.
    pub fn view(&mut self, view: AxisView) {
        let (forward, up) = view.directions();
        let pivot = self.pivot();
        let right = forward.cross(up);
        self.camera.camera_to_world =
            DAffine3::from_mat3_translation(DMat3::from_cols(right, up, -forward), pivot - forward * self.distance);
        self.become_free();
    }

    /// Moves to a position, from which it looks at a target, its pivot from then on. Nothing
    /// happens where they are the same point, or not finite.
    pub fn place(&mut self, eye: DVec3, target: DVec3) {
        let offset = target - eye;
        let distance = offset.length();
        if !eye.is_finite() || !target.is_finite() || distance < 1e-9 * self.scene_size {
            return;
        }
        // straight up or down there is no horizontal axis to keep
        let is_vertical = offset.x.hypot(offset.z) < POLE * distance;
        let up = if is_vertical { self.camera.camera_to_world.matrix3.y_axis } else { DVec3::Y };
        let up = if up.cross(offset).length() < POLE * distance { DVec3::NEG_Z } else { up };
        self.camera.camera_to_world = Camera::look_at(eye, target, up, 1.0).camera_to_world;
        self.distance = distance;
        self.become_free();
    }

    /// Zooms as [`CameraControl::zoom`] does, but towards what is under the pointer in the plane of
    /// the pivot. `at`: the pointer from the middle of the image, right and up, in halves of its
    /// height.
    pub fn zoom_at(&mut self, factor: f64, at: [f64; 2]) {
        let half_height = |c: &Self| c.camera.half_height_at(c.distance);
        let before = half_height(self);
        self.zoom(factor);
        let m = self.camera.camera_to_world.matrix3;
        self.shift((m.x_axis * at[0] + m.y_axis * at[1]) * (before - half_height(self)));
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

    /// Looks at bounds in the direction of before, from where they fill most of a view of `aspect`,
    /// width over height. Their middle is the pivot from then on.
    pub fn frame(&mut self, (lo, hi): (DVec3, DVec3), aspect: f64) {
        let radius = (0.5 * (hi - lo).length()).max(1e-6 * self.scene_size);
        match &mut self.camera.projection {
            Projection::Perspective { fov_y } => {
                let half = 0.5 * *fov_y;
                let narrow = half.min((half.tan() * aspect).atan());
                self.distance = 1.1 * radius / narrow.sin().max(1e-3);
            }
            Projection::Orthographic { half_height } => {
                *half_height = 1.1 * radius / aspect.min(1.0);
                self.distance = 2.0 * radius;
            }
        }
        self.camera.camera_to_world.translation = (lo + hi) * 0.5 - self.forward() * self.distance;
        self.become_free();
    }

    /// Flies for some seconds: right, up and forward, each from -1 to 1.
    pub fn fly(&mut self, [right, up, forward]: [f64; 3], seconds: f64) {
        let m = self.camera.camera_to_world.matrix3;
        // a scene is crossed in five seconds, what is near reached in one and a half
        let near = self.near.map_or(0.2, |near| (near / (1.5 * self.scene_size)).clamp(0.005, 0.2));
        let step = near * self.scene_size * self.speed * seconds;
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
        if let Projection::Orthographic { half_height } = &mut self.camera.projection {
            *half_height *= 0.5;
        }
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

    /// Changes between perspective and parallel rays; what is at the pivot keeps its size.
    pub fn set_orthographic(&mut self, is_orthographic: bool) {
        let half_height = self.camera.half_height_at(self.distance);
        match self.camera.projection {
            Projection::Perspective { .. } if is_orthographic => {
                self.camera.projection = Projection::Orthographic { half_height };
            }
            Projection::Orthographic { .. } if !is_orthographic => {
                let (pivot, fov_y) = (self.pivot(), DEFAULT_FOV_Y.to_radians());
                self.camera.projection = Projection::Perspective { fov_y };
                self.distance = half_height / (0.5 * fov_y).tan();
                self.camera.camera_to_world.translation = pivot - self.forward() * self.distance;
            }
            _ => return,
        }
        self.become_free();
    }

    /// Sets the height of a view of parallel rays, scene units; without effect on others.
    pub fn set_height(&mut self, height: f64) {
        if let Projection::Orthographic { half_height } = &mut self.camera.projection {
            *half_height = 0.5 * height;
            self.become_free();
        }
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

/// A direction along an axis of the world, by the side of the scene that it shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisView {
    Front,
    Back,
    Right,
    Left,
    Top,
    Bottom,
}

impl AxisView {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Front, Self::Back, Self::Right, Self::Left, Self::Top, Self::Bottom];

    /// Name for people.
    pub fn label(self) -> &'static str {
        match self {
            Self::Front => "Front",
            Self::Back => "Back",
            Self::Right => "Right",
            Self::Left => "Left",
            Self::Top => "Top",
            Self::Bottom => "Bottom",
        }
    }

    /// Where it looks, and what is up in the image. Models of glTF face +z.
    fn directions(self) -> (DVec3, DVec3) {
        match self {
            Self::Front => (DVec3::NEG_Z, DVec3::Y),
            Self::Back => (DVec3::Z, DVec3::Y),
            Self::Right => (DVec3::NEG_X, DVec3::Y),
            Self::Left => (DVec3::X, DVec3::Y),
            Self::Top => (DVec3::NEG_Y, DVec3::NEG_Z),
            Self::Bottom => (DVec3::Y, DVec3::Z),
        }
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
    fn parallel_rays_show_what_is_at_the_pivot_as_large() {
        let mut c = control();
        let (pivot, height) = (c.pivot(), 10.0 * 0.4f64.tan());
        c.set_orthographic(true);
        assert_eq!(c.camera().projection, Projection::Orthographic { half_height: 0.5 * height });
        c.zoom(0.5);
        c.set_height(3.0);
        c.set_orthographic(true);
        assert_eq!(c.camera().half_height_at(7.0), 1.5);
        c.set_orthographic(false);
        assert!((c.camera().half_height_at(c.distance) - 1.5).abs() < 1e-12 && (c.pivot() - pivot).length() < 1e-9);
        assert!(is_rigid(c.camera()));
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
    fn flights_are_slow_where_something_is_near() {
        let way = |near: Option<f64>| {
            let mut c = control();
            c.near = near;
            let before = c.eye();
            c.fly([0.0, 0.0, 1.0], 0.1);
            (c.eye() - before).length()
        };
        let size = control().scene_size();
        assert!((way(None) - 0.02 * size).abs() < 1e-9);
        assert!((way(Some(0.3)) - 0.02).abs() < 1e-9, "it is reached in one and a half seconds");
        assert_eq!(way(Some(1e3)), way(None), "never faster than with nothing ahead");
        assert!(way(Some(0.0)) > 0.0);
        // and objects are framed
        let mut c = control();
        c.frame((DVec3::new(0.4, 1.4, 0.0), DVec3::new(0.6, 1.6, 0.2)), 1.5);
        assert!((c.pivot() - DVec3::new(0.5, 1.5, 0.1)).length() < 1e-9 && is_rigid(c.camera()));
        assert!(c.distance < 1.0, "{}", c.distance);
    }

    #[test]
    fn axes_places_and_pointers() {
        // along each axis the pivot and its distance stay
        for view in AxisView::ALL {
            let mut c = control();
            c.view(view);
            assert!(is_rigid(c.camera()), "{view:?}");
            assert!((c.pivot() - DVec3::Y).length() < 1e-9 && (c.eye() - DVec3::Y).length() - 5.0 < 1e-9, "{view:?}");
            // and one can go on from there
            c.orbit(30.0, 20.0);
            assert!(is_rigid(c.camera()) && c.camera().camera_to_world.matrix3.x_axis.y.abs() < 1e-9, "{view:?}");
        }
        let mut c = control();
        c.view(AxisView::Top);
        assert!((c.eye() - DVec3::new(0.0, 6.0, 0.0)).length() < 1e-9, "{}", c.eye());

        // typed positions, the one straight above the target, too
        for (eye, target) in [(DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO), (DVec3::new(1.0, 9.0, 1.0), DVec3::ONE)] {
            c.place(eye, target);
            assert!(is_rigid(c.camera()) && (c.pivot() - target).length() < 1e-9 && (c.eye() - eye).length() < 1e-9);
        }
        let before = c.camera().clone();
        c.place(DVec3::ONE, DVec3::ONE);
        c.place(DVec3::NAN, DVec3::ONE);
        assert_eq!(*c.camera(), before);

        // what is under the pointer stays there
        let mut c = control();
        let under = |c: &CameraControl, [x, y]: [f64; 2]| {
            let m = c.camera().camera_to_world.matrix3;
            c.pivot() + (m.x_axis * x + m.y_axis * y) * c.distance * 0.4f64.tan()
        };
        let point = under(&c, [0.7, -0.4]);
        c.zoom_at(0.25, [0.7, -0.4]);
        assert!((under(&c, [0.7, -0.4]) - point).length() < 1e-9 && (c.distance - 1.25).abs() < 1e-12);
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
