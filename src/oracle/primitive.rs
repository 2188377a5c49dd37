//! Triangles and spheres in double precision.

use super::OracleRay;
use glam::{DAffine3, DVec3};

/// Hits are accepted whose point on the primitive lies within this share of the distance to its
/// farthest vertex from the ray. Only a ray that lies in the triangle's plane to about six digits
/// can fail it: its hit point is rounding noise, and the traversal of boxes could not promise to
/// find it.
pub const RESIDUAL: f64 = 1e-10;

/// A triangle in world space, relative to the oracle's origin. Both faces count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners.
    pub v: [DVec3; 3],
    /// Index into [`crate::scene::Scene::instances`].
    pub instance: u32,
    /// Index in the instance's mesh.
    pub primitive: u32,
}

impl Triangle {
    /// `(min, max)`.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let [a, b, c] = self.v;
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// Unit normal by the right-hand rule; zero for a triangle without area.
    pub fn normal(&self) -> DVec3 {
        let [a, b, c] = self.v;
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Parameter and barycentric weights of the second and third corner, for the whole line; `None`
    /// when it passes outside.
    ///
    /// The test of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013:
    /// corners are sheared into a space where the ray is the z axis. Two triangles that share an
    /// edge compute the same magnitude for it with opposite sign, bit for bit, and zero counts as
    /// inside: a ray cannot pass between them.
    pub fn intersect(&self, ray: &OracleRay) -> Option<(f64, [f64; 2])> {
        let d = ray.direction;
        let z = d.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let (shear_x, shear_y) = (d[x] / d[z], d[y] / d[z]);
        let [a, b, c] = self.v.map(|v| {
            let p = v - ray.origin;
            DVec3::new(p[x] - shear_x * p[z], p[y] - shear_y * p[z], p[z])
        });
        let (u, v, w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let (u, v, w) = (u / det, v / det, w / det);
        let point = a * u + b * v + c * w;
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        (point.x.abs().max(point.y.abs()) <= RESIDUAL * reach).then_some((point.z / d[z], [v, w]))
    }
}

/// A sphere placed by any affine transform: in the world it may be an ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpherePrimitive {
    /// Object-space centre.
    pub center: DVec3,
    /// Object-space radius.
    pub radius: f64,
    /// Object space to world relative to the oracle's origin.
    pub object_to_world: DAffine3,
    /// Inverse of `object_to_world`.
    pub world_to_object: DAffine3,
    /// Index into [`crate::scene::Scene::instances`].
    pub instance: u32,
    /// Index in the instance's mesh.
    pub primitive: u32,
}

impl SpherePrimitive {
    /// `(min, max)` in the world: the extent of an ellipsoid along an axis is the length of the
    /// matrix's row.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let rows = self.object_to_world.matrix3.transpose();
        let half = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length()) * self.radius;
        let center = self.object_to_world.transform_point3(self.center);
        (center - half, center + half)
    }

    /// Unit outward normal at a world point of the surface.
    pub fn normal(&self, point: DVec3) -> DVec3 {
        let n = self.world_to_object.transform_point3(point) - self.center;
        (self.world_to_object.matrix3.transpose() * n).normalize_or_zero()
    }

    /// Both parameters where the line meets the surface, the smaller first.
    pub fn intersect(&self, ray: &OracleRay) -> Option<[f64; 2]> {
        let from = self.world_to_object.transform_point3(ray.origin) - self.center;
        let d = self.world_to_object.transform_vector3(ray.direction);
        let (a, b) = (d.length_squared(), from.dot(d));
        // the discriminant from the perpendicular: no cancellation for far rays (Haines et al., Ray
        // Tracing Gems, ch. 7)
        let discriminant = self.radius * self.radius - (from - d * (b / a)).length_squared();
        if discriminant.is_nan() || discriminant < 0.0 {
            return None;
        }
        let (middle, half) = (-b / a, (discriminant / a).sqrt());
        Some([middle - half, middle + half])
    }
}
