//! The lights of a scene as the path tracer samples them: [`LightRecord`]. They form two groups.
//! Among *placed* lights, whose effect depends on the distance to them, a tree chooses by a bound
//! of their contribution at a point ([`super::light_tree`]). *Distant* ones, the environment with
//! its portals and directional lights, light all points alike and are chosen by the irradiance that
//! they bring. Power decides nothing: that of what lights a whole scene grows with the scene, and a
//! light beside it would get no samples where it is the brightest there is.
//!
//! What is chosen by irradiance may be hidden where another light is not, so that each choice
//! leaves a share to all: no light is sampled so rarely that few samples do not tell of it.

mod collect;
pub(super) mod device;
mod pictures;
mod portals;
mod punctual;
mod surfaces;

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use glam::Vec3;

use super::light_tree;
use super::params::INVALID;
use crate::accel::features::alpha_classes;
use crate::accel::flatten::FlatScene;
use crate::interface::records::lights::{LightNode, LightRecord};
use crate::interface::{LightKind as Kind, LightKinds};
use crate::sampling::CumulativeTable;
use crate::scene::lights::Emission;
use crate::scene::{Geometry, Light, Scene};
use collect::LightCollector;
pub(super) use collect::{LightBuilder, brightness};

/// Fraction of the samples of distant lights that go to the environment and to directional lights
/// in equal parts, and to each of these in equal parts, whatever irradiance they bring.
const EVEN_SHARE: f64 = 0.5;

/// The lights of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Lights {
    /// Placed lights, then distant ones.
    pub records: Vec<LightRecord>,
    /// Number of placed lights.
    pub placed: u32,
    /// [`CumulativeTable::starts`] of placed lights, `placed + 1` numbers, then those of distant
    /// ones.
    pub starts: Vec<u32>,
    /// The tree over placed lights; without any a leaf that emits nothing.
    pub tree: Vec<LightNode>,
    /// Irradiance that distant lights bring to a surface that faces them, if nothing is in the way
    /// ([`brightness`]).
    pub distant_irradiance: f64,
    /// For each instance of the scene the index in this table at which the lights of its primitives
    /// begin, or [`INVALID`]; then the light of each primitive, or [`INVALID`]. Empty if no surface
    /// emits.
    pub light_of: Vec<u32>,
    /// Index of the environment, if it is sampled.
    pub environment: Option<u32>,
    /// Indices of the directional lights.
    pub directional: Range<u32>,
    /// Some directional lights have an angular diameter above 0, so that rays can hit them.
    pub has_disks: bool,
}

impl Lights {
    /// No lights but the environment.
    pub fn environment_only() -> Self {
        let record =
            LightRecord { kind: Kind::Environment as u32, instance: INVALID, probability: 1.0, ..Default::default() };
        let tree = vec![light_tree::no_lights()];
        Self { records: vec![record], starts: vec![0; 3], tree, environment: Some(0), ..Default::default() }
    }

    /// The kinds of lights that are sampled.
    pub fn kinds(&self) -> LightKinds {
        self.records.iter().map(|r| Kind::ALL[r.kind as usize]).collect()
    }

    /// Number of distant lights.
    pub fn distant(&self) -> u32 {
        self.count() - self.placed
    }

    /// Returns true if there are placed lights and distant ones.
    pub fn has_both_groups(&self) -> bool {
        self.placed > 0 && self.distant() > 0
    }

    /// Number of lights, the environment and each portal included.
    pub fn count(&self) -> u32 {
        self.records.len() as u32
    }
}

impl LightBuilder {
    /// For lights of `flat`. `environment`: radiance of what surrounds it, averaged over the
    /// sphere.
    pub fn new(flat: &FlatScene, environment: Vec3) -> Self {
        let scene = flat.scene;
        // what changes its emission is one light a triangle, as what moves is
        let changes = |mesh: usize| flat.motion.materials.contains_key(&scene.meshes[mesh].material);
        let moves = |(k, mesh): (usize, usize)| {
            flat.motion.instances.contains(&k) || flat.motion.meshes.contains(&mesh) || changes(mesh)
        };
        let moves: Vec<bool> = scene.instances.iter().map(|i| i.mesh).enumerate().map(moves).collect();
        Self {
            origin: flat.origin,
            environment,
            alpha: alpha_classes(scene, &flat.motion, flat.blend),
            changing: flat.motion.lights.clone(),
            emitters: emitters(flat),
            means: HashMap::new(),
            side: pictures::side(pictures::count_triangles(scene, &moves)),
            parts: HashMap::new(),
            moves,
        }
    }

    /// Kinds of lights that moving surfaces may become: a sphere whose scale is not uniform is none
    /// at times.
    pub fn moving_kinds(&self, scene: &Scene) -> impl Iterator<Item = Kind> {
        let is_sphere = |mesh: usize| matches!(scene.meshes[mesh].geometry, Geometry::Spheres(_));
        let emits = |mesh: usize| {
            let material = scene.meshes[mesh].material;
            scene.materials[material].emissive != Vec3::ZERO || self.emitters.contains(&material)
        };
        let moving = scene.instances.iter().zip(&self.moves).filter(|(_, moves)| **moves).map(|(i, _)| i.mesh);
        moving.filter(move |&mesh| is_sphere(mesh) && emits(mesh)).map(|_| Kind::Sphere)
    }

    /// The lights of the scene, or of the same scene in another pose.
    pub fn lights(&mut self, scene: &Scene) -> Lights {
        let mut all = LightCollector::default();
        let is_far = |light: &&Light| matches!(light.kind.emission(), Emission::Distant { .. });
        let punctual = || scene.lights.iter().enumerate();
        punctual().filter(|(_, l)| !is_far(l)).for_each(|(k, l)| punctual::add(&mut all, self, l, k));
        let light_of = surfaces::add(&mut all, self, scene);
        let placed = all.records.len();
        let evenly = CumulativeTable::new(&all.even_shares);
        for (record, &probability) in all.records.iter_mut().zip(&evenly.probabilities) {
            record.probability = probability;
        }
        let mut lights = Lights { light_of, placed: placed as u32, ..Default::default() };
        if placed > 0 {
            let trails;
            (lights.tree, trails) = light_tree::build(&all.bounds);
            for (record, trail) in all.records.iter_mut().zip(trails) {
                [record.trail_low, record.trail_high] = [trail as u32, (trail >> 32) as u32];
            }
        } else {
            lights.tree.push(light_tree::no_lights());
        }
        punctual().filter(|(_, l)| is_far(l)).for_each(|(k, l)| punctual::add(&mut all, self, l, k));
        lights.directional = placed as u32..all.records.len() as u32;
        lights.has_disks = all.records[placed..].iter().any(|r| r.radius > 0.0);
        let directional = all.weights.len();
        if self.environment != Vec3::ZERO {
            lights.environment = portals::add_environment(&mut all, self, scene);
        }
        let sky = PI * brightness(self.environment);
        lights.distant_irradiance = all.weights[..directional].iter().sum::<f64>() + sky;
        let table = CumulativeTable::new(&distant_probabilities(&all.weights, directional, sky));
        lights.records = all.records;
        for (record, &probability) in lights.records[placed..].iter_mut().zip(&table.probabilities) {
            record.probability = probability;
        }
        lights.starts = if placed > 0 { evenly.starts } else { vec![0] };
        lights.starts.extend(table.starts);
        lights
    }
}

/// Materials that emit at some time of an animation that changes them.
fn emitters(flat: &FlatScene) -> Vec<usize> {
    let emits = |k: &usize| flat.motion.states(flat.scene, *k).any(|m| m.emissive != Vec3::ZERO && !m.unlit);
    flat.motion.materials.keys().copied().filter(emits).collect()
}

/// Probabilities of distant lights, of which the first `directional` are directional lights and the
/// others the environment and its portals. `sky`: irradiance that the environment brings.
fn distant_probabilities(weights: &[f64], directional: usize, sky: f64) -> Vec<f64> {
    let (suns, openings) = weights.split_at(directional);
    let sun: f64 = suns.iter().sum();
    let even = |share: f64, equal: f64| (1.0 - EVEN_SHARE) * share + EVEN_SHARE * equal;
    let of_suns = match (suns.len(), openings.len()) {
        (0, _) => 0.0,
        (_, 0) => 1.0,
        _ => even(sun / (sun + sky), 0.5),
    };
    let through: f64 = openings.iter().sum();
    let suns_alike = 1.0 / suns.len() as f64;
    let suns = suns.iter().map(|w| of_suns * even(w / sun, suns_alike));
    suns.chain(openings.iter().map(|w| (1.0 - of_suns) * w / through)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_distant_light_is_left_out() {
        // one sun, 1e6 times as bright as the other, and a sky of 1e-6 of it
        let p = distant_probabilities(&[1e6, 1.0, 1.0], 2, 1.0);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12 && p[0] > 0.5 && p[1] > 0.18 && p[2] > 0.24, "{p:?}");
        assert_eq!(distant_probabilities(&[3.0], 0, 3.0), [1.0]);
        assert_eq!(distant_probabilities(&[3.0], 1, 0.0), [1.0]);
        // portals share what the environment gets
        assert_eq!(distant_probabilities(&[1.0, 3.0], 0, 7.0), [0.25, 0.75]);
        assert!(distant_probabilities(&[], 0, 0.0).is_empty());
    }
}
