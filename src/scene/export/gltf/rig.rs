//! Export of the node hierarchy, skins, morph targets and animations.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::DMat4;
use serde_json::{Value, json};

use super::{Writer, node, with_mesh};
use crate::scene::animation::{
    Animation, Channel, Deformation, Interpolation, LocalTransform, Property, Sampler, Skin,
};
use crate::scene::{AnimationRig, Scene};

/// The node hierarchy that is being written.
#[derive(Default)]
pub(super) struct Tree {
    pub nodes: Vec<Value>,
    /// Nodes without a parent, in an order in which loaders meet the instances in that of the
    /// scene.
    pub roots: Vec<usize>,
    /// For each node of the rig, the written nodes whose meshes have morph targets with its
    /// weights.
    morphing: BTreeMap<usize, Vec<usize>>,
    /// The written nodes of lights.
    pub lights: BTreeMap<usize, usize>,
    /// The cameras that nodes carry.
    pub cameras: BTreeSet<usize>,
}

/// The nodes of all instances, and of the cameras and lights that the rig carries.
pub(super) fn tree(scene: &Scene, rig: &AnimationRig) -> Tree {
    // nodes with their children
    let parts = rig.parts();
    let nodes = parts.nodes.iter().map(|n| local(&n.name, &n.local)).collect();
    let mut tree = Tree { nodes, ..Tree::default() };
    // the first instance in each tree
    let mut first: BTreeMap<usize, usize> = BTreeMap::new();
    let mut above = Vec::with_capacity(parts.nodes.len());
    for (i, node) in parts.nodes.iter().enumerate() {
        match node.parent {
            Some(p) => push(&mut tree.nodes[p], "children", json!(i)),
            None => drop(first.insert(i, usize::MAX)),
        }
        above.push(node.parent.map_or(i, |p| above[p]));
    }

    // meshes go to the nodes that carry them, or to nodes of their own
    let deforming: BTreeMap<usize, &Deformation> = parts.deformations.iter().map(|d| (d.mesh, d)).collect();
    let left_out = scene.left_out();
    for (i, instance) in scene.instances.iter().enumerate().filter(|(i, _)| !left_out.contains(i)) {
        let deformation = deforming.get(&instance.mesh);
        let skinned = deformation.filter(|d| d.skin.is_some());
        let Some(on) = skinned.map(|d| d.node).or_else(|| parts.instances.get(i).copied().flatten()) else {
            first.insert(tree.nodes.len(), i);
            tree.nodes.push(with_mesh(&instance.name, instance.mesh, &instance.object_to_world));
            continue;
        };
        let at = tree.carrier(on, &instance.name, "mesh");
        tree.nodes[at]["mesh"] = json!(instance.mesh);
        if let Some(skin) = skinned.and_then(|d| d.skin) {
            tree.nodes[at]["skin"] = json!(skin);
        }
        if deformation.is_some_and(|d| !d.targets.is_empty()) {
            tree.nodes[at]["weights"] = json!(parts.nodes[on].weights);
            tree.morphing.entry(on).or_default().push(at);
        }
        let least = first.entry(above[on]).or_insert(i);
        *least = i.min(*least);
    }

    // trees in the order of their first instances, so that a reader finds them as they were
    tree.roots = first.keys().copied().collect();
    tree.roots.sort_by_key(|r| first[r]);

    // cameras and lights
    for (c, camera) in scene.cameras.iter().enumerate() {
        if let Some(on) = carries_camera(rig, c) {
            let at = tree.carrier(on, &camera.name, "camera");
            tree.nodes[at]["camera"] = json!(c);
            tree.cameras.insert(c);
        }
    }
    for (l, light) in scene.lights.iter().enumerate() {
        // others are not written
        let carried = parts.lights.get(l).copied().flatten().filter(|_| light.kind.about().gltf.is_some());
        if let Some(on) = carried {
            let at = tree.carrier(on, &light.name, "extensions");
            // taken, until the light is written
            tree.nodes[at]["extensions"] = json!({});
            tree.lights.insert(l, at);
        }
    }
    tree
}

/// The node of the rig that carries a camera.
fn carries_camera(rig: &AnimationRig, camera: usize) -> Option<usize> {
    rig.parts().cameras.get(camera).copied().flatten()
}

impl Tree {
    /// The node for a mesh, camera or light: `on` itself if it has the same name and is free, else
    /// a new child of it.
    fn carrier(&mut self, on: usize, name: &str, what: &str) -> usize {
        let there = &self.nodes[on];
        if there.get(what).is_none() && there["name"] == name {
            return on;
        }
        let child = self.nodes.len();
        self.nodes.push(json!({ "name": name }));
        push(&mut self.nodes[on], "children", json!(child));
        child
    }
}

impl Writer {
    /// Adds what deforms a mesh to its primitive.
    pub(super) fn deformation(&mut self, deformation: &Deformation, vertices: usize, primitive: &mut Value) {
        for (set, influences) in deformation.influences.iter().enumerate() {
            let small = influences.joints.iter().flatten().all(|&j| j < 256);
            let joints = influences.joints.iter().flatten();
            let bytes: Vec<u8> =
                if small { joints.map(|&j| j as u8).collect() } else { joints.flat_map(|j| j.to_le_bytes()).collect() };
            let view = self.view(&bytes, Some(34962));
            let component = if small { 5121 } else { 5123 };
            self.accessors
                .push(json!({ "bufferView": view, "componentType": component, "count": vertices, "type": "VEC4" }));
            primitive["attributes"][format!("JOINTS_{set}")] = json!(self.accessors.len() - 1);
            let weights = self.floats(influences.weights.iter().copied(), false);
            primitive["attributes"][format!("WEIGHTS_{set}")] = json!(weights);
        }
        for target in &deformation.targets {
            let mut attributes = json!({});
            if !target.positions.is_empty() {
                attributes["POSITION"] = json!(self.floats(target.positions.iter().map(|p| p.to_array()), true));
            }
            if !target.normals.is_empty() {
                attributes["NORMAL"] = json!(self.floats(target.normals.iter().map(|n| n.to_array()), false));
            }
            if target.positions.is_empty() && target.normals.is_empty() {
                // without data it is zero; a target must have something
                let zero = [0.0; 3];
                let accessor =
                    json!({ "componentType": 5126, "count": vertices, "type": "VEC3", "min": zero, "max": zero });
                self.accessors.push(accessor);
                attributes["POSITION"] = json!(self.accessors.len() - 1);
            }
            push(primitive, "targets", attributes);
        }
    }

    pub(super) fn skin(&mut self, skin: &Skin) -> Value {
        let matrices = skin.inverse_bind.iter().map(|m| DMat4::from(*m).as_mat4().to_cols_array());
        let matrices = self.numbers(matrices, false, None);
        let mut out = json!({ "joints": skin.joints, "inverseBindMatrices": matrices });
        if !skin.name.is_empty() {
            out["name"] = json!(skin.name);
        }
        out
    }

    pub(super) fn animation(&mut self, animation: &Animation, rig: &AnimationRig, tree: &Tree) -> Value {
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        let mut times: Vec<(Arc<[f32]>, usize)> = Vec::new();
        let mut end = f64::NEG_INFINITY;
        let hold = hold(animation, rig);
        // its last key may belong to a channel of which nothing is left
        for channel in animation.channels.iter().chain(&hold) {
            let only = [channel.node];
            let (path, on) = match channel.property {
                Property::Translation => ("translation", &only[..]),
                Property::Rotation => ("rotation", &only[..]),
                Property::Scale => ("scale", &only[..]),
                Property::Weights => ("weights", tree.morphing.get(&channel.node).map_or(&[][..], |v| v)),
            };
            let extra = hold.as_ref().is_some_and(|h| std::ptr::eq(h, channel));
            if on.is_empty() || (extra && end == animation.duration) {
                continue;
            }
            end = end.max(channel.sampler.end());
            for node in on {
                channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
            }
            let sampler = self.sampler(channel, &mut times);
            samplers.push(sampler);
        }
        let mut out = json!({ "samplers": samplers, "channels": channels });
        if !animation.name.is_empty() {
            out["name"] = json!(animation.name);
        }
        out
    }

    fn sampler(&mut self, channel: &Channel, times: &mut Vec<(Arc<[f32]>, usize)>) -> Value {
        let sampler = &channel.sampler;
        let input = match times.iter().find(|(t, _)| Arc::ptr_eq(t, &sampler.times)) {
            Some((_, known)) => *known,
            None => {
                let accessor = self.numbers(sampler.times.iter().map(|&t| [t]), true, None);
                times.push((sampler.times.clone(), accessor));
                accessor
            }
        };
        let values = &sampler.values;
        let output = match channel.property {
            Property::Translation | Property::Scale => {
                self.numbers(values.as_chunks::<3>().0.iter().copied(), false, None)
            }
            Property::Rotation => self.numbers(values.as_chunks::<4>().0.iter().copied(), false, None),
            Property::Weights => self.numbers(values.iter().map(|&w| [w]), false, None),
        };
        let interpolation = match sampler.interpolation {
            Interpolation::Step => "STEP",
            Interpolation::Linear => "LINEAR",
            Interpolation::CubicSpline => "CUBICSPLINE",
        };
        json!({ "input": input, "output": output, "interpolation": interpolation })
    }
}

/// A channel without effect that lasts as long as the animation, so that the duration survives.
fn hold(animation: &Animation, rig: &AnimationRig) -> Option<Channel> {
    let taken = |node| animation.channels.iter().any(|c| (c.node, c.property) == (node, Property::Translation));
    rig.parts().nodes.iter().enumerate().filter(|(i, _)| !taken(*i)).find_map(|(node, n)| match n.local {
        LocalTransform::Matrix(_) => None,
        LocalTransform::Trs { translation, .. } => {
            let (times, values) = ([animation.duration as f32].into(), translation.as_vec3().to_array().to_vec());
            let sampler = Sampler { interpolation: Interpolation::Step, times, values };
            Some(Channel { node, property: Property::Translation, sampler })
        }
    })
}

fn local(name: &str, local: &LocalTransform) -> Value {
    match local {
        LocalTransform::Matrix(m) => node(name, m),
        LocalTransform::Trs { translation, rotation, scale } => {
            let mut out = json!({ "name": name });
            if *translation != glam::DVec3::ZERO {
                out["translation"] = json!(translation.to_array());
            }
            if *rotation != glam::DQuat::IDENTITY {
                out["rotation"] = json!(rotation.to_array());
            }
            if *scale != glam::DVec3::ONE {
                out["scale"] = json!(scale.to_array());
            }
            out
        }
    }
}

/// Appends to an array that is made when needed: empty ones are not allowed.
pub(super) fn push(object: &mut Value, key: &str, value: Value) {
    match object.get_mut(key).and_then(Value::as_array_mut) {
        Some(array) => array.push(value),
        None => object[key] = json!([value]),
    }
}
