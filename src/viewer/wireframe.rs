//! Lines of world space as a camera sees them: projected, and cut off where they leave the view.

use glam::{DAffine3, DVec3};

use crate::scene::{Camera, Projection};

/// Share of the view's half width and height up to which lines are drawn beyond its border, so that
/// their ends are not seen.
const BEYOND: f64 = 0.02;

/// The edges of a box or a frustum whose corners are numbered by sides in bits 0 to 2.
pub const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// A line in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageLine {
    /// Both ends, from (0, 0) at the top left of the view to (1, 1).
    pub ends: [[f32; 2]; 2],
    /// Distance of its middle from the camera along the view direction, scene units.
    pub depth: f64,
}

/// Projects lines by a camera.
pub struct Projector {
    to_camera: DAffine3,
    projection: Projection,
    aspect: f64,
    /// Planes in camera space: visible is n.p + d >= 0.
    planes: [(DVec3, f64); 5],
}

impl Projector {
    /// Lines as `camera` sees them in a view of `aspect`, width over height. What is closer to a
    /// pinhole than `near` scene units is cut off, if no clipping plane does so before.
    pub fn new(camera: &Camera, aspect: f64, near: f64) -> Self {
        let wide = 1.0 + BEYOND;
        let (planes, near) = match camera.projection {
            // sides pass through the eye
            Projection::Perspective { fov_y } => {
                let half = (0.5 * fov_y).tan() * wide;
                let (x, y) = (half * aspect, half);
                let sides = [DVec3::new(-1.0, 0.0, -x), DVec3::new(1.0, 0.0, -x)];
                let ends = [DVec3::new(0.0, -1.0, -y), DVec3::new(0.0, 1.0, -y)];
                ([sides[0], sides[1], ends[0], ends[1]].map(|n| (n, 0.0)), camera.clip.near.max(near))
            }
            Projection::Orthographic { half_height } => {
                let (x, y) = (half_height * aspect * wide, half_height * wide);
                ([(DVec3::NEG_X, x), (DVec3::X, x), (DVec3::NEG_Y, y), (DVec3::Y, y)], camera.clip.near)
            }
        };
        let [a, b, c, d] = planes;
        Self {
            to_camera: camera.camera_to_world.inverse(),
            projection: camera.projection,
            aspect,
            planes: [a, b, c, d, (DVec3::NEG_Z, -near)],
        }
    }

    /// The part of a line between two points of world space that is in view.
    pub fn line(&self, from: DVec3, to: DVec3) -> Option<ImageLine> {
        let [a, b] = [from, to].map(|p| self.to_camera.transform_point3(p));
        if !a.is_finite() || !b.is_finite() {
            return None;
        }

        let ends = self.visible_part(a, b)?.map(|t| a.lerp(b, t));
        Some(ImageLine { ends: ends.map(|p| self.place(p)), depth: -0.5 * (ends[0].z + ends[1].z) })
    }

    /// The part of a line between two points of camera space that is in view, as shares of the way
    /// (Liang and Barsky 1984).
    fn visible_part(&self, a: DVec3, b: DVec3) -> Option<[f64; 2]> {
        let (mut first, mut last) = (0.0f64, 1.0f64);
        for (n, d) in self.planes {
            let [u, v] = [a, b].map(|p| n.dot(p) + d);
            match (u >= 0.0, v >= 0.0) {
                (false, false) => return None,
                (false, true) => first = first.max(u / (u - v)),
                (true, false) => last = last.min(u / (u - v)),
                (true, true) => {}
            }
        }
        (first <= last).then_some([first, last])
    }

    /// The place in the view of a point in camera space.
    fn place(&self, p: DVec3) -> [f32; 2] {
        let half = match self.projection {
            Projection::Perspective { fov_y } => (0.5 * fov_y).tan() * -p.z,
            Projection::Orthographic { half_height } => half_height,
        };
        [0.5 + 0.5 * p.x / (half * self.aspect), 0.5 - 0.5 * p.y / half].map(|at| at as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::survey::rays::camera_ray;
    use crate::scene::camera::ClipPlanes;

    const ASPECT: f64 = 1.6;

    fn cameras() -> [Camera; 2] {
        let eye = DVec3::new(3.0, 2.0, 5.0);
        let pinhole = Camera::look_at(eye, DVec3::new(0.2, 0.4, -1.0), DVec3::Y, 0.9);
        let parallel = Camera { projection: Projection::Orthographic { half_height: 1.7 }, ..pinhole.clone() };
        [pinhole, parallel]
    }

    /// A point on the ray of a pixel is seen in that pixel: projection is the reverse of what the
    /// renderer does.
    #[test]
    fn points_on_the_ray_of_a_pixel_are_seen_in_it() {
        for camera in cameras() {
            let projector = Projector::new(&camera, ASPECT, 1e-3);
            for k in 0..200 {
                let at = [0.01 + 0.98 * f64::from(k % 20) / 19.0, 0.01 + 0.98 * f64::from(k / 20) / 9.0];
                let (origin, direction) = camera_ray(&camera, at, ASPECT);
                let point = origin + direction * (0.5 + f64::from(k) * 0.1);
                let line = projector.line(point, point + direction).unwrap();
                for end in line.ends {
                    assert!((0..2).all(|a| (f64::from(end[a]) - at[a]).abs() < 1e-6), "{end:?} {at:?}");
                }
                let middle = point + direction * 0.5 - camera.camera_to_world.translation;
                assert!((line.depth - middle.dot(-camera.camera_to_world.matrix3.z_axis)).abs() < 1e-9);
            }
        }
    }

    /// A point of a line is in the part that is drawn just where it is in view.
    #[test]
    fn lines_are_cut_off_at_the_borders_of_the_view() {
        let number = |k: u32| f64::from(crate::sampling::to_unit(crate::sampling::sobol::hash_combine(7, k)));
        for (camera, near) in cameras().into_iter().zip([0.3, 0.0]) {
            let projector = Projector::new(&camera, ASPECT, 0.3);
            let (mut cut, mut whole, mut none) = (0, 0, 0);
            for k in 0..2000 {
                let point = |j: u32| DVec3::from_array([0, 1, 2].map(|a| 16.0 * number(6 * k + j + a) - 8.0));
                // long ones and short ones
                let ends = [point(0), point(0).lerp(point(3), if k % 2 == 0 { 1.0 } else { 0.1 })];
                let [a, b] = ends.map(|p| camera.camera_to_world.inverse().transform_point3(p));
                let drawn = projector.visible_part(a, b);
                for j in 0..=200 {
                    let t = f64::from(j) / 200.0;
                    let p = a.lerp(b, t);
                    let is_within = |x: f32| (-0.5 * BEYOND..=1.0 + 0.5 * BEYOND).contains(&f64::from(x));
                    let is_seen = -p.z >= near && projector.place(p).into_iter().all(is_within);
                    let is_drawn = drawn.is_some_and(|[first, last]| (first..=last).contains(&t));
                    let is_close = drawn.is_some_and(|part| part.iter().any(|end| (end - t).abs() < 1e-5));
                    assert!(is_seen == is_drawn || is_close, "{t} of {a} to {b}: {drawn:?}");
                }
                match drawn {
                    None => none += 1,
                    Some([0.0, 1.0]) => whole += 1,
                    Some(_) => cut += 1,
                }
                let line = projector.line(ends[0], ends[1]);
                assert_eq!(line.is_some(), drawn.is_some());
                assert!(line.is_none_or(|l| l.depth >= near - 1e-9 && l.ends.iter().flatten().all(|x| x.abs() < 1.1)));
            }
            assert!(cut > 100 && whole > 20 && none > 100, "{cut} cut, {whole} whole, {none} out of view");
        }
    }

    #[test]
    fn what_is_behind_the_camera_or_no_number_is_not_drawn() {
        let [pinhole, parallel] = cameras();
        let m = pinhole.camera_to_world;
        let place = |x: f64, y: f64, z: f64| m.transform_point3(DVec3::new(x, y, z));
        for camera in [&pinhole, &parallel] {
            let projector = Projector::new(camera, ASPECT, 0.01);
            assert_eq!(projector.line(place(0.0, 0.0, 1.0), place(0.5, 0.2, 3.0)), None);
            assert_eq!(projector.line(place(0.0, 0.0, -1.0), DVec3::NAN), None);
            // through the eye's plane: it goes on to the border, not back through the middle
            let line = projector.line(place(0.3, 0.0, -2.0), place(0.3, 0.0, 2.0)).unwrap();
            assert!(line.ends[0][0] > 0.5 && line.ends[1][0] > 0.5, "{line:?}");
        }
        // at the clipping plane of a file's camera
        let camera = Camera { clip: ClipPlanes { near: 1.0, far: 9.0 }, ..pinhole };
        let line = Projector::new(&camera, ASPECT, 0.01).line(place(0.0, 0.1, -0.5), place(0.0, 0.1, -3.0)).unwrap();
        let half = 0.45f64.tan();
        assert!((f64::from(line.ends[0][1]) - (0.5 - 0.05 / half)).abs() < 1e-6, "{line:?}");
        assert!((line.depth - 2.0).abs() < 1e-9);
    }
}
