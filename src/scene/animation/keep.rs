//! Updates of a rig while loaders repair its scene: meshes and instances are dropped, vertices
//! reordered, and all is turned where another axis points up.

use glam::{DAffine3, DQuat, DVec3};

use super::{AnimationRig, Deformation, LocalTransform, Node, Target};
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

    /// Turns all that has a node, by a node above all others. The scene shows it from the next
    /// [`AnimationRig::apply_rest_pose`] on.
    pub(in crate::scene) fn turn(&mut self, rotation: DQuat) {
        // parents come before children: the new node is the first, and all indices grow by one
        let parts = &mut self.parts;
        for node in &mut parts.nodes {
            node.parent = Some(node.parent.map_or(0, |p| p + 1));
        }
        let local = LocalTransform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
        parts.nodes.insert(0, Node { name: "up axis".to_owned(), local, ..Node::default() });

        // what names nodes
        let joints = parts.skins.iter_mut().flat_map(|s| &mut s.joints);
        let deformations = parts.deformations.iter_mut().map(|d| &mut d.node);
        let placed = parts.instances.iter_mut().chain(&mut parts.cameras).chain(&mut parts.lights).flatten();
        let switched = parts.switched_instances.iter_mut().chain(&mut parts.switched_lights).map(|(_, node)| node);
        joints.chain(deformations).chain(placed).chain(switched).for_each(|node| *node += 1);
        for animation in &mut parts.animations {
            animation.channels.iter_mut().for_each(|c| c.node += 1);
            for channel in &mut animation.values {
                if let Target::Visibility(node) = &mut channel.target {
                    *node += 1;
                }
            }
        }

        let to_world = DAffine3::from_quat(rotation);
        self.rest.iter_mut().for_each(|rest| *rest = to_world * *rest);
        self.rest.insert(0, to_world);
    }

    /// Whether each instance of `scene` is placed by the rig: by a node, or by a skin.
    pub(in crate::scene) fn placed_instances(&self, scene: &Scene) -> Vec<bool> {
        let mut skinned = vec![false; scene.meshes.len()];
        self.parts.deformations.iter().filter(|d| d.skin.is_some()).for_each(|d| skinned[d.mesh] = true);
        let nodes = self.parts.instances.iter().map(Option::is_some).chain(std::iter::repeat(false));
        scene.instances.iter().zip(nodes).map(|(instance, node)| node || skinned[instance.mesh]).collect()
    }
}
