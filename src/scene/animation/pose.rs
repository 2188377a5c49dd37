//! Playback: what an animation changes, and the pose at a time.

use std::collections::{BTreeMap, HashMap};

use glam::DAffine3;

use super::transform::{at_least, from_skin_place, skin_place};
use super::{
    Animation, AnimationRig, Channel, Deformation, LightProperty, LocalTransform, MaterialProperty, Property, Target,
    VertexData,
};
use crate::error::{Error, Result};
use crate::scene::camera::rigid;
use crate::scene::{Camera, ClipPlanes, Geometry, Light, Material, Motion, Projection, Scene};

/// Behaviour after the end of an animation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Playback {
    /// It repeats.
    #[default]
    Loop,
    /// It holds its last pose, and its first pose before the beginning.
    Once,
}

impl Playback {
    /// Maps seconds since the start of playback to seconds in the animation. A time that is not
    /// finite maps to its beginning.
    pub fn time(self, seconds: f64, duration: f64) -> f64 {
        match self {
            _ if !seconds.is_finite() || duration <= 0.0 => 0.0,
            Self::Loop => seconds.rem_euclid(duration),
            Self::Once => seconds.clamp(0.0, duration),
        }
    }
}

/// A deformed mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedMesh {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Vertices of the mesh. Normals are empty where the mesh has none; tangents always.
    pub shape: VertexData,
}

/// The state at one time of everything that an animation changes. Its buffers are reused when it is
/// filled again.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Moving instances (indices into [`Scene::instances`]) and their object-to-world transforms,
    /// all of which can be inverted.
    pub instances: Vec<(usize, DAffine3)>,
    /// Meshes that deform.
    pub meshes: Vec<PosedMesh>,
    /// Moving cameras (indices into [`Scene::cameras`]) and their camera-to-world transforms,
    /// without scale.
    pub cameras: Vec<(usize, DAffine3)>,
    /// Moving lights (indices into [`Scene::lights`]) and the transforms of their nodes to world
    /// space, without scale.
    pub lights: Vec<(usize, DAffine3)>,
    /// Materials that change (indices into [`Scene::materials`]).
    pub materials: Vec<(usize, Material)>,
    /// Lights whose colour, intensity, range or angles change (indices into [`Scene::lights`]); a
    /// hidden one is black. Where they are does not count.
    pub light_values: Vec<(usize, Light)>,
    /// Cameras whose projection or clipping planes change (indices into [`Scene::cameras`]).
    pub lenses: Vec<(usize, Projection, ClipPlanes)>,
    /// Instances that may be hidden (indices into [`Scene::instances`]), and whether they are.
    pub hidden: Vec<(usize, bool)>,
    scratch: Scratch,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    live: Vec<bool>,
    locals: Vec<LocalTransform>,
    world: Vec<DAffine3>,
    /// Joint matrices of each skin; none of one that nothing deforms by.
    joints: Vec<Vec<DAffine3>>,
    weights: Vec<f64>,
}

/// Joints and morph weights that deform meshes in an animation.
struct Deforming<'a> {
    /// Whether a joint of each skin moves.
    skins: Vec<bool>,
    /// Channels of the nodes whose morph weights the animation has, and whether each changes them.
    weights: HashMap<usize, (&'a Channel, bool)>,
}

impl Deforming<'_> {
    fn deforms(&self, deformation: &Deformation) -> bool {
        let morphs = || self.weights.get(&deformation.node).is_some_and(|(_, changes)| *changes);
        deformation.skin.is_some_and(|s| self.skins[s]) || (!deformation.targets.is_empty() && morphs())
    }
}

impl Pose {
    /// Gives a camera, which is this one of the scene, its projection and clipping planes.
    pub fn set_lens(&self, index: Option<usize>, camera: &mut Camera) {
        if let Some((_, projection, clip)) = self.lenses.iter().find(|(k, ..)| Some(*k) == index) {
            (camera.projection, camera.clip) = (*projection, *clip);
        }
    }

    /// Applies the pose to the scene for which it was computed.
    pub fn apply(&self, scene: &mut Scene) {
        for &(i, to_world) in &self.instances {
            if let Some(instance) = scene.instances.get_mut(i) {
                instance.object_to_world = to_world;
            }
        }
        for posed in &self.meshes {
            if let Some(Geometry::Triangles(t)) = scene.meshes.get_mut(posed.mesh).map(|m| &mut m.geometry) {
                t.positions.clone_from(&posed.shape.positions);
                t.normals.clone_from(&posed.shape.normals);
            }
        }
        for &(i, to_world) in &self.cameras {
            if let Some(camera) = scene.cameras.get_mut(i) {
                camera.camera_to_world = to_world;
            }
        }
        for &(i, to_world) in &self.lights {
            if let Some(light) = scene.lights.get_mut(i) {
                light.place(&to_world);
            }
        }

        // what is no transform
        for (i, material) in &self.materials {
            if let Some(place) = scene.materials.get_mut(*i) {
                place.clone_from(material);
            }
        }
        for (i, values) in &self.light_values {
            if let Some(light) = scene.lights.get_mut(*i) {
                (light.kind, light.intensity, light.range) = (values.kind, values.intensity, values.range);
            }
        }
        for &(i, projection, clip) in &self.lenses {
            if let Some(camera) = scene.cameras.get_mut(i) {
                (camera.projection, camera.clip) = (projection, clip);
            }
        }
        for &(i, hidden) in &self.hidden {
            if hidden {
                scene.hidden.insert(i);
            } else {
                scene.hidden.remove(&i);
            }
        }
    }
}

impl AnimationRig {
    /// The instances that an animation moves and the meshes that it deforms. Channels that keep a
    /// node at rest do not count, nor do cameras, which tracers do not hold.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such animation.
    pub fn motion(&self, animation: usize) -> Result<Motion> {
        let mut live = Vec::new();
        self.live(animation, &mut live)?;
        let deformations = &self.parts.deformations;
        let deforming = self.find_deforming(animation, &live);
        let deform = |d: &&Deformation| deforming.deforms(d);
        let mut instances: Vec<usize> = self.moved(&self.parts.instances, &live).map(|(i, _)| i).collect();
        let switched = self.switched(animation);
        for &(i, node) in &self.parts.switched_instances {
            if switched[node] && !instances.contains(&i) {
                instances.push(i);
            }
        }
        Ok(Motion {
            instances,
            meshes: deformations.iter().filter(deform).map(|d| d.mesh).collect(),
            materials: self.extreme_materials(animation),
            lights: self.changing_lights(animation),
        })
    }

    /// The materials that an animation changes, each with others that between them need all that it
    /// ever needs.
    fn extreme_materials(&self, animation: usize) -> BTreeMap<usize, Vec<Material>> {
        let mut ranges: BTreeMap<usize, Vec<_>> = BTreeMap::new();
        for channel in &self.parts.animations[animation].values {
            if let Target::Material(k, property) = channel.target {
                ranges.entry(k).or_default().push((property, channel.range()));
            }
        }
        let mut all: BTreeMap<usize, Vec<Material>> = BTreeMap::new();
        for (k, ranges) in ranges {
            let animated = &self.parts.materials[k];
            for i in &animated.materials {
                if let Some(rest) = self.rest_materials.get(i) {
                    all.insert(*i, animated.extremes(rest, &ranges).into());
                }
            }
        }
        for (i, variants) in &self.varied {
            if let Some(same) = all.get(&variants.material(self.variant)).cloned() {
                all.insert(*i, same);
            }
        }
        all
    }

    /// The lights that an animation changes beside moving them.
    fn changing_lights(&self, animation: usize) -> Vec<usize> {
        let switched = self.switched(animation);
        let mut all: Vec<usize> =
            self.parts.switched_lights.iter().filter(|(_, node)| switched[*node]).map(|(i, _)| *i).collect();
        for channel in &self.parts.animations[animation].values {
            if let Target::Light(k, _) = channel.target {
                all.extend(&self.parts.animated_lights[k].lights);
            }
        }
        all.sort_unstable();
        all.dedup();
        all
    }

    /// For each node, whether an animation hides and shows it, directly or through a parent.
    fn switched(&self, animation: usize) -> Vec<bool> {
        let mut switched = vec![false; self.parts.nodes.len()];
        for channel in self.parts.animations.get(animation).iter().flat_map(|a| &a.values) {
            if let Target::Visibility(node) = channel.target {
                switched[node] = true;
            }
        }
        self.spread(&mut switched);
        switched
    }

    /// For each node, whether it is hidden at a time of an animation, or at rest.
    fn hidden(&self, playing: Option<(&Animation, f64)>) -> Vec<bool> {
        let mut hidden: Vec<bool> = self.parts.nodes.iter().map(|n| n.hidden).collect();
        for (channel, seconds) in playing.iter().flat_map(|(a, t)| a.values.iter().map(|c| (c, *t))) {
            if let Target::Visibility(node) = channel.target {
                hidden[node] = channel.value(seconds)[0] < 0.5;
            }
        }
        self.spread(&mut hidden);
        hidden
    }

    /// Computes what changes beside transforms and vertices.
    fn pose_values(&self, playing: &Animation, seconds: f64, pose: &mut Pose) {
        let mut materials: BTreeMap<usize, Vec<(MaterialProperty, [f32; 4])>> = BTreeMap::new();
        let mut lights: BTreeMap<usize, Vec<(LightProperty, [f32; 4])>> = BTreeMap::new();
        let mut cameras = BTreeMap::new();
        let mut has_switches = false;
        for channel in &playing.values {
            let value = channel.value(seconds);
            match channel.target {
                Target::Material(k, property) => materials.entry(k).or_default().push((property, value)),
                Target::Light(k, property) => lights.entry(k).or_default().push((property, value)),
                Target::Visibility(_) => has_switches = true,
                Target::Camera(k, property) => {
                    for i in &self.parts.animated_cameras[k] {
                        let Some(rest) = self.rest_cameras.get(*i) else { continue };
                        property.set(cameras.entry(*i).or_insert_with(|| rest.clone()), f64::from(value[0]));
                    }
                }
            }
        }

        // materials, and those that are one of them in the variant of the scene
        for (k, values) in materials {
            let animated = &self.parts.materials[k];
            let rest = animated.materials.iter().filter_map(|i| Some((*i, self.rest_materials.get(i)?)));
            pose.materials.extend(rest.map(|(i, rest)| (i, animated.changed(rest, &values))));
        }
        for (i, variants) in &self.varied {
            let source = variants.material(self.variant);
            if let Some((_, material)) = pose.materials.iter().find(|(k, _)| *k == source) {
                let copy = Material { variants: Some(variants.clone()), ..material.clone() };
                pose.materials.push((*i, copy));
            }
        }

        // lights, black where they are hidden
        let is_hidden = self.hidden(Some((playing, seconds)));
        let mut changed: BTreeMap<usize, Light> = BTreeMap::new();
        for (k, values) in lights {
            let animated = &self.parts.animated_lights[k];
            let rest = animated.lights.iter().filter_map(|i| Some((*i, self.rest_lights.get(*i)?)));
            changed.extend(rest.map(|(i, rest)| (i, animated.changed(rest, &values))));
        }
        for &(i, node) in &self.parts.switched_lights {
            if (has_switches || changed.contains_key(&i))
                && let Some(rest) = self.rest_lights.get(i)
            {
                let light = changed.entry(i).or_insert_with(|| rest.clone());
                if is_hidden[node] {
                    light.intensity = glam::Vec3::ZERO;
                }
            }
        }
        pose.light_values.extend(changed);

        // cameras and instances
        pose.lenses.extend(cameras.into_iter().map(|(i, camera)| (i, camera.projection, camera.clip)));
        if has_switches {
            pose.hidden.extend(self.parts.switched_instances.iter().map(|&(i, node)| (i, is_hidden[node])));
        }
    }

    /// Returns true if an animation changes lights or materials that emit, or hides what may emit.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such animation.
    pub fn changes_light(&self, animation: usize) -> Result<bool> {
        let playing = self.live(animation, &mut Vec::new())?;
        Ok(playing.values.iter().any(|channel| {
            matches!(
                channel.target,
                Target::Light(..)
                    | Target::Visibility(_)
                    | Target::Material(_, MaterialProperty::EmissiveFactor | MaterialProperty::EmissiveStrength)
            )
        }))
    }

    /// The cameras that an animation moves, as indices into [`Scene::cameras`].
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such animation.
    pub fn moving_cameras(&self, animation: usize) -> Result<Vec<usize>> {
        let mut live = Vec::new();
        self.live(animation, &mut live)?;
        Ok(self.moved(&self.parts.cameras, &live).map(|(i, _)| i).collect())
    }

    /// The lights that an animation moves and no surface emits, as indices into [`Scene::lights`].
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such animation.
    pub fn moving_lights(&self, animation: usize) -> Result<Vec<usize>> {
        let mut live = Vec::new();
        self.live(animation, &mut live)?;
        Ok(self.moved(&self.parts.lights, &live).map(|(i, _)| i).collect())
    }

    /// Computes the state of everything that an animation changes ([`AnimationRig::motion`]),
    /// `seconds` after the start of playback. `pose` is overwritten, whatever it held.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such animation.
    pub fn pose(&self, animation: usize, seconds: f64, playback: Playback, pose: &mut Pose) -> Result<()> {
        let Scratch { live, locals, world, joints, weights } = &mut pose.scratch;
        let playing = self.live(animation, live)?;
        let seconds = playback.time(seconds, playing.duration);

        // local transforms at this time
        locals.clear();
        locals.extend(self.parts.nodes.iter().map(|n| n.local));
        for (channel, _) in playing.channels.iter().zip(&self.still[animation]).filter(|(_, still)| !**still) {
            let LocalTransform::Trs { translation, rotation, scale } = &mut locals[channel.node] else { continue };
            match channel.property {
                Property::Translation => *translation = channel.sampler.vector(seconds),
                Property::Rotation => *rotation = channel.sampler.rotation(seconds),
                Property::Scale => *scale = channel.sampler.vector(seconds),
                Property::Weights => {}
            }
        }

        // world transforms, parents first
        world.clone_from(&self.rest);
        for (i, node) in self.parts.nodes.iter().enumerate().filter(|(i, _)| live[*i]) {
            let local = locals[i].affine();
            world[i] = node.parent.map_or(local, |p| world[p] * local);
        }

        // what the nodes carry
        pose.instances.clear();
        let placed = self.moved(&self.parts.instances, live);
        pose.instances.extend(placed.map(|(i, node)| (i, at_least(&world[node], self.floor(i)))));
        pose.cameras.clear();
        pose.cameras.extend(self.moved(&self.parts.cameras, live).map(|(i, node)| (i, rigid(&world[node]))));
        pose.lights.clear();
        pose.lights.extend(self.moved(&self.parts.lights, live).map(|(i, node)| (i, rigid(&world[node]))));

        // meshes that deform
        let mut count = 0;
        let deforming = self.find_deforming(animation, live);
        joints.resize_with(self.parts.skins.len(), Vec::new);
        joints.iter_mut().for_each(Vec::clear);
        for (d, deformation) in self.parts.deformations.iter().enumerate() {
            if !deforming.deforms(deformation) {
                continue;
            }
            let Some(base) = self.shapes.get(d) else { continue };
            if pose.meshes.len() == count {
                pose.meshes.push(PosedMesh::default());
            }
            let channel = deforming.weights.get(&deformation.node).map(|(channel, _)| *channel);
            self.weights(deformation, channel.map(|c| (c, seconds)), weights);
            let joints = self.joints(deformation, world, joints);
            pose.meshes[count].mesh = deformation.mesh;
            deformation.pose(base, weights, joints, false, &mut pose.meshes[count].shape);
            count += 1;
        }
        pose.meshes.truncate(count);

        // what is no transform
        pose.materials.clear();
        pose.light_values.clear();
        pose.lenses.clear();
        pose.hidden.clear();
        if !playing.values.is_empty() {
            self.pose_values(playing, seconds, pose);
        }
        Ok(())
    }

    /// Marks the nodes that an animation moves, directly or through a parent.
    fn live(&self, animation: usize, live: &mut Vec<bool>) -> Result<&Animation> {
        let Some(playing) = self.parts.animations.get(animation) else {
            let count = self.parts.animations.len();
            return Err(Error::Usage(format!(
                "animation {animation} does not exist: the scene has {count}, counted from 0"
            )));
        };
        live.clear();
        live.resize(self.parts.nodes.len(), false);
        for (channel, still) in playing.channels.iter().zip(&self.still[animation]) {
            live[channel.node] |= !still && channel.property != Property::Weights;
        }
        self.spread(live);
        Ok(playing)
    }

    /// Marks the nodes below those that are marked.
    fn spread(&self, live: &mut [bool]) {
        for (i, node) in self.parts.nodes.iter().enumerate() {
            live[i] |= node.parent.is_some_and(|p| live[p]);
        }
    }

    /// For each instance of a scene of `count`, whether any animation moves it.
    pub(super) fn moving_instances(&self, count: usize) -> Vec<bool> {
        // at once for all animations: a file may have as many as nodes
        let mut live = vec![false; self.parts.nodes.len()];
        let channels =
            self.parts.animations.iter().zip(&self.still).flat_map(|(a, still)| a.channels.iter().zip(still));
        for (channel, still) in channels {
            live[channel.node] |= !still && channel.property != Property::Weights;
        }
        self.spread(&mut live);
        let mut moving = vec![false; count];
        self.moved(&self.parts.instances, &live).for_each(|(i, _)| moving[i] = true);
        self.parts.switched_instances.iter().for_each(|(i, _)| moving[*i] = true);
        moving
    }

    /// The instances, cameras or lights on moving nodes, each with its node.
    fn moved<'a>(
        &self,
        carried: &'a [Option<usize>],
        live: &'a [bool],
    ) -> impl Iterator<Item = (usize, usize)> + use<'a> {
        carried.iter().enumerate().filter_map(|(i, node)| Some((i, (*node)?))).filter(|(_, node)| live[*node])
    }

    /// Finds what deforms meshes in an animation that moves these nodes.
    fn find_deforming(&self, animation: usize, live: &[bool]) -> Deforming<'_> {
        let skins = self.parts.skins.iter().map(|skin| skin.joints.iter().any(|&j| live[j])).collect();
        let channels = self.parts.animations[animation].channels.iter().zip(&self.still[animation]);
        let weights = channels.filter(|(c, _)| c.property == Property::Weights).map(|(c, still)| (c.node, (c, !still)));
        Deforming { skins, weights: weights.collect() }
    }

    /// Weights of a mesh's morph targets, animated or at rest.
    fn weights(&self, deformation: &Deformation, playing: Option<(&Channel, f64)>, out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.parts.nodes[deformation.node].weights.iter().map(|&w| f64::from(w)));
        if let Some((channel, seconds)) = playing.filter(|_| !deformation.targets.is_empty()) {
            channel.sampler.weights(seconds, out);
        }
    }

    /// The joint matrices of a mesh's skin, given the nodes' world transforms; none without a skin.
    /// Of each skin they are computed once: `known` has a place for each.
    fn joints<'a>(
        &self,
        deformation: &Deformation,
        world: &[DAffine3],
        known: &'a mut [Vec<DAffine3>],
    ) -> &'a [DAffine3] {
        let Some(number) = deformation.skin else { return &[] };
        let (skin, place) = (&self.parts.skins[number], self.skin_place(number));
        let out = &mut known[number];
        if out.is_empty() {
            let joints = skin.joints.iter().zip(&skin.inverse_bind);
            out.extend(joints.map(|(&j, bind)| from_skin_place(&place, &world[j]) * *bind));
        }
        out
    }

    /// Object-to-world transform of the instances of meshes with this skin.
    fn skin_place(&self, skin: usize) -> DAffine3 {
        let skin = &self.parts.skins[skin];
        let first = skin.joints.first().zip(skin.inverse_bind.first());
        first.map_or(DAffine3::IDENTITY, |(&j, bind)| skin_place(&self.rest[j], bind))
    }

    fn floor(&self, instance: usize) -> f64 {
        self.floors.get(instance).copied().unwrap_or(1e-7)
    }

    /// Puts a scene whose meshes are undeformed into its rest pose, and keeps the undeformed
    /// vertices for other poses.
    pub(in crate::scene) fn apply_rest_pose(scene: &mut Scene) {
        let Some(mut rig) = scene.rig.take() else { return };

        // the undeformed shapes are kept; the scene shows them at rest
        rig.shapes.clear();
        let (mut weights, mut joints) = (Vec::new(), vec![Vec::new(); rig.parts.skins.len()]);
        for deformation in &rig.parts.deformations {
            // other geometry was refused when the rig was made
            let Geometry::Triangles(t) = &mut scene.meshes[deformation.mesh].geometry else { continue };
            let base = VertexData::take(t);
            rig.weights(deformation, None, &mut weights);
            let joints = rig.joints(deformation, &rig.rest, &mut joints);
            let mut shape = VertexData::default();
            deformation.pose(&base, &weights, joints, true, &mut shape);
            shape.give(t);
            rig.shapes.push(base);
        }

        // instances of meshes with skins
        let skinned = rig.parts.deformations.iter().filter_map(|d| Some((d.mesh, rig.skin_place(d.skin?))));
        let places: HashMap<usize, DAffine3> = skinned.collect();
        for instance in &mut scene.instances {
            if let Some(to_world) = places.get(&instance.mesh) {
                instance.object_to_world = *to_world;
            }
        }

        let (moving, deforming) = (rig.moving(scene), rig.deforming(scene));
        let place = |rig: &Self, scene: &mut Scene| {
            for (i, node) in rig.parts.instances.iter().enumerate().filter_map(|(i, n)| Some((i, (*n)?))) {
                let instance = &mut scene.instances[i];
                let rest = rig.rest[node];
                // static instances keep their transform: loaders have checked it
                let changes = moving[i] || deforming[instance.mesh];
                instance.object_to_world = if changes { at_least(&rest, rig.floor(i)) } else { rest };
            }
        };
        place(&rig, scene);

        let size = scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).max_element());
        let mut extents: Vec<f64> = scene.meshes.iter().map(|m| extent(&m.geometry)).collect();
        for (deformation, base) in rig.parts.deformations.iter().zip(&rig.shapes) {
            let extent = &mut extents[deformation.mesh];
            *extent = extent.max(deformation.extent(base));
        }
        // a mesh that is a point in every shape may have any scale
        let floor =
            |mesh: usize| Some(1e-7 * size / extents[mesh]).filter(|f| *f > 0.0 && f.is_finite()).unwrap_or(1e-7);
        rig.floors = scene.instances.iter().map(|i| floor(i.mesh)).collect();
        place(&rig, scene);

        // cameras and lights
        for (camera, node) in scene.cameras.iter_mut().zip(&rig.parts.cameras) {
            if let Some(node) = *node {
                camera.camera_to_world = rigid(&rig.rest[node]);
            }
        }
        for (light, node) in scene.lights.iter_mut().zip(&rig.parts.lights) {
            if let Some(node) = *node {
                light.place(&rigid(&rig.rest[node]));
            }
        }
        rig.keep_rest_values(scene);
        scene.rig = Some(rig);
    }
}

impl AnimationRig {
    /// Keeps the materials, lights and cameras of the scene as they are at rest, and hides what is
    /// hidden then.
    fn keep_rest_values(&mut self, scene: &mut Scene) {
        let animated = self.parts.materials.iter().flat_map(|m| &m.materials);
        let material = |&i: &usize| Some((i, scene.materials.get(i)?.clone()));
        self.rest_materials = animated.filter_map(material).collect();
        let variants = |(i, m): (usize, &Material)| Some((i, m.variants.clone()?));
        self.varied = scene.materials.iter().enumerate().filter_map(variants).collect();
        self.rest_lights.clone_from(&scene.lights);
        self.rest_cameras.clone_from(&scene.cameras);

        let is_hidden = self.hidden(None);
        let instances = self.parts.switched_instances.iter();
        scene.hidden = instances.filter(|(_, node)| is_hidden[*node]).map(|(i, _)| *i).collect();
        for &(i, node) in &self.parts.switched_lights {
            if let Some(light) = scene.lights.get_mut(i).filter(|_| is_hidden[node]) {
                light.intensity = glam::Vec3::ZERO;
            }
        }
    }
}

/// Largest extent of a mesh, in object space.
fn extent(geometry: &Geometry) -> f64 {
    geometry.bounds().map_or(0.0, |(lo, hi)| (hi - lo).max_element())
}
