//! What lies under a pixel.

use super::Interactive;
use crate::error::Result;
use crate::film::NoControl;
use crate::integrators::rays::{self, Mode};
use crate::ray::{Hit, Ray};
use crate::renderer::framing::VisibleSurface;
use crate::scene::{Camera, Geometry, Projection, Scene};
use crate::tracer::Tracer;
use glam::DVec3;

/// A point of the scene that a pixel shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Pick {
    /// Position in the file's world space.
    pub position: DVec3,
    /// Distance from the camera, scene units.
    pub distance: f64,
    /// Index into [`crate::scene::Scene::instances`], and its name.
    pub instance: (usize, String),
    /// Index into [`crate::scene::Scene::meshes`], and its name.
    pub mesh: (usize, String),
    /// Index of the triangle or sphere in its mesh, and how many the mesh has.
    pub primitive: (usize, usize),
    /// Index into [`crate::scene::Scene::materials`], and its name.
    pub material: (usize, String),
    /// Textures of the material: indices into [`crate::scene::Scene::textures`].
    pub textures: Vec<usize>,
}

/// The ray through a point of the image, in world space: `at` from the top left, (0, 0), to the bottom right, (1, 1). `aspect` is width over height. Returns origin
/// and unit direction.
pub fn camera_ray(camera: &Camera, at: [f64; 2], aspect: f64) -> (DVec3, DVec3) {
    let to_world = &camera.camera_to_world;
    let (x, y) = (2.0 * at[0] - 1.0, 1.0 - 2.0 * at[1]);
    let [right, up, back] = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis];
    match camera.projection {
        Projection::Perspective { fov_y } => {
            let half = (0.5 * fov_y).tan();
            let direction = right * (x * half * aspect) + up * (y * half) - back;
            (to_world.translation, direction.normalize_or(-back))
        }
        Projection::Orthographic { half_height } => {
            let origin = to_world.translation + right * (x * half_height * aspect) + up * (y * half_height);
            (origin, -back)
        }
    }
}

/// The closest hits of rays (origins and unit directions in world space); `None` for misses. `origin` is that of the tracer's scene.
///
/// # Errors
/// Those of the device.
pub fn closest_hits(tracer: &Tracer, origin: DVec3, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<Hit>>> {
    let traced = |(from, direction): &(DVec3, DVec3)| Ray {
        origin: (*from - origin).as_vec3().to_array(),
        tmin: 0.0,
        direction: direction.as_vec3().to_array(),
        tmax: f32::INFINITY,
    };
    let traced: Vec<Ray> = rays.iter().map(traced).collect();
    rays::check(&traced)?;
    let (hits, _) = rays::trace(tracer, &traced, Mode::Closest, 1, &mut NoControl)?;
    Ok(hits.into_iter().map(|hit| hit.t.is_finite().then_some(hit)).collect())
}

/// What rays see by their hits.
pub fn visible_surfaces(scene: &Scene, rays: &[(DVec3, DVec3)], hits: Vec<Option<Hit>>) -> Vec<Option<VisibleSurface>> {
    let of = |(hit, (_, direction)): (Option<Hit>, &(DVec3, DVec3))| {
        let hit = hit?;
        let instance = scene.instances.get(hit.instance as usize)?;
        let is_front = match &scene.meshes[instance.mesh].geometry {
            Geometry::Triangles(t) => {
                let corners = t.indices.get(hit.primitive as usize)?.map(|i| t.positions[i as usize].as_dvec3());
                let [a, b, c] = corners.map(|p| instance.object_to_world.transform_point3(p));
                // a mirrored instance turns its triangles over
                (b - a).cross(c - a).dot(*direction) * instance.object_to_world.matrix3.determinant().signum() < 0.0
            }
            Geometry::Spheres(_) => true,
        };
        Some(VisibleSurface { distance: f64::from(hit.t), is_front })
    };
    hits.into_iter().zip(rays).map(of).collect()
}

impl Interactive<'_> {
    /// The point of the scene under a point of the image ([`camera_ray`]); `None` for background, and before the first view.
    ///
    /// # Errors
    /// Those of the device.
    pub fn pick(&self, camera: &Camera, at: [f64; 2], aspect: f64) -> Result<Option<Pick>> {
        let ray = camera_ray(camera, at, aspect);
        Ok(self.closest_hits(&[ray])?.pop().flatten().map(|hit| self.describe(ray.0, ray.0 + ray.1 * f64::from(hit.t), &hit)))
    }

    /// The closest hits of rays (origins and unit directions in world space); `None` for misses, and for all before the first view.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn closest_hits(&self, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<Hit>>> {
        match self.traced.first() {
            Some(world) => closest_hits(&world.tracer, world.flat.origin, rays),
            None => Ok(vec![None; rays.len()]),
        }
    }

    /// What rays see, to choose a camera.
    pub(super) fn visible_surfaces(&self, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<VisibleSurface>>> {
        Ok(visible_surfaces(self.scene, rays, self.closest_hits(rays)?))
    }

    fn describe(&self, eye: DVec3, position: DVec3, hit: &Hit) -> Pick {
        let scene = self.scene;
        let instance = &scene.instances[hit.instance as usize];
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        let primitives = match &mesh.geometry {
            Geometry::Triangles(t) => t.indices.len(),
            Geometry::Spheres(s) => s.len(),
        };
        let mut textures: Vec<usize> = material.textures().map(|slot| slot.texture).collect();
        textures.sort_unstable();
        textures.dedup();
        Pick {
            position,
            distance: (position - eye).length(),
            instance: (hit.instance as usize, instance.name.clone()),
            mesh: (instance.mesh, mesh.name.clone()),
            primitive: (hit.primitive as usize, primitives),
            material: (mesh.material, material.name.clone()),
            textures,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_pass_through_corners_and_centre() {
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 0.0), DVec3::Y, 90f64.to_radians());
        let (origin, direction) = camera_ray(&camera, [0.5, 0.5], 2.0);
        assert!(origin == DVec3::new(1.0, 2.0, 3.0) && (direction - DVec3::NEG_Z).length() < 1e-12);
        let (_, corner) = camera_ray(&camera, [0.0, 0.0], 2.0);
        assert!((corner / -corner.z - DVec3::new(-2.0, 1.0, -1.0)).length() < 1e-12, "{corner}");
        let orthographic = Camera { projection: Projection::Orthographic { half_height: 4.0 }, ..camera };
        let (origin, direction) = camera_ray(&orthographic, [1.0, 1.0], 2.0);
        assert!((origin - DVec3::new(9.0, -2.0, 3.0)).length() < 1e-12 && direction == DVec3::NEG_Z);
    }
}
