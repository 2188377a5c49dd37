//! Export of the nodes of scenes without animation: groups by name, over what they have. The
//! scene's transforms are those to the world, so groups have none.

use serde_json::{Value, json};

use super::rig::{Tree, push};
use super::{light_place, node, with_mesh};
use crate::scene::Scene;

/// A node of which not everything has been written.
struct Open {
    /// Index of the written node; `None`: that of the scene, which has the roots.
    written: Option<usize>,
    /// The next of its instances, cameras and lights, and the ends of them.
    next: [usize; 3],
    stop: [usize; 3],
    /// Index of the next node of the scene that is not below it.
    end: usize,
}

/// The nodes of a scene without a rig, in an order in which a loader meets instances, cameras and
/// lights in that of the scene.
pub(super) fn tree(scene: &Scene) -> Tree {
    let mut tree = Tree::default();
    let all = [scene.instances.len(), scene.cameras.len(), scene.lights.len()];
    let mut open = Open { written: None, next: [0; 3], stop: all, end: usize::MAX };
    let mut above: Vec<Open> = Vec::new();
    for (k, group) in scene.nodes.iter().enumerate() {
        // nodes end that have everything
        while open.end <= k
            && let Some(parent) = above.pop()
        {
            open = close(scene, &mut tree, open, parent);
        }

        // what the node above it has before it, then the node itself
        let items = group.items();
        let [next, stop] = [items.clone().map(|range| range.start), items.map(|range| range.end)];
        open.write_items(scene, &mut tree, next);
        let written = open.write(&mut tree, json!({ "name": group.name }));
        above.push(std::mem::replace(&mut open, Open { written: Some(written), next, stop, end: group.end() }));
    }
    while let Some(parent) = above.pop() {
        open = close(scene, &mut tree, open, parent);
    }
    open.write_items(scene, &mut tree, all);
    tree
}

/// Writes the rest of a node; its parent goes on behind it.
fn close(scene: &Scene, tree: &mut Tree, mut open: Open, parent: Open) -> Open {
    open.write_items(scene, tree, open.stop);
    Open { next: open.stop, ..parent }
}

impl Open {
    /// Appends a node below it; returns its index.
    fn write(&self, tree: &mut Tree, node: Value) -> usize {
        let index = tree.nodes.len();
        tree.nodes.push(node);
        match self.written {
            Some(parent) => push(&mut tree.nodes[parent], "children", json!(index)),
            None => tree.roots.push(index),
        }
        index
    }

    /// Writes its own instances, cameras and lights up to these.
    fn write_items(&mut self, scene: &Scene, tree: &mut Tree, until: [usize; 3]) {
        let [instances, cameras, lights] = std::array::from_fn(|kind| self.next[kind]..until[kind]);
        for (_, instance) in instances.map(|k| (k, &scene.instances[k])).filter(|(k, _)| !scene.hidden.contains(k)) {
            self.write(tree, with_mesh(&instance.name, instance.mesh, &instance.object_to_world));
        }
        for k in cameras {
            let camera = &scene.cameras[k];
            let mut carrier = node(&camera.name, &camera.camera_to_world);
            carrier["camera"] = json!(k);
            self.write(tree, carrier);
            tree.cameras.insert(k);
        }
        // others are not written
        for k in lights.filter(|k| scene.lights[*k].kind.about().gltf.is_some()) {
            let light = &scene.lights[k];
            let at = self.write(tree, node(&light.name, &light_place(light)));
            tree.lights.insert(k, at);
        }
        self.next = until;
    }
}
