//! The lights of a scene as the path tracer samples them: [`LightRecord`]. Few lights are chosen by power; among many, a tree
//! chooses by a bound of their contribution at a point ([`super::light_tree`]).

pub(super) mod device;
mod portals;
mod punctual;
mod surfaces;

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec3, Vec3, Vec4};

use super::light_tree::{self, Bounds};
use super::params::INVALID;
use crate::accel::features::{AlphaClass, alpha_classes};
use crate::accel::flatten::FlatScene;
use crate::interface::records::lights::{LightNode, LightRecord};
use crate::interface::{LightKind as Kind, LightKinds};
use crate::sampling::CumulativeTable;
use crate::scene::lights::Emission;
use crate::scene::{Geometry, Light, Scene};

/// With more positional lights than this, a light tree chooses among them.
const MAX_BY_POWER: usize = 256;

/// The lights of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Lights {
    pub records: Vec<LightRecord>,
    /// Index of the first record that is chosen by power, as all records from there on are.
    pub first: u32,
    /// [`CumulativeTable::starts`] of the power of the lights that are chosen by power.
    pub starts: Vec<u32>,
    /// The tree over positional lights, if there are many: the tree is then the last choice by power.
    pub tree: Vec<LightNode>,
    /// For each instance of the scene the index in this table at which the lights of its primitives begin, or [`INVALID`]; then the light of each primitive, or
    /// [`INVALID`]. Empty if no surface emits.
    pub light_of: Vec<u32>,
    /// Index of the environment, if it is sampled.
    pub environment: Option<u32>,
    /// Indices of the directional lights.
    pub directional: Range<u32>,
    /// Some directional lights have an angular diameter above 0, so that rays can hit them.
    pub has_disks: bool,
}

/// Importance of a light of this radiance (or intensity, or irradiance; linear RGB): the root mean square of its channels. Sampling in proportion to it minimizes
/// the squared error summed over channels; in proportion to luminance, blue lights would be undersampled and noisy.
pub(super) fn brightness(c: Vec3) -> f64 {
    (c.as_dvec3().length_squared() / 3.0).sqrt()
}

/// Makes the lights of a scene, again and again if they move: what does not depend on where they are is found once.
pub(super) struct LightBuilder {
    origin: DVec3,
    /// Of the scene's bounding sphere.
    radius: f64,
    /// Radiance of what surrounds the scene, averaged over the sphere.
    environment: Vec3,
    alpha: Vec<AlphaClass>,
    /// For each instance: it moves or deforms.
    moves: Vec<bool>,
    /// Means of the textures of emitters, by index.
    means: HashMap<Option<usize>, Vec4>,
}

/// Collects lights, with the power of each, and bounds of positional ones.
#[derive(Default)]
struct LightCollector {
    records: Vec<LightRecord>,
    powers: Vec<f64>,
    bounds: Vec<Bounds>,
}

impl LightCollector {
    /// Adds a light and returns its index. A light without power is not sampled: [`INVALID`].
    fn push(&mut self, record: LightRecord, power: f64, bounds: Option<Bounds>) -> u32 {
        debug_assert!(bounds.is_none() || self.bounds.len() == self.records.len(), "lights with a position come first");
        if power.is_nan() || power <= 0.0 {
            return INVALID;
        }
        self.records.push(record);
        self.powers.push(power);
        self.bounds.extend(bounds);
        self.records.len() as u32 - 1
    }
}

impl Lights {
    /// No lights but the environment.
    pub fn environment_only() -> Self {
        let record = LightRecord { kind: Kind::Environment as u32, instance: INVALID, probability: 1.0, ..Default::default() };
        Self { records: vec![record], starts: vec![0; 2], environment: Some(0), ..Default::default() }
    }

    /// The kinds of lights that are sampled.
    pub fn kinds(&self) -> LightKinds {
        self.sampled().iter().map(|r| Kind::ALL[r.kind as usize]).collect()
    }

    /// All records but the tree, which stands for the positional lights and is the last choice.
    fn sampled(&self) -> &[LightRecord] {
        &self.records[..self.records.len() - usize::from(!self.tree.is_empty())]
    }

    /// Number of lights that are chosen by power.
    pub fn choices(&self) -> u32 {
        self.records.len() as u32 - self.first
    }

    /// The light that is sampled, if there is but one choice; it may be the tree, which is no light itself.
    pub fn only(&self) -> Option<LightRecord> {
        (self.choices() == 1).then(|| self.records[self.first as usize])
    }

    /// Probability with which the tree is chosen, the last of what is chosen by power; 0 without one.
    pub fn tree_probability(&self) -> f32 {
        self.records.last().filter(|_| !self.tree.is_empty()).map_or(0.0, |tree| tree.probability)
    }

    /// Number of lights, the environment and each portal included.
    pub fn count(&self) -> u32 {
        self.sampled().len() as u32
    }
}

impl LightBuilder {
    /// For lights of `flat`. `environment`: radiance of what surrounds it, averaged over the sphere.
    pub fn new(flat: &FlatScene, environment: Vec3) -> Self {
        let scene = flat.scene;
        let moves = |(k, mesh): (usize, usize)| flat.motion.instances.contains(&k) || flat.motion.meshes.contains(&mesh);
        Self {
            origin: flat.origin,
            radius: radius(scene),
            environment,
            alpha: alpha_classes(scene, flat.blend),
            moves: scene.instances.iter().map(|i| i.mesh).enumerate().map(moves).collect(),
            means: HashMap::new(),
        }
    }

    /// Kinds of lights that moving surfaces may become: a sphere whose scale is not uniform is none at times.
    pub fn moving_kinds(&self, scene: &Scene) -> impl Iterator<Item = Kind> {
        let is_sphere = |mesh: usize| matches!(scene.meshes[mesh].geometry, Geometry::Spheres(_));
        let emits = |mesh: usize| scene.materials[scene.meshes[mesh].material].emissive != Vec3::ZERO;
        let moving = scene.instances.iter().zip(&self.moves).filter(|(_, moves)| **moves).map(|(i, _)| i.mesh);
        moving.filter(move |&mesh| is_sphere(mesh) && emits(mesh)).map(|_| Kind::Sphere)
    }

    /// The lights of the scene, or of the same scene in another pose.
    pub fn lights(&mut self, scene: &Scene) -> Lights {
        let mut all = LightCollector::default();
        let is_far = |light: &&Light| matches!(light.kind.emission(), Emission::Distant { .. });
        scene.lights.iter().filter(|l| !is_far(l)).for_each(|l| punctual::add(&mut all, self, l));
        let light_of = surfaces::add(&mut all, self, scene);
        let first_far = all.records.len() as u32;
        scene.lights.iter().filter(is_far).for_each(|l| punctual::add(&mut all, self, l));
        let directional = first_far..all.records.len() as u32;
        let has_disks = all.records[first_far as usize..].iter().any(|r| r.radius > 0.0);
        let mut lights = Lights { light_of, directional, has_disks, ..Default::default() };
        if self.environment != Vec3::ZERO {
            // the power that crosses the scene's bounding disk, from all directions
            let power = 4.0 * PI.powi(2) * self.radius.powi(2) * brightness(self.environment);
            lights.environment = portals::add_environment(&mut all, self, scene, power);
        }
        let placed = all.bounds.len();
        if placed > MAX_BY_POWER && placed <= light_tree::MAX_LIGHTS {
            let (nodes, trails) = light_tree::build(&all.bounds);
            for (record, trail) in all.records.iter_mut().zip(trails) {
                record.trail = trail;
            }
            let power = all.powers[..placed].iter().sum();
            all.push(LightRecord { kind: INVALID, instance: INVALID, ..Default::default() }, power, None);
            (lights.tree, lights.first) = (nodes, placed as u32);
        }
        lights.records = all.records;
        let first = lights.first as usize;
        let table = CumulativeTable::new(&all.powers[first..]);
        for (record, &probability) in lights.records[first..].iter_mut().zip(&table.probabilities) {
            record.probability = probability;
        }
        lights.starts = table.starts;
        lights
    }
}

/// Radius of the bounding sphere of the scene.
fn radius(scene: &Scene) -> f64 {
    scene.bounds().map_or(1.0, |(lo, hi)| 0.5 * (hi - lo).length()).max(1e-30)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The importance of a light does not depend on the channel of its radiance.
    #[test]
    fn colours_count_alike() {
        let colours = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let counts = colours.map(brightness);
        assert!(counts[0] == counts[1] && counts[1] == counts[2] && (counts[3] - 1.0).abs() < 1e-12, "{counts:?}");
        assert_eq!(brightness(3.0 * Vec3::Z), 3.0 * counts[2]);
    }
}
