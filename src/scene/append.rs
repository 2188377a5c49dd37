//! Moving a model into a scene.

use super::{Instance, Mesh, Scene};

impl Scene {
    /// Moves a model's meshes, materials and textures into the scene; returns its instances, which
    /// are not placed yet.
    pub fn append(&mut self, model: Scene) -> Vec<Instance> {
        let (meshes, materials, textures) = (self.meshes.len(), self.materials.len(), self.textures.len());
        self.textures.extend(model.textures);
        self.materials.extend(model.materials.into_iter().map(|mut material| {
            for slot in material.texture_slots_mut().into_iter().flatten() {
                slot.texture += textures;
            }
            material
        }));
        self.meshes.extend(model.meshes.into_iter().map(|mesh| Mesh { material: mesh.material + materials, ..mesh }));
        self.report.warnings.extend(model.report.warnings);
        self.report.skipped_images += model.report.skipped_images;
        self.report.files.extend(model.report.files);
        model.instances.into_iter().map(|i| Instance { mesh: i.mesh + meshes, ..i }).collect()
    }
}
