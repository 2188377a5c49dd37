//! Cameras.

use std::fmt;
use std::str::FromStr;

use glam::{DAffine3, DMat3, DVec3};

use crate::settings::number_or_text;

/// Clipping planes: a camera sees what lies between them. Distances along the view direction, scene
/// units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlanes {
    /// Distance of the near plane, at least 0.
    pub near: f64,
    /// Distance of the far plane, above that of the near one; may be infinite.
    pub far: f64,
}

impl ClipPlanes {
    /// A camera sees everything in front of it.
    pub const NONE: Self = Self { near: 0.0, far: f64::INFINITY };

    /// Where a ray from the camera passes the planes; `depth`: how much a unit of its length takes
    /// it along the view direction.
    pub fn of_ray(self, depth: f64) -> [f64; 2] {
        [self.near / depth, self.far / depth]
    }
}

impl Default for ClipPlanes {
    fn default() -> Self {
        Self::NONE
    }
}

/// `NEAR,FAR`, where FAR may be `inf`, or `none`.
impl FromStr for ClipPlanes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim() == "none" {
            return Ok(Self::NONE);
        }
        let numbers =
            text.split_once(',').and_then(|(near, far)| Some((near.trim().parse().ok()?, far.trim().parse().ok()?)));
        let planes = numbers.map(|(near, far)| Self { near, far });
        let holds = |p: &Self| p.near >= 0.0 && p.near.is_finite() && p.far > p.near;
        planes.filter(holds).ok_or_else(|| {
            "expected NEAR,FAR, two distances along the view direction in scene units of which the second is larger and may be `inf`, or `none`".to_owned()
        })
    }
}

impl fmt::Display for ClipPlanes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Self::NONE => f.write_str("none"),
            Self { near, far } => write!(f, "{near},{far}"),
        }
    }
}

impl serde::Serialize for ClipPlanes {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for ClipPlanes {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

/// How much an orthographic view shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ViewHeight {
    /// As much as the perspective view in its place shows of what it looks at.
    Fit,
    /// Height of the view, scene units, above 0.
    Units(f64),
}

/// `fit`, or a height above 0.
impl FromStr for ViewHeight {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim() == "fit" {
            return Ok(Self::Fit);
        }
        let height = text.trim().parse().ok().filter(|h: &f64| *h > 0.0 && h.is_finite());
        height.map(Self::Units).ok_or_else(|| "expected a height in scene units above 0, or `fit`".to_owned())
    }
}

impl fmt::Display for ViewHeight {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Fit => f.write_str("fit"),
            Self::Units(height) => write!(f, "{height}"),
        }
    }
}

impl serde::Serialize for ViewHeight {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fit => serializer.collect_str(self),
            Self::Units(height) => serializer.serialize_f64(*height),
        }
    }
}

impl<'de> serde::Deserialize<'de> for ViewHeight {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_text(deserializer)
    }
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Full vertical field of view in radians, in (0, pi).
        fov_y: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the height of the view, in scene units.
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
    /// Aspect ratio (width over height) in the file; the image size overrides it.
    pub aspect: Option<f64>,
    /// Clipping planes.
    pub clip: ClipPlanes,
}

impl Camera {
    /// Half the height of what it shows in a plane across its view at a distance, scene units.
    pub fn half_height_at(&self, distance: f64) -> f64 {
        match self.projection {
            Projection::Perspective { fov_y } => distance * (0.5 * fov_y).tan(),
            Projection::Orthographic { half_height } => half_height,
        }
    }

    /// A perspective camera at `eye` looking at `target`. `up` need not be perpendicular; when it
    /// is parallel to the view direction another one is chosen. `fov_y` in radians.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Self {
        let back = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        let right =
            up.cross(back).try_normalize().filter(|r| r.is_finite()).unwrap_or_else(|| back.any_orthonormal_vector());
        let basis = DMat3::from_cols(right, back.cross(right), back);
        Self {
            name: String::new(),
            camera_to_world: DAffine3::from_mat3_translation(basis, eye),
            projection: Projection::Perspective { fov_y },
            aspect: None,
            clip: ClipPlanes::NONE,
        }
    }

    /// A 45-degree camera that sees all of the given bounds from the front, slightly above and to
    /// the side, as large as fits; `aspect` is width over height.
    pub fn framing(lo: DVec3, hi: DVec3, aspect: f64) -> Self {
        let centre = (lo + hi) * 0.5;
        let half = ((hi - lo) * 0.5).max(DVec3::splat(1e-30));
        let fov_y = 45f64.to_radians();
        let direction = DVec3::new(0.35, 0.3, 1.0).normalize();
        let basis = Self::look_at(centre + direction, centre, DVec3::Y, fov_y).camera_to_world.matrix3;
        // least distance at which every corner of the box lies within the four planes of the view
        let tan = (fov_y * 0.5).tan();
        let corners =
            (0..8u32).map(|k| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { -half[a] } else { half[a] })));
        let distance = corners
            .map(|c| {
                let c = basis.transpose() * c;
                c.z + (c.x.abs() / (tan * aspect)).max(c.y.abs() / tan)
            })
            .fold(0.0, f64::max);
        // a margin of 5%
        Self::look_at(centre + direction * (distance * 1.05), centre, DVec3::Y, fov_y)
    }

    /// A perspective camera that looks against `from` (a direction, from the scene to the camera)
    /// and sees all of these spheres (centres and radii; 0 for points) as large as fits, with a
    /// margin of 5 %. `fov_y` in radians, `aspect` is width over height. `None` without spheres.
    pub fn enclosing(spheres: &[(DVec3, f64)], from: DVec3, up: DVec3, fov_y: f64, aspect: f64) -> Option<Self> {
        let basis = Self::look_at(from, DVec3::ZERO, up, fov_y).camera_to_world.matrix3;
        let (right, up, back) = (basis.x_axis, basis.y_axis, basis.z_axis);
        let tan_y = (fov_y * 0.5).tan() / 1.05;
        let tans = [tan_y * aspect, tan_y];
        let slants = tans.map(|t| (1.0 + t * t).sqrt());
        // Seen by a camera at (x, y, z) of its own axes, a point p lies within the planes at the
        // right and left if +-(p.x - x) <= tan (z - p.z). So tan z +- x is no less than the
        // greatest tan p.z +- p.x of all points; the same holds above and below. A sphere of radius
        // r adds r / cos.
        let (mut most, mut nearest) = ([[f64::NEG_INFINITY; 2]; 2], f64::NEG_INFINITY);
        for &(centre, radius) in spheres {
            let (along, z) = ([centre.dot(right), centre.dot(up)], centre.dot(back));
            nearest = nearest.max(z + radius);
            for axis in 0..2 {
                let reach = tans[axis] * z + radius * slants[axis];
                most[axis] = [most[axis][0].max(reach + along[axis]), most[axis][1].max(reach - along[axis])];
            }
        }
        if !nearest.is_finite() {
            return None;
        }
        let distance = |axis: usize| (most[axis][0] + most[axis][1]) / (2.0 * tans[axis]);
        // not within what it looks at
        let size = distance(0).max(distance(1)) - nearest;
        let z = distance(0).max(distance(1)).max(nearest + (1e-3 * size).max(1e-6 * nearest.abs()).max(1e-30));
        let middle = |axis: usize| 0.5 * (most[axis][0] - most[axis][1]);
        let eye = right * middle(0) + up * middle(1) + back * z;
        Some(Self {
            name: String::new(),
            camera_to_world: DAffine3::from_mat3_translation(basis, eye),
            projection: Projection::Perspective { fov_y },
            aspect: None,
            clip: ClipPlanes::NONE,
        })
    }
}

/// Position and orientation of `to_world` without its scale, shear and mirroring. Keeps -z and as
/// much of +y as it can.
pub(in crate::scene) fn rigid(to_world: &DAffine3) -> DAffine3 {
    let back = to_world.matrix3.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let right = to_world.matrix3.y_axis.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
    DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), to_world.translation)
}
