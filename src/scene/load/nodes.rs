//! Collects the nodes of a file, whose instances, cameras and lights are read in their order.

use crate::scene::nodes::SceneNode;
use crate::scene::{NodeTree, Scene};

/// Collects the nodes of a file while its instances, cameras and lights are added to a scene.
#[derive(Debug, Default)]
pub(super) struct NodeTreeBuilder {
    nodes: Vec<SceneNode>,
    /// The nodes that what comes next is below, from the top down.
    open: Vec<usize>,
}

impl NodeTreeBuilder {
    /// Begins a node with so many above it. What is added to the scene from here on is below it,
    /// until a node of this level or one above it begins or ends.
    pub fn begin(&mut self, level: usize, name: &str, scene: &Scene) {
        self.end(level, scene);
        let start = counts(scene);
        let parent = self.open.last().map(|parent| *parent as u32);
        self.open.push(self.nodes.len());
        self.nodes.push(SceneNode { name: name.into(), parent, end: 0, start, stop: start });
    }

    /// Ends the node of this level and those below it, if there is one.
    pub fn end(&mut self, level: usize, scene: &Scene) {
        let end = self.nodes.len() as u32;
        for k in self.open.split_off(level.min(self.open.len())) {
            (self.nodes[k].end, self.nodes[k].stop) = (end, counts(scene));
        }
    }

    /// Adds the nodes of a model below those that are open. Its instances are added to the scene
    /// next, and nothing else of it.
    pub fn append(&mut self, model: &NodeTree, scene: &Scene) {
        let (first, parent) = (self.nodes.len() as u32, self.open.last().map(|parent| *parent as u32));
        let [instances, cameras, lights] = counts(scene);
        self.nodes.extend(model.iter().map(|node| SceneNode {
            name: node.name.clone(),
            parent: node.parent.map(|p| p + first).or(parent),
            end: node.end + first,
            start: [instances + node.start[0], cameras, lights],
            stop: [instances + node.stop[0], cameras, lights],
        }));
    }

    /// Ends all nodes, and leaves out those that say nothing.
    pub fn finish(mut self, scene: &Scene) -> NodeTree {
        self.end(0, scene);

        // from the bottom up: what is listed below each node, and how much of that is nodes
        let mut own: Vec<u32> = self.nodes.iter().map(SceneNode::count).collect();
        for node in &self.nodes {
            node.parent.iter().for_each(|p| own[*p as usize] -= node.count());
        }
        let (mut rows, mut nodes_below) = (own, vec![0u32; self.nodes.len()]);
        let mut keep = vec![false; self.nodes.len()];
        for (k, node) in self.nodes.iter().enumerate().rev() {
            let is_own_item = rows[k] == 1 && nodes_below[k] == 0 && item_name(node, scene) == &*node.name;
            keep[k] = node.count() > 0 && !is_own_item && (rows[k] > 1 || !node.name.is_empty());
            if let Some(parent) = node.parent {
                let (added, nodes) = if keep[k] { (1, 1) } else { (rows[k], nodes_below[k]) };
                rows[parent as usize] += added;
                nodes_below[parent as usize] += nodes;
            }
        }
        let mut tree = NodeTree { nodes: self.nodes };
        tree.retain(&keep);
        tree
    }
}

/// Numbers of instances, cameras and lights of a scene.
fn counts(scene: &Scene) -> [u32; 3] {
    [scene.instances.len(), scene.cameras.len(), scene.lights.len()].map(|count| count as u32)
}

/// Name of the first instance, camera or light of a node.
fn item_name<'a>(node: &SceneNode, scene: &'a Scene) -> &'a str {
    let [instances, cameras, lights] = node.items();
    match (instances.is_empty(), cameras.is_empty(), lights.is_empty()) {
        (false, ..) => &scene.instances[instances.start].name,
        (_, false, _) => &scene.cameras[cameras.start].name,
        (.., false) => &scene.lights[lights.start].name,
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use std::ops::Range;

    use super::*;
    use crate::scene::nodes::{find_instances, merged};
    use crate::scene::{Instance, Light, LightKind};

    /// Adds instances of these names.
    fn add(scene: &mut Scene, names: &[&str]) {
        scene.instances.extend(names.iter().map(|name| Instance {
            name: (*name).to_owned(),
            mesh: 0,
            object_to_world: DAffine3::IDENTITY,
        }));
    }

    /// root: car (wheel, wheel, and an unnamed node of one node: door of two), an empty node, tree.
    fn car() -> (Scene, NodeTree) {
        let (mut scene, mut builder) = (Scene::default(), NodeTreeBuilder::default());
        builder.begin(0, "root", &scene);
        builder.begin(1, "car", &scene);
        for _ in 0..2 {
            builder.begin(2, "wheel", &scene);
            add(&mut scene, &["wheel"]);
        }
        builder.begin(2, "", &scene);
        builder.begin(3, "door", &scene);
        add(&mut scene, &["glass", "door"]);
        builder.begin(1, "nothing", &scene);
        builder.begin(1, "tree", &scene);
        add(&mut scene, &["tree"]);
        let tree = builder.finish(&scene);
        (scene, tree)
    }

    /// Name of a node, index of the node above it, end of what is below it, and its instances.
    type Content<'a> = (&'a str, Option<usize>, usize, Range<usize>);

    fn shown(tree: &NodeTree) -> Vec<Content<'_>> {
        tree.iter().map(|n| (&*n.name, n.parent(), n.end(), n.instances())).collect()
    }

    #[test]
    fn nodes_that_say_nothing_are_left_out() {
        let (_, tree) = car();
        assert_eq!(shown(&tree), [("root", None, 3, 0..5), ("car", Some(0), 3, 0..4), ("door", Some(1), 3, 2..4)]);
        assert_eq!((tree.above(3), tree.above(4), tree.above(9)), (vec![0, 1, 2], vec![0], vec![]));
        assert_eq!(tree.top(5), [1]);

        // a light of another name than its node's
        let (mut scene, mut builder) = (Scene::default(), NodeTreeBuilder::default());
        builder.begin(0, "lamp", &scene);
        scene.lights.push(Light {
            name: "bulb".into(),
            kind: LightKind::Point,
            intensity: glam::Vec3::ONE,
            position: glam::DVec3::ZERO,
            direction: glam::DVec3::Y,
            range: f64::INFINITY,
        });
        let tree = builder.finish(&scene);
        assert_eq!((tree.len(), tree[0].items()), (1, [0..0, 0..0, 0..1]));
    }

    #[test]
    fn instances_are_numbered_anew() {
        let (_, mut tree) = car();
        tree.keep_instances(&[true, false, true, true, false]);
        assert_eq!(shown(&tree), [("root", None, 3, 0..3), ("car", Some(0), 3, 0..3), ("door", Some(1), 3, 1..3)]);
        tree.keep_instances(&[true, false, false]);
        assert_eq!(shown(&tree), [("root", None, 2, 0..1), ("car", Some(0), 2, 0..1)]);
    }

    #[test]
    fn instances_are_found_by_names_and_numbers() {
        let (scene, tree) = car();
        let find = |text: &str| {
            let names = scene.instances.iter().map(|i| i.name.as_str());
            format!("{:?}", find_instances(names, &tree, &[text.to_owned()])[0])
        };
        assert_eq!(["wheel", "car", "tree"].map(find), ["[0..2]", "[0..4]", "[4..5]"]);
        // a node of two, of which one has the same name
        assert_eq!(find("door"), "[2..4]");
        assert_eq!(["3", "1..3", "0..5"].map(find), ["[3..4]", "[1..3]", "[0..5]"]);
        for text in ["", "5", "3..6", "3..3", "4..2", "..", "1..", "-1", "18446744073709551615"] {
            assert_eq!(find(text), "[]", "{text}");
        }
        assert_eq!(merged(vec![5..6, 0..2, 2..3, 1..2]), [0..3, 5..6]);
    }

    #[test]
    fn models_come_below_what_is_open() {
        let (model, nodes) = car();
        let (mut scene, mut builder) = (Scene::default(), NodeTreeBuilder::default());
        add(&mut scene, &["ball"]);
        for _ in 0..2 {
            builder.begin(0, "car.obj", &scene);
            builder.append(&nodes, &scene);
            scene.instances.extend(model.instances.iter().cloned());
        }
        builder.end(0, &scene);
        add(&mut scene, &["ball"]);
        let tree = builder.finish(&scene);
        assert_eq!(shown(&tree)[4..6], [("car.obj", None, 8, 6..11), ("root", Some(4), 8, 6..11)]);
        assert_eq!((tree.len(), tree.top(12)), (8, vec![0, 4]));
    }
}
