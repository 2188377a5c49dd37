//! Construction of the rig: meshes that deform over time become part of it, meshes with a constant
//! pose are posed here.

use std::collections::BTreeMap;

use ::gltf::json::mesh::Primitive;
use glam::{DAffine3, Vec3};

use super::accessor::Reader;
use super::node::{Doubles, PlacedNode, is_hidden};
use super::values::text;
use super::{animation, pointer, skin};
use crate::scene::animation::{
    AnimatedLight, Animation, Deformation, LocalTransform, Node, Property, RigParts, Skin, Target, VertexData,
    from_skin_place, renumbered, skin_place,
};
use crate::scene::{AnimationRig, Scene, TriangleMesh};

/// A glTF mesh with the skin and morph weights of a node. Nodes with the same variant share the
/// scene's meshes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MeshVariant {
    /// Number in the file.
    pub mesh: usize,
    /// Number in the file.
    skin: Option<usize>,
    weights: Weights,
}

impl MeshVariant {
    /// The smallest variant of a mesh in their order.
    pub fn first(mesh: usize) -> Self {
        Self { mesh, skin: None, weights: Weights::None }
    }
}

/// Weights of morph targets.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Weights {
    /// All zero, or no targets.
    None,
    /// Weights that stay the same at all times; the bits of floats, so that they have an order.
    Fixed(Vec<u32>),
    /// Weights of a placed node, which an animation changes.
    Animated(usize),
}

/// The tree and its animations while the scene is read. Nodes are numbered as they are placed,
/// skins as in the file.
pub(super) struct RigBuilder<'a> {
    reader: &'a Reader<'a>,
    doubles: &'a Doubles,
    placed: &'a [PlacedNode],
    /// Index among the placed nodes of each node of the file.
    index: Vec<Option<usize>>,
    nodes: Vec<Node>,
    animations: Vec<Animation>,
    /// Nodes that some animation moves, and nodes whose weights one changes.
    moves: Vec<bool>,
    morphs: Vec<bool>,
    skins: BTreeMap<usize, Skin>,
    /// Skins that deform a mesh: whether an animation moves a joint, and the matrices of the joints
    /// at rest.
    rests: BTreeMap<usize, (bool, Vec<DAffine3>)>,
    deformations: Vec<Deformation>,
    /// The placed node of each instance of the scene; `None` for skinned meshes.
    pub instances: Vec<Option<usize>>,
    /// The placed node of each camera.
    pub cameras: Vec<Option<usize>>,
    /// The placed node of each light.
    pub lights: Vec<Option<usize>>,
    /// For each placed node, whether an animation may hide or show it, itself or by a node above.
    switched: Vec<bool>,
    /// Instances on such nodes, and the node of each.
    pub switched_instances: Vec<(usize, usize)>,
    /// Number in the file of each camera.
    pub camera_numbers: Vec<usize>,
    /// Number in the file of each light.
    pub light_numbers: Vec<usize>,
    /// Materials of the scene that are copies of ones of the file: which, and of which.
    pub material_copies: Vec<(usize, usize)>,
}

impl<'a> RigBuilder<'a> {
    pub fn new(
        reader: &'a Reader,
        doubles: &'a Doubles,
        placed: &'a [PlacedNode],
        warn: &mut dyn FnMut(String),
    ) -> Self {
        let document = reader.document;
        let mut index = vec![None; document.nodes.len()];
        for (at, p) in placed.iter().enumerate() {
            index[p.node] = Some(at);
        }

        // nodes, whose matrices are taken apart where they are animated
        let transformed = animation::transformed(&doubles.animations);
        let mut taken_apart = Vec::new();
        let node = |p: &PlacedNode| {
            // exporters write matrices for nodes that they animate, which the specification forbids
            let is_matrix = matches!(p.local, LocalTransform::Matrix(_));
            let parts = (is_matrix && transformed.contains(&p.node)).then(|| p.local.taken_apart()).flatten();
            if parts.is_some() {
                taken_apart.push(p.node);
            }
            let local = parts.unwrap_or(p.local);
            let node = &document.nodes[p.node];
            let mesh = node.mesh.and_then(|m| document.meshes.get(m.value()));
            let targets =
                |m: &::gltf::json::Mesh| m.primitives.iter().filter_map(|p| Some(p.targets.as_ref()?.len())).max();
            let mut weights = node.weights.clone().or_else(|| mesh?.weights.clone()).unwrap_or_default();
            let count = mesh.and_then(targets).unwrap_or(0);
            // of each node that shows the mesh; an empty list is refused with the scene
            let room = reader.budget.take(16 * count as u64, || format!("a node with {count} morph targets"));
            weights.resize(if room.is_ok() { count } else { 0 }, 0.0);
            weights.iter_mut().filter(|w| !w.is_finite()).for_each(|w| *w = 0.0);
            let hidden = is_hidden(node);
            Node { name: text(&node.name).to_owned(), parent: p.parent, local, weights, hidden }
        };
        let nodes: Vec<Node> = placed.iter().map(node).collect();
        for node in taken_apart {
            warn(format!("node {node} is animated and has a matrix: taken apart into translation, rotation and scale"));
        }

        // animations, and what they change
        let animations = animation::read(reader, &doubles.animations, &nodes, &index, warn);
        let (mut moves, mut morphs) = (vec![false; nodes.len()], vec![false; nodes.len()]);
        for channel in animations.iter().flat_map(|a| &a.channels).filter(|c| !c.is_constant(&nodes[c.node])) {
            let which = if channel.property == Property::Weights { &mut morphs } else { &mut moves };
            which[channel.node] = true;
        }
        let mut switched = vec![false; nodes.len()];
        for node in pointer::switched_nodes(document, animation::pointers(&doubles.animations)) {
            index[node].into_iter().for_each(|at| switched[at] = true);
        }
        for (at, node) in nodes.iter().enumerate() {
            switched[at] |= node.parent.is_some_and(|p| switched[p]);
            moves[at] |= node.parent.is_some_and(|p| moves[p]);
        }

        Self {
            reader,
            doubles,
            placed,
            index,
            nodes,
            animations,
            moves,
            morphs,
            skins: BTreeMap::new(),
            rests: BTreeMap::new(),
            deformations: Vec::new(),
            instances: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            switched,
            switched_instances: Vec::new(),
            camera_numbers: Vec::new(),
            light_numbers: Vec::new(),
            material_copies: Vec::new(),
        }
    }

    /// Whether what placed node `at` carries is in the scene: it is visible, or an animation may
    /// show it.
    pub fn shows(&self, at: usize) -> bool {
        self.placed[at].visible || self.switched[at]
    }

    /// Notes an instance that placed node `at` shows.
    pub fn add_instance(&mut self, at: usize, carrier: Option<usize>) {
        if self.switched[at] {
            self.switched_instances.push((self.instances.len(), at));
        }
        self.instances.push(carrier);
    }

    /// The node that carries a copy of what placed node `at` shows: one of its own below that node
    /// if it moves; none if it never does.
    pub fn carrier_of_copy(&mut self, at: usize, copy: &DAffine3) -> Option<usize> {
        if !self.moves[at] {
            return None;
        }
        let local = LocalTransform::Matrix(*copy);
        self.nodes.push(Node { parent: Some(at), local, ..Node::default() });
        Some(self.nodes.len() - 1)
    }

    /// The variant of mesh `mesh` on placed node `at`.
    ///
    /// # Errors
    /// What is wrong with its skin, in words.
    pub fn wanted(&mut self, at: usize, mesh: usize) -> Result<MeshVariant, String> {
        let skin = self.reader.document.nodes[self.placed[at].node].skin.map(|s| s.value());
        if let Some(s) = skin.filter(|s| !self.skins.contains_key(s)) {
            let all = &self.doubles.skins;
            let found = all.get(s).ok_or_else(|| format!("skin {s} does not exist (the file has {})", all.len()))?;
            let read = skin::read(self.reader, found, &self.index).map_err(|e| format!("skin {s}: {e}"))?;
            self.skins.insert(s, read);
        }
        let weights = match &self.nodes[at].weights {
            _ if self.morphs[at] => Weights::Animated(at),
            weights if weights.iter().all(|w| *w == 0.0) => Weights::None,
            weights => Weights::Fixed(weights.iter().map(|w| w.to_bits()).collect()),
        };
        Ok(MeshVariant { mesh, skin, weights })
    }

    /// How a primitive deforms on placed node `at`, if it does. `triangles`: its vertices, in the
    /// file's order.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn deformation(
        &self,
        wanted: &MeshVariant,
        primitive: &Primitive,
        triangles: &TriangleMesh,
        at: usize,
        warn: &mut dyn FnMut(String),
    ) -> Result<Option<Deformation>, String> {
        let vertices = triangles.positions.len();
        let mut made = Deformation { node: at, ..Deformation::default() };
        if let Some(s) = wanted.skin {
            made.influences = skin::influences(self.reader, primitive, vertices, self.skins[&s].joints.len(), warn)?;
            made.skin = Some(s).filter(|_| !made.influences.is_empty());
            if made.skin.is_none() {
                warn("has no joints and weights, which its node's skin requires: shown undeformed".to_owned());
            }
        }
        if wanted.weights != Weights::None {
            let (normals, count) = (!triangles.normals.is_empty(), self.nodes[at].weights.len());
            made.targets = skin::targets(self.reader, primitive, vertices, normals, count)?;
            if made.targets.iter().all(|t| t.positions.is_empty() && t.normals.is_empty()) {
                made.targets.clear();
            }
        }
        Ok((made.skin.is_some() || !made.targets.is_empty()).then_some(made))
    }

    /// Notes that mesh `mesh` of the scene deforms over time, or poses it here and now if it does
    /// not. Returns where it is to be placed if it has a skin.
    pub fn deform(
        &mut self,
        mut made: Deformation,
        wanted: &MeshVariant,
        mesh: usize,
        triangles: &mut TriangleMesh,
    ) -> Option<DAffine3> {
        let skin = made.skin.map(|s| &self.skins[&s]);
        let first = skin.and_then(|s| s.joints.first().zip(s.inverse_bind.first()));
        let place = first.map(|(&j, bind)| skin_place(&self.placed[j].to_world, bind));
        // once for all meshes of a skin
        let (placed, moves) = (self.placed, &self.moves);
        let rest = made.skin.zip(skin).zip(place).map(|((number, skin), place)| {
            &*self.rests.entry(number).or_insert_with(|| {
                let joint = |(&j, bind): (&usize, &DAffine3)| from_skin_place(&place, &placed[j].to_world) * *bind;
                let joints = skin.joints.iter().zip(&skin.inverse_bind).map(joint).collect();
                (skin.joints.iter().any(|&j| moves[j]), joints)
            })
        });
        let weights: Vec<f64> = self.nodes[made.node].weights.iter().map(|w| f64::from(*w)).collect();
        let animated = matches!(wanted.weights, Weights::Animated(_)) && !made.targets.is_empty();
        if !animated && !made.targets.is_empty() {
            let targets = std::mem::take(&mut made.targets);
            repose(&Deformation { targets, ..Deformation::default() }, &weights, &[], triangles);
        }
        if animated || rest.is_some_and(|(moves, _)| *moves) {
            made.mesh = mesh;
            self.deformations.push(made);
        } else if let Some((_, joints)) = rest {
            repose(&made, &weights, joints, triangles);
        }
        place
    }

    /// Gives the scene its rig, if it has animations.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn finish(mut self, scene: &mut Scene) -> Result<(), String> {
        if self.animations.is_empty() {
            return Ok(());
        }

        // only what carries something, with all above it
        let mut keep = vec![false; self.nodes.len()];
        let joints = self.deformations.iter().filter_map(|d| d.skin).flat_map(|s| &self.skins[&s].joints).copied();
        let carried = self.instances.iter().chain(&self.cameras).chain(&self.lights).flatten().copied();
        let switching = self.switched_instances.iter().map(|(_, at)| *at);
        let carried = carried.chain(switching);
        for at in carried.chain(joints).chain(self.deformations.iter().map(|d| d.node)) {
            keep[at] = true;
        }
        for at in (0..keep.len()).rev() {
            if keep[at]
                && let Some(parent) = self.nodes[at].parent
            {
                keep[parent] = true;
            }
        }

        // nodes that are kept are numbered anew, and so is what refers to them
        let number = renumbered(&keep);
        for node in &mut self.nodes {
            node.parent = node.parent.map(|p| number[p]);
        }
        let mut each = keep.iter();
        self.nodes.retain(|_| each.next().copied().unwrap_or(true));
        for animation in &mut self.animations {
            animation.channels.retain(|c| keep[c.node]);
            animation.channels.iter_mut().for_each(|c| c.node = number[c.node]);
            animation.values.retain(|c| !matches!(c.target, Target::Visibility(at) if !keep[at]));
        }
        let switched_lights: Vec<(usize, usize)> =
            self.lights.iter().enumerate().filter_map(|(i, at)| Some((i, (*at)?))).collect();
        let switched_lights = switched_lights.into_iter().filter(|(_, at)| self.switched[*at]);
        let switched_lights = switched_lights.map(|(i, at)| (i, number[at])).collect();
        let switched_instances = self.switched_instances.iter().map(|(i, at)| (*i, number[*at])).collect();
        let values = self.animated_values(&number);

        let mut skins = Vec::new();
        let mut names = BTreeMap::new();
        for deformation in &mut self.deformations {
            deformation.node = number[deformation.node];
            deformation.skin = deformation.skin.map(|s| {
                *names.entry(s).or_insert_with(|| {
                    let mut skin = self.skins[&s].clone();
                    skin.joints.iter_mut().for_each(|j| *j = number[*j]);
                    skins.push(skin);
                    skins.len() - 1
                })
            });
        }

        let renumber = |carried: Vec<Option<usize>>| carried.into_iter().map(|at| at.map(|at| number[at])).collect();
        let parts = RigParts {
            nodes: self.nodes,
            skins,
            deformations: self.deformations,
            animations: self.animations,
            instances: renumber(self.instances),
            cameras: renumber(self.cameras),
            lights: renumber(self.lights),
            switched_instances,
            switched_lights,
            ..values
        };
        scene.rig = Some(AnimationRig::new(scene, parts)?);
        Ok(())
    }
}

impl RigBuilder<'_> {
    /// The materials, lights and cameras that channels change, which refer to them from then on and
    /// no longer to those of the file. `number`: the new index of each node.
    fn animated_values(&mut self, number: &[usize]) -> RigParts {
        let document = self.reader.document;
        let (mut materials, mut lights, mut cameras) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        let mut parts = RigParts::default();
        let with_number = |numbers: &[usize], k: usize| -> Vec<usize> {
            numbers.iter().enumerate().filter(|(_, n)| **n == k).map(|(i, _)| i).collect()
        };

        // each once, when the first channel names it
        for channel in self.animations.iter_mut().flat_map(|a| &mut a.values) {
            channel.target = match channel.target {
                Target::Visibility(at) => Target::Visibility(number[at]),
                Target::Material(k, property) => {
                    let index = *materials.entry(k).or_insert_with(|| {
                        let copies = self.material_copies.iter().filter(|(_, of)| *of == k).map(|(i, _)| *i);
                        let all = std::iter::once(k).chain(copies).collect();
                        parts.materials.push(pointer::animated_material(&document.materials[k], all));
                        parts.materials.len() - 1
                    });
                    Target::Material(index, property)
                }
                Target::Light(k, property) => {
                    let index = *lights.entry(k).or_insert_with(|| {
                        let file = document.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
                        let light = file.and_then(|l| l.lights.get(k));
                        parts.animated_lights.push(AnimatedLight {
                            lights: with_number(&self.light_numbers, k),
                            color: light.map_or(Vec3::ONE, |l| Vec3::from(l.color)),
                            intensity: light.map_or(1.0, |l| l.intensity),
                        });
                        parts.animated_lights.len() - 1
                    });
                    Target::Light(index, property)
                }
                Target::Camera(k, property) => {
                    let index = *cameras.entry(k).or_insert_with(|| {
                        parts.animated_cameras.push(with_number(&self.camera_numbers, k));
                        parts.animated_cameras.len() - 1
                    });
                    Target::Camera(index, property)
                }
            };
        }
        parts
    }
}

/// Replaces a mesh's vertices by their posed ones.
fn repose(deformation: &Deformation, weights: &[f64], joints: &[DAffine3], mesh: &mut TriangleMesh) {
    let base = VertexData::take(mesh);
    let mut shape = VertexData::default();
    deformation.pose(&base, weights, joints, true, &mut shape);
    shape.give(mesh);
}
