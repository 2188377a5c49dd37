//! View and projection transforms for rasterization, and frustum culling.

use glam::{DMat3, DVec3, Vec3};

use crate::accel::Aabb;
use crate::error::{Error, Result};
use crate::film::block::Block;
use crate::film::camera::CameraRecord;

/// Margin around the image, pixels: a rasterizer rounds vertices to a fraction of a pixel.
const MARGIN: f64 = 1.0;
/// Relative rounding of clip coordinates: 32 half-ulps.
const ROUNDING: f64 = 16.0 * f32::EPSILON as f64;
/// Relative widening of the boxes that spheres are drawn in (shaders/raster/sphere.vert).
const WIDENED: f64 = 2e-3;
/// Near plane of a perspective view, relative to the farthest depth in it. Depth is reversed and
/// floating, so it costs no precision; single precision does not tell nearer points from the eye.
const NEAR: f64 = 1e-9;

/// An image, or a block of one, seen through a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The camera.
    pub camera: CameraRecord,
    /// Size of the whole image, pixels.
    pub image_size: [u32; 2],
    /// The rendered block of the image.
    pub block: Block,
    /// Position in its pixel of each ray, from the upper left corner; the centre is `[0.5, 0.5]`.
    /// The rays of the stream that uses the picture must pass there.
    pub at: [f32; 2],
}

/// Result of a frustum test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrustumTest {
    /// The box is certainly outside.
    Outside,
    /// The box may intersect the frustum.
    Intersecting,
    /// The box is certainly inside.
    Inside,
}

/// A plane, positive inside, of positions relative to the eye.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

/// The view frustum.
pub(super) struct Frustum {
    /// Camera position relative to the scene's origin.
    pub eye: Vec3,
    /// The camera's transform flips the winding order.
    pub turned: bool,
    orthographic: bool,
    /// Distances of the near and far clipping planes.
    clip_planes: [f64; 2],
    // clip coordinates x, y, w
    x: Plane,
    y: Plane,
    w: Plane,
    depth: Plane,
    // four sides and the front
    planes: [Plane; 5],
}

impl Plane {
    fn plus(self, other: Plane, factor: f64) -> Plane {
        Plane { normal: self.normal + other.normal * factor, offset: self.offset + other.offset * factor }
    }

    fn row(self, factor: f64) -> [f32; 4] {
        let (normal, offset) = (factor * self.normal, factor * self.offset);
        normal.extend(offset).as_vec4().to_array()
    }

    /// Conservative range of values over a group's box, rounding included.
    fn range(&self, bounds: &Aabb, to_world: &[[f32; 4]; 3], eye: DVec3) -> [f64; 2] {
        let row = |k: usize| DVec3::from_array([0, 1, 2].map(|j| to_world[k][j] as f64));
        let normal = row(0) * self.normal.x + row(1) * self.normal.y + row(2) * self.normal.z;
        let translation = DVec3::from_array([0, 1, 2].map(|k| to_world[k][3] as f64)) - eye;
        let (lo, hi) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        let middle = normal.dot(center) + self.normal.dot(translation) + self.offset;
        let terms = row(0).abs() * self.normal.x.abs()
            + row(1).abs() * self.normal.y.abs()
            + row(2).abs() * self.normal.z.abs();
        let rounding = terms.dot(lo.abs().max(hi.abs()))
            + self.normal.abs().dot(translation.abs() + eye.abs())
            + self.offset.abs();
        let reach = (1.0 + WIDENED) * normal.abs().dot(half) + ROUNDING * rounding;
        [middle - reach, middle + reach]
    }
}

impl Frustum {
    /// # Errors
    /// [`Error::Scene`] when the camera's transform is flat.
    pub fn new(view: &View) -> Result<Self> {
        let rows = view.camera.camera_to_world;
        let column = |k: usize| DVec3::from_array(rows.map(|r| r[k] as f64));
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        let determinant = matrix.determinant();
        let inverse = matrix.inverse().transpose();
        if determinant == 0.0 || !determinant.is_finite() || !inverse.is_finite() {
            return Err(Error::Scene("the camera's transform cannot be inverted (a scale of zero?)".into()));
        }
        // camera space, row by row
        let [right, up, back] = [inverse.x_axis, inverse.y_axis, inverse.z_axis];
        let depth = Plane { normal: -back, offset: 0.0 };
        let orthographic = view.camera.orthographic;
        let w = if orthographic { Plane { normal: DVec3::ZERO, offset: 1.0 } } else { depth };
        let side = |axis: DVec3, k: usize, sign: f64| {
            let (image, block) = (view.image_size[k] as f64, view.block.size[k] as f64);
            let scale = sign * image / (view.camera.view[k] as f64 * block);
            // pixels are sampled at their centre: the image is moved so that `at` lies there
            let moved = (image - 2.0 * view.block.origin[k] as f64 + 1.0 - 2.0 * view.at[k] as f64) / block - 1.0;
            Plane { normal: axis * scale, offset: 0.0 }.plus(w, moved)
        };
        let (x, y) = (side(right, 0, 1.0), side(up, 1, -1.0));
        let wide = view.block.size.map(|n| 1.0 + 2.0 * MARGIN / n as f64);
        let kept = |p: Plane, k: usize, sign: f64| {
            Plane { normal: w.normal * wide[k], offset: w.offset * wide[k] }.plus(p, sign)
        };
        Ok(Self {
            eye: column(3).as_vec3(),
            turned: determinant < 0.0,
            orthographic,
            clip_planes: view.camera.clip.map(f64::from),
            x,
            y,
            w,
            depth,
            planes: [kept(x, 0, 1.0), kept(x, 0, -1.0), kept(y, 1, 1.0), kept(y, 1, -1.0), depth],
        })
    }

    /// Tests a group's box against the frustum.
    pub fn classify(&self, bounds: &Aabb, to_world: &[[f32; 4]; 3]) -> FrustumTest {
        let mut result = FrustumTest::Inside;
        for plane in &self.planes {
            let [least, most] = plane.range(bounds, to_world, self.eye.as_dvec3());
            if most < 0.0 {
                return FrustumTest::Outside;
            }
            // NaN is no reason to leave anything out, nor to take all for seen
            if least.is_nan() || least < 0.0 {
                result = FrustumTest::Intersecting;
            }
        }
        result
    }

    /// Least and greatest depth of a group's box.
    pub fn depth(&self, bounds: &Aabb, to_world: &[[f32; 4]; 3]) -> [f64; 2] {
        self.depth.range(bounds, to_world, self.eye.as_dvec3())
    }

    /// Rows of the matrix from positions relative to the eye to clip space, whose depth is greatest
    /// in front. `depth` is the visible range; clip space is `wide` times as large as the image.
    pub fn clip(&self, depth: [f64; 2], wide: f64) -> [[f32; 4]; 4] {
        let [clip_near, clip_far] = self.clip_planes;
        let z = if self.orthographic {
            let (near, far) = (depth[0].max(clip_near), depth[1].max(clip_near).min(clip_far));
            let length = (far - near).max(1e-30);
            Plane { normal: -self.depth.normal / length, offset: far / length }
        } else {
            let near = self.nearest(depth).max(clip_near);
            if clip_far.is_finite() {
                // 1 at the near plane and 0 at the far one, after division by the depth
                let scale = near / (clip_far - near).max(1e-30);
                Plane { normal: -self.depth.normal * scale, offset: clip_far * scale }
            } else {
                Plane { normal: DVec3::ZERO, offset: near }
            }
        };
        [self.x.row(1.0 / wide), self.y.row(1.0 / wide), z.row(1.0), self.w.row(1.0)]
    }

    /// Distance of what single precision does not tell from the eye.
    fn nearest(&self, depth: [f64; 2]) -> f64 {
        (NEAR * depth[1]).max(1e-30)
    }

    /// Depth in clip space of points in front of the camera; `depth` as for [`Frustum::clip`].
    pub fn box_depth(&self, depth: [f64; 2]) -> f32 {
        if self.orthographic { 0.5 } else { self.nearest(depth) as f32 }
    }
}
