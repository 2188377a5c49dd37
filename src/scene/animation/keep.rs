//! Updates of a rig while loaders repair its scene: meshes and instances are dropped, vertices
//! reordered.

use super::{AnimationRig, Deformation};
use crate::scene::Scene;

impl AnimationRig {
    /// The deformation of each mesh, for a scene of `meshes` meshes; `None` for those that do not
    /// deform.
    pub(in crate::scene) fn deformations_mut(&mut self, meshes: usize) -> Vec<Option<&mut Deformation>> {
        let mut all: Vec<Option<&mut Deformation>> = (0..meshes).map(|_| None).collect();
        for deformation in &mut self.parts.deformations {
            let mesh = deformation.mesh;
            all[mesh] = Some(deformation);
        }
        all
    }

    /// For each instance of `scene`, whether an animation moves it.
    pub(in crate::scene) fn moving(&self, scene: &Scene) -> Vec<bool> {
        self.moving_instances(scene.instances.len())
    }

    /// For each mesh of `scene`, whether an animation deforms it.
    pub(in crate::scene) fn deforming(&self, scene: &Scene) -> Vec<bool> {
        let mut deforming = vec![false; scene.meshes.len()];
        for deformation in &self.parts.deformations {
            deforming[deformation.mesh] = true;
        }
        deforming
    }

    /// Detaches an instance from its node.
    pub(in crate::scene) fn release(&mut self, instance: usize) {
        self.parts.instances[instance] = None;
    }

    /// Removes instances that are not kept.
    pub(in crate::scene) fn keep_instances(&mut self, keep: &[bool]) {
        let mut each = keep.iter();
        self.parts.instances.retain(|_| each.next().copied().unwrap_or(true));
        let number = super::renumbered(keep);
        self.parts.switched_instances.retain(|(i, _)| keep[*i]);
        self.parts.switched_instances.iter_mut().for_each(|(i, _)| *i = number[*i]);
        let mut each = keep.iter();
        self.floors.retain(|_| each.next().copied().unwrap_or(true));
    }

    /// Removes meshes that are not kept; `index` has the new index of each old one.
    pub(in crate::scene) fn keep_meshes(&mut self, keep: &[bool], index: &[usize]) {
        let mut each = self.parts.deformations.iter().map(|d| keep[d.mesh]).collect::<Vec<_>>().into_iter();
        if !self.shapes.is_empty() {
            let mut each = each.clone();
            self.shapes.retain(|_| each.next().unwrap_or(true));
        }
        self.parts.deformations.retain(|_| each.next().unwrap_or(true));
        for deformation in &mut self.parts.deformations {
            deformation.mesh = index[deformation.mesh];
        }
    }
}
