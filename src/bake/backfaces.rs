//! Points inside of other geometry: most of what their rays hit shows its back.

use glam::DVec3;

use super::frames::SurfacePoint;
use crate::error::Result;
use crate::film::Control;
use crate::integrators::rays::{Mode, PreparedRays};
use crate::ray::Ray;
use crate::sampling::{sobol_2d, to_unit, warp};
use crate::scene::{Geometry, Scene};
use crate::tracer::Tracer;

/// Rays from each point.
const RAYS: u32 = 8;
/// Distance from the surface at which they start, as a share of the scene's diagonal.
const OFFSET: f64 = 1e-5;

/// For each point whether it is inside of other geometry. `origin`: that of the tracer's scene.
///
/// # Errors
/// Those of the device, and of `control`.
pub fn are_inside(
    scene: &Scene,
    tracer: &Tracer,
    origin: DVec3,
    points: &[SurfacePoint],
    control: &mut dyn Control,
) -> Result<Vec<bool>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let offset = OFFSET * scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).length());
    let mut rays = Vec::with_capacity(points.len() * RAYS as usize);
    for point in points {
        let start = (point.world + offset * point.geometric - origin).as_vec3().to_array();
        for k in 0..RAYS {
            let [x, y, z] = warp::cosine_hemisphere(sobol_2d(k).map(to_unit)).map(f64::from);
            let (s, t) = point.geometric.any_orthonormal_pair();
            let direction = (x * s + y * t + z * point.geometric).as_vec3().to_array();
            rays.push(Ray { origin: start, tmin: 0.0, direction, tmax: f32::INFINITY });
        }
    }
    let mut set = PreparedRays::new(tracer, &rays, Mode::Closest)?;
    set.pass(control)?;
    let hits = set.hits()?;

    let shows_back = |ray: &Ray, instance: u32, primitive: u32| {
        let instance = &scene.instances[instance as usize];
        let Geometry::Triangles(t) = &scene.meshes[instance.mesh].geometry else { return false };
        let [a, b, c] = t.indices[primitive as usize].map(|v| t.positions[v as usize].as_dvec3());
        let normal = instance.object_to_world.matrix3.inverse().transpose() * (b - a).cross(c - a);
        DVec3::from(ray.direction.map(f64::from)).dot(normal) > 0.0
    };
    let is_inside = |(rays, hits): (&[Ray], &[crate::ray::Hit])| {
        let pairs = rays.iter().zip(hits).filter(|(_, hit)| hit.is_hit());
        let backs = pairs.filter(|(ray, hit)| shows_back(ray, hit.instance, hit.primitive)).count();
        2 * backs > RAYS as usize
    };
    Ok(rays.chunks_exact(RAYS as usize).zip(hits.chunks_exact(RAYS as usize)).map(is_inside).collect())
}
