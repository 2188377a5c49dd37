//! Primitives in one space, with a test in double precision whose answer depends on the primitive
//! and the ray alone: whatever tree leads to them, a ray's closest hit is the same, bit for bit.

use glam::{DAffine3, DVec3, Vec3};

use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene};
use crate::error::{Error, Result};
use crate::ray::Ray;

/// A primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Corners.
    Triangle([Vec3; 3]),
    /// Centre and radius.
    Sphere(Vec3, f32),
}

/// The mesh that a primitive is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Owner {
    /// Index into the scene's instances; `u32::MAX` where the group has several.
    pub instance: u32,
    /// Index into the scene's meshes.
    pub mesh: u32,
    /// Index in the mesh.
    pub primitive: u32,
}

/// Primitives, and whose they are.
#[derive(Clone, Debug, Default)]
pub struct Body {
    /// The primitives.
    pub shapes: Vec<Shape>,
    /// The mesh of each.
    pub owners: Vec<Owner>,
    /// Distance by which boxes are widened when rays are tested: far above the rounding of the
    /// test, far below what would cost visits.
    pub pad: f64,
}

/// A ray in double precision, with what its tests share.
#[derive(Clone, Copy, Debug)]
pub struct LabRay {
    /// Start.
    pub origin: DVec3,
    /// Direction, of any length but 0.
    pub direction: DVec3,
    /// Hits at or before this parameter do not count.
    pub tmin: f64,
    /// Hits at or beyond this parameter do not count.
    pub tmax: f64,
    inverse: DVec3,
    /// The axis along which it is longest, and the two others.
    axes: [usize; 3],
    shear: [f64; 2],
}

impl LabRay {
    /// A ray.
    pub fn new(origin: DVec3, direction: DVec3, tmin: f64, tmax: f64) -> Self {
        let z = direction.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let shear = [direction[x] / direction[z], direction[y] / direction[z]];
        Self { origin, direction, tmin, tmax, inverse: direction.recip(), axes: [x, y, z], shear }
    }

    /// The same ray with other ends.
    pub fn between(&self, tmin: f64, tmax: f64) -> Self {
        Self { tmin, tmax, ..*self }
    }

    /// The point at a parameter.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// The same ray, parameter by parameter, in another space.
    pub fn transformed(&self, by: &DAffine3) -> Self {
        Self::new(by.transform_point3(self.origin), by.transform_vector3(self.direction), self.tmin, self.tmax)
    }

    /// Where it enters a box that is widened by `pad`, if it does so before `until`.
    pub fn enters(&self, min: Vec3, max: Vec3, pad: f64, until: f64) -> Option<f64> {
        let (mut near, mut far) = (self.tmin, until);
        for a in 0..3 {
            let low = (f64::from(min[a]) - pad - self.origin[a]) * self.inverse[a];
            let high = (f64::from(max[a]) + pad - self.origin[a]) * self.inverse[a];
            // 0 times infinity is NaN and the box missed: in the plane of a widened face is nothing
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        (near <= far).then_some(near)
    }
}

impl From<&Ray> for LabRay {
    fn from(r: &Ray) -> Self {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        Self::new(wide(r.origin), wide(r.direction), f64::from(r.tmin), f64::from(r.tmax))
    }
}

impl Shape {
    /// Smallest box around it, rounded outwards for a sphere.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Triangle(corners) => Aabb::of_points(corners),
            Self::Sphere(c, r) => {
                let (lo, hi) = (*c - *r, *c + *r);
                let out = |v: Vec3, f: fn(f32) -> f32| Vec3::new(f(v.x), f(v.y), f(v.z));
                Aabb { min: out(lo, f32::next_down), max: out(hi, f32::next_up) }
            }
        }
    }

    /// Parameter of its first hit between the ray's ends.
    pub fn meet(&self, ray: &LabRay) -> Option<f64> {
        let is_within = |t: &f64| *t > ray.tmin && *t < ray.tmax;
        match self {
            Self::Triangle(corners) => meet_triangle(corners.map(Vec3::as_dvec3), ray).filter(is_within),
            Self::Sphere(c, r) => {
                let from = ray.origin - c.as_dvec3();
                let (a, b) = (ray.direction.length_squared(), from.dot(ray.direction));
                let beside = (from - ray.direction * (b / a)).length_squared();
                let discriminant = f64::from(*r).powi(2) - beside;
                if discriminant < 0.0 {
                    return None;
                }
                let half = (discriminant / a).sqrt();
                [-b / a - half, -b / a + half].into_iter().find(is_within)
            }
        }
    }
}

/// The test of Woop, Benthin and Wald (JCGT 2013): two triangles that share an edge see the same
/// numbers, and no ray slips between them.
fn meet_triangle(corners: [DVec3; 3], ray: &LabRay) -> Option<f64> {
    let [x, y, z] = ray.axes;
    let [a, b, c] = corners.map(|v| {
        let p = v - ray.origin;
        DVec3::new(p[x] - ray.shear[0] * p[z], p[y] - ray.shear[1] * p[z], p[z])
    });
    let (u, v, w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if det == 0.0 || !det.is_finite() {
        return None;
    }
    let point = (a * u + b * v + c * w) / det;
    // a ray within the plane hits where rounding puts it, which may be outside of the box
    let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
    (point.x.abs().max(point.y.abs()) <= 1e-10 * reach).then_some(point.z / ray.direction[z])
}

impl Body {
    /// The primitives of a group, in its space.
    pub fn from_group(flat: &FlatScene, group: &BlasGroup) -> Self {
        let mut body = Self::default();
        for part in &group.submeshes {
            let instance = part.scene_instance.map_or(u32::MAX, |k| k as u32);
            let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
            for k in 0..count {
                body.shapes.push(if group.spheres {
                    let s = flat.sphere(part, k);
                    Shape::Sphere(s.center, s.radius)
                } else {
                    Shape::Triangle(flat.triangle(part, k))
                });
                body.owners.push(Owner { instance, mesh: part.mesh as u32, primitive: k as u32 });
            }
        }
        body.finish()
    }

    /// All primitives of all instances, in world space relative to the origin of `flat`.
    ///
    /// # Errors
    /// [`Error::Scene`] for spheres that an instance makes ellipsoids.
    pub fn from_scene(flat: &FlatScene) -> Result<Self> {
        let mut body = Self::default();
        for instance in &flat.instances {
            let group = Self::from_group(flat, &flat.groups[instance.group]);
            let m = instance.to_world;
            let place = |p: Vec3| m.transform_point3(p.as_dvec3()).as_vec3();
            let lengths = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|a| a.length());
            for (shape, owner) in group.shapes.iter().zip(&group.owners) {
                body.shapes.push(match shape {
                    Shape::Triangle(corners) => Shape::Triangle(corners.map(place)),
                    Shape::Sphere(..) if lengths.iter().any(|l| (l - lengths[0]).abs() > 1e-6 * lengths[0]) => {
                        return Err(Error::Scene(format!(
                            "instance {} stretches spheres, for which influence areas have no test: leave it out",
                            instance.scene_instance.unwrap_or_default()
                        )));
                    }
                    Shape::Sphere(c, r) => Shape::Sphere(place(*c), (f64::from(*r) * lengths[0]) as f32),
                });
                let scene_instance = instance.scene_instance.map_or(owner.instance, |k| k as u32);
                body.owners.push(Owner { instance: scene_instance, ..*owner });
            }
        }
        Ok(body.finish())
    }

    /// Triangles of no scene.
    pub fn from_triangles(triangles: Vec<[Vec3; 3]>) -> Self {
        let owner = |primitive: usize| Owner { instance: 0, mesh: 0, primitive: primitive as u32 };
        let owners = (0..triangles.len()).map(owner).collect();
        Self { shapes: triangles.into_iter().map(Shape::Triangle).collect(), owners, pad: 0.0 }.finish()
    }

    fn finish(mut self) -> Self {
        let reach = self.boxes().iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
        self.pad = f64::from(4.0 * f32::EPSILON * reach).max(1e-30);
        self
    }

    /// The box of each primitive.
    pub fn boxes(&self) -> Vec<Aabb> {
        self.shapes.iter().map(Shape::bounds).collect()
    }
}
