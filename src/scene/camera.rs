//! Cameras.

use glam::{DAffine3, DMat3, DVec3};

/// How directions map to the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Full vertical field of view in radians, in (0, pi).
        fov_y: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the height of the view in world units.
        half_height: f64,
    },
}

/// A camera. It looks along its own -z, +y is up in the image, +x to the right (glTF).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file; may be empty.
    pub name: String,
    /// Camera space to world; scale is removed by the constructor functions and loaders.
    pub camera_to_world: DAffine3,
    /// Projection.
    pub projection: Projection,
    /// Width over height the file asks for; the image size wins.
    pub aspect: Option<f64>,
}

impl Camera {
    /// A perspective camera at `eye` looking at `target`. `up` need not be perpendicular; when it is parallel to the view
    /// direction another one is chosen. `fov_y` in radians.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Self {
        let back = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        let right = up.cross(back).try_normalize().filter(|r| r.is_finite()).unwrap_or_else(|| back.any_orthonormal_vector());
        let basis = DMat3::from_cols(right, back.cross(right), back);
        Self {
            name: String::new(),
            camera_to_world: DAffine3::from_mat3_translation(basis, eye),
            projection: Projection::Perspective { fov_y },
            aspect: None,
        }
    }

    /// A 45-degree camera that sees all of the given bounds from the front, slightly above and to the side; `aspect` is
    /// width over height.
    pub fn framing(lo: DVec3, hi: DVec3, aspect: f64) -> Self {
        let (centre, radius) = ((lo + hi) * 0.5, ((hi - lo).length() * 0.5).max(1e-30));
        let fov_y = 45f64.to_radians();
        // the narrower of both fields of view must hold the bounding sphere
        let half = (fov_y * 0.5).min(((fov_y * 0.5).tan() * aspect).atan());
        let direction = DVec3::new(0.35, 0.3, 1.0).normalize();
        Self::look_at(centre + direction * (radius / half.sin()), centre, DVec3::Y, fov_y)
    }
}
