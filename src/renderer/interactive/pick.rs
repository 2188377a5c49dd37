//! Picking: the surface under a pixel.

use super::Interactive;
use crate::error::Result;
use crate::film::NoControl;
use crate::integrators::rays::{self, Mode};
use crate::ray::{Hit, Ray};
use crate::renderer::survey::VisibleSurface;
use crate::renderer::survey::rays::{camera_ray, clipped, visible_surfaces};
use crate::scene::{Camera, Geometry};
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

/// The closest hits of rays (origins and unit directions in world space); `None` for misses.
/// `origin` is that of the tracer's scene.
///
/// # Errors
/// Those of the device.
pub fn closest_hits(tracer: &Tracer, origin: DVec3, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<Hit>>> {
    let traced = rays.iter().map(|(from, direction)| Ray::new(*from - origin, *direction, [0.0, f64::INFINITY]));
    let traced: Vec<Ray> = traced.collect();
    rays::check(&traced)?;
    let (hits, _) = rays::trace(tracer, &traced, Mode::Closest, 1, &mut NoControl)?;
    Ok(hits.into_iter().map(|hit| hit.t.is_finite().then_some(hit)).collect())
}

impl Interactive<'_> {
    /// The point of the scene under a point of the image ([`camera_ray`]); `None` for background,
    /// and before the first view.
    ///
    /// # Errors
    /// Those of the device.
    pub fn pick(&self, camera: &Camera, at: [f64; 2], aspect: f64) -> Result<Option<Pick>> {
        let ray = camera_ray(camera, at, aspect);
        let hit = self.closest_hits(&[ray])?.pop().flatten();
        let [near, far] = clipped(camera, ray.1);
        let hit = hit.filter(|hit| near + f64::from(hit.t) < far);
        Ok(hit.map(|hit| self.describe(near + f64::from(hit.t), ray.0 + ray.1 * f64::from(hit.t), &hit)))
    }

    /// The instances under points of the image ([`camera_ray`]), indices into
    /// [`crate::scene::Scene::instances`]; `None` for background, and before the first view.
    ///
    /// # Errors
    /// Those of the device.
    pub fn objects_at(&self, camera: &Camera, points: &[[f64; 2]], aspect: f64) -> Result<Vec<Option<usize>>> {
        let rays: Vec<_> = points.iter().map(|at| camera_ray(camera, *at, aspect)).collect();
        let hits = self.closest_hits(&rays)?.into_iter().zip(&rays);
        let is_near = |hit: &Hit, direction: DVec3| {
            let [near, far] = clipped(camera, direction);
            near + f64::from(hit.t) < far
        };
        Ok(hits.map(|(hit, ray)| Some(hit.filter(|hit| is_near(hit, ray.1))?.instance as usize)).collect())
    }

    /// The closest hits of rays as of [`closest_hits`]; all miss before the first view.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn closest_hits(&self, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<Hit>>> {
        match self.traced.first() {
            Some(traced) => closest_hits(&traced.tracer, traced.flat.origin, rays),
            None => Ok(vec![None; rays.len()]),
        }
    }

    /// The surfaces that rays hit (origins and unit directions in world space), none before a view.
    ///
    /// # Errors
    /// Those of the device.
    pub fn visible_surfaces(&self, rays: &[(DVec3, DVec3)]) -> Result<Vec<Option<VisibleSurface>>> {
        Ok(visible_surfaces(self.scene, rays, self.closest_hits(rays)?))
    }

    fn describe(&self, distance: f64, position: DVec3, hit: &Hit) -> Pick {
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
            distance,
            instance: (hit.instance as usize, instance.name.clone()),
            mesh: (instance.mesh, mesh.name.clone()),
            primitive: (hit.primitive as usize, primitives),
            material: (mesh.material, material.name.clone()),
            textures,
        }
    }
}
