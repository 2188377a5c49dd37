//! Taking what is hidden out of a scene.

use std::collections::BTreeSet;

use super::Scene;

impl Scene {
    /// Takes out all instances that are hidden, and the meshes, materials and textures that nothing
    /// else uses. A scene with animations stays as it is, since they may show an instance and refer
    /// to others by number.
    pub fn take_out_hidden(&mut self) {
        if self.rig.is_some() || self.hidden.is_empty() {
            return;
        }
        let hidden = std::mem::take(&mut self.hidden);
        self.edited = None;
        let is_kept: Vec<bool> = (0..self.instances.len()).map(|k| !hidden.contains(&k)).collect();
        self.nodes.keep_instances(&is_kept);
        retain(&mut self.instances, |k| is_kept[k]);

        // what the others use, each list by the one before
        let meshes: BTreeSet<usize> = self.instances.iter().map(|i| i.mesh).collect();
        let new = retain(&mut self.meshes, |k| meshes.contains(&k));
        self.instances.iter_mut().for_each(|i| i.mesh = new[i.mesh]);
        // a scene has a material, whatever is left
        let first = self.meshes.is_empty().then_some(0);
        let materials: BTreeSet<usize> = self.meshes.iter().map(|m| m.material).chain(first).collect();
        let new = retain(&mut self.materials, |k| materials.contains(&k));
        self.meshes.iter_mut().for_each(|m| m.material = new[m.material]);
        let textures: BTreeSet<usize> = self.materials.iter().flat_map(|m| m.textures()).map(|t| t.texture).collect();
        let new = retain(&mut self.textures, |k| textures.contains(&k));
        for material in &mut self.materials {
            // other variants may be gone
            material.variants = None;
            material.texture_slots_mut().into_iter().flatten().for_each(|slot| slot.texture = new[slot.texture]);
        }
        self.variants.clear();
    }
}

/// Keeps some items of a list; returns the new index of each old one that is kept.
fn retain<T>(items: &mut Vec<T>, is_kept: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut new = Vec::with_capacity(items.len());
    let (mut old, mut kept) = (0, 0);
    items.retain(|_| {
        let keep = is_kept(old);
        new.push(kept);
        (old, kept) = (old + 1, kept + usize::from(keep));
        keep
    });
    new
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SceneSettings;
    use crate::scene::load;

    #[test]
    fn what_is_left_is_as_it_was() {
        let whole = load::load("scenes/courtyard.gltf").unwrap();
        for (name, textures) in [("floor", 1), ("beam left", 0)] {
            let mut scene = whole.clone();
            SceneSettings { only: vec![name.into()], ..Default::default() }.apply(&mut scene).unwrap();
            let shown = scene.shown_instances().next().unwrap().clone();
            scene.take_out_hidden();
            assert!(scene.hidden.is_empty() && scene.instances.len() == 1 && scene.meshes.len() == 1, "{name}");
            let (before, after) = (&whole.meshes[shown.mesh], &scene.meshes[0]);
            assert_eq!(after.geometry.primitive_count(), before.geometry.primitive_count());
            assert_eq!((scene.materials.len(), scene.textures.len()), (1, textures), "{name}");
            assert_eq!(scene.materials[0].name, whole.materials[before.material].name);
        }
        let mut same = whole.clone();
        same.take_out_hidden();
        assert_eq!((same.meshes.len(), same.textures.len()), (whole.meshes.len(), whole.textures.len()));
    }

    #[test]
    fn lists_say_where_items_went() {
        let mut items = vec!['a', 'b', 'c', 'd'];
        let new = retain(&mut items, |k| k % 2 == 1);
        assert_eq!((items, new[1], new[3]), (vec!['b', 'd'], 0, 1));
    }
}
