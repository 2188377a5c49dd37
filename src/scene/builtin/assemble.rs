//! Adds materials, meshes, instances and cameras to a scene.

use glam::{DAffine3, DVec3, Vec3};

use crate::scene::{Camera, Geometry, Instance, Material, Mesh, Scene};

impl Scene {
    /// Adds a matte material with a linear base colour; returns its index.
    pub(super) fn add_matte(&mut self, name: &str, color: Vec3) -> usize {
        self.add_material(Material { name: name.to_owned(), base_color: color.extend(1.0), ..Material::default() })
    }

    /// Adds a material; returns its index.
    pub(super) fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a mesh without placing it; returns its index.
    pub(super) fn add_mesh(&mut self, name: &str, geometry: Geometry, material: usize) -> usize {
        self.meshes.push(Mesh { name: name.to_owned(), geometry, material, source: None });
        self.meshes.len() - 1
    }

    /// Places a mesh.
    pub(super) fn add_instance(&mut self, name: &str, mesh: usize, object_to_world: DAffine3) {
        self.instances.push(Instance { name: name.to_owned(), mesh, object_to_world });
    }

    /// Adds a mesh and places it once.
    pub(super) fn add_object(&mut self, name: &str, geometry: Geometry, material: usize, object_to_world: DAffine3) {
        let mesh = self.add_mesh(name, geometry, material);
        self.add_instance(name, mesh, object_to_world);
    }

    /// Adds a camera with this vertical field of view.
    pub(super) fn add_camera(&mut self, eye: DVec3, target: DVec3, fov_y_degrees: f64) {
        let mut camera = Camera::look_at(eye, target, DVec3::Y, fov_y_degrees.to_radians());
        camera.name = "main".to_owned();
        self.cameras.push(camera);
    }
}
