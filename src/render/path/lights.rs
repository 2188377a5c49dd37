//! The lights of a scene as the path tracer draws them: `LightRecord` of shaders/path/lights.glsl. Few are drawn by their power, from an alias table;
//! of many, a tree chooses by what they may do at a point ([`super::light_tree`]).

use std::collections::HashMap;
use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::light_tree::{self, Bounds, LightNode};
use super::params::INVALID;
use crate::sampling::AliasTable;
use crate::scene::flatten::FlatScene;
use crate::scene::{Geometry, Light, LightKind};

const POINT: u32 = 0;
const SPOT: u32 = 1;
const DIRECTIONAL: u32 = 2;
const TRIANGLE: u32 = 3;
const SPHERE: u32 = 4;
const ENVIRONMENT: u32 = 5;
const TREE: u32 = 6;

/// More lights with a place than these are drawn from a tree.
const MOST_BY_POWER: usize = 256;

const TWO_SIDED: u32 = 1;
const MIRRORED: u32 = 2;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct LightRecord {
    position: [f32; 3],
    radius: f32,
    axis: [f32; 3],
    cos_inner: f32,
    edge: [f32; 3],
    cos_outer: f32,
    intensity: [f32; 3],
    range: f32,
    probability: f32,
    threshold: f32,
    alias: u32,
    kind: u32,
    instance: u32,
    primitive: u32,
    flags: u32,
    lift: f32,
}

/// All lights.
#[derive(Clone, Debug, Default)]
pub(super) struct Lights {
    pub records: Vec<LightRecord>,
    /// The first of the records that the alias table chooses among; it chooses among all from there on.
    pub first: u32,
    /// Over the lights that have a place, where they are many: one of the table's choices then is the tree.
    pub tree: Vec<LightNode>,
    /// First light of each instance of the scene; empty where no surface is a light.
    pub light_of: Vec<u32>,
    /// Place of the environment.
    pub environment: Option<u32>,
}

/// Luminance of linear sRGB (IEC 61966-2-1).
pub(super) fn luminance(c: Vec3) -> f64 {
    c.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Lights that are being gathered: each with its power, and with bounds where it has a place.
#[derive(Default)]
struct Gathered {
    records: Vec<LightRecord>,
    powers: Vec<f64>,
    bounds: Vec<Bounds>,
}

impl Gathered {
    fn push(&mut self, record: LightRecord, power: f64, bounds: Option<Bounds>) {
        debug_assert!(bounds.is_none() || self.bounds.len() == self.records.len(), "lights with a place come first");
        self.records.push(record);
        self.powers.push(power);
        self.bounds.extend(bounds);
    }
}

impl Lights {
    /// Nothing but an environment.
    pub fn sky_only() -> Self {
        let record =
            LightRecord { kind: ENVIRONMENT, instance: INVALID, probability: 1.0, threshold: 1.0, ..Default::default() };
        Self { records: vec![record], environment: Some(0), ..Default::default() }
    }

    /// A bit for each kind that there is, the first for [`POINT`].
    pub fn kinds(&self) -> u32 {
        self.records.iter().fold(0, |bits, r| bits | 1 << r.kind)
    }

    /// Among how many the alias table chooses.
    pub fn choices(&self) -> u32 {
        self.records.len() as u32 - self.first
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        (self.records.len() - usize::from(!self.tree.is_empty())) as u32
    }

    /// Those of a scene. `environment`: radiance of what surrounds it, averaged over the sphere.
    pub fn new(flat: &FlatScene, environment: Vec3) -> Self {
        let mut all = Gathered::default();
        let scene = flat.scene;
        let is_far = |light: &&Light| matches!(light.kind, LightKind::Directional { .. });
        scene.lights.iter().filter(|l| !is_far(l)).for_each(|l| add_punctual(&mut all, flat, l));
        let light_of = add_surfaces(&mut all, flat);
        scene.lights.iter().filter(is_far).for_each(|l| add_punctual(&mut all, flat, l));
        let mut lights = Self { light_of, ..Default::default() };
        if environment != Vec3::ZERO {
            lights.environment = Some(all.records.len() as u32);
            // what crosses the disk that the scene fills, from everywhere
            let power = 4.0 * PI.powi(2) * radius(flat).powi(2) * luminance(environment);
            all.push(LightRecord { kind: ENVIRONMENT, instance: INVALID, ..Default::default() }, power, None);
        }
        let placed = all.bounds.len();
        if placed > MOST_BY_POWER && placed <= light_tree::MOST_LIGHTS {
            let (nodes, trails) = light_tree::build(&all.bounds);
            for (record, trail) in all.records.iter_mut().zip(trails) {
                record.alias = trail;
            }
            let power = all.powers[..placed].iter().sum();
            all.push(LightRecord { kind: TREE, instance: INVALID, ..Default::default() }, power, None);
            (lights.tree, lights.first) = (nodes, placed as u32);
        }
        lights.records = all.records;
        let first = lights.first as usize;
        let table = AliasTable::new(&all.powers[first..]);
        for ((record, bin), &probability) in lights.records[first..].iter_mut().zip(&table.bins).zip(&table.probabilities) {
            (record.threshold, record.alias, record.probability) = (bin.threshold, bin.alias + lights.first, probability);
        }
        lights
    }
}

fn add_punctual(all: &mut Gathered, flat: &FlatScene, light: &Light) {
    let position = light.position - flat.origin;
    let brightness = luminance(light.intensity);
    let base = LightRecord {
        position: position.as_vec3().to_array(),
        axis: light.direction.as_vec3().to_array(),
        intensity: light.intensity.to_array(),
        range: light.range as f32,
        instance: INVALID,
        ..Default::default()
    };
    let place = |axis, spread, falloff| Bounds {
        lo: position,
        hi: position,
        axis,
        spread,
        falloff,
        both_ways: false,
        intensity: brightness,
    };
    match light.kind {
        LightKind::Point => {
            all.push(LightRecord { kind: POINT, ..base }, 4.0 * PI * brightness, Some(place(DVec3::Z, PI, 0.5 * PI)));
        }
        LightKind::Spot { inner_angle, outer_angle } => {
            let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
            // as if it fell off half-way between the two
            let solid = 2.0 * PI * (1.0 - 0.5 * f64::from(inner + outer));
            let record = LightRecord { kind: SPOT, cos_inner: inner, cos_outer: outer, ..base };
            let (spread, reach) = (f64::from(inner_angle), f64::from(outer_angle));
            all.push(
                record,
                solid * brightness,
                Some(place(light.direction.normalize_or(DVec3::NEG_Z), spread, reach - spread)),
            );
        }
        LightKind::Directional { angle } => {
            // 1 - cos, without cancellation
            let one_minus_cos = 2.0 * (0.25 * f64::from(angle)).sin().powi(2);
            let record = LightRecord { kind: DIRECTIONAL, radius: one_minus_cos as f32, ..base };
            all.push(record, PI * radius(flat).powi(2) * brightness, None);
        }
    }
}

/// Every primitive whose material emits; returns the first light of each instance, nothing where there is none. A sphere that its instance
/// stretches has no closed form: BSDF samples find it.
fn add_surfaces(all: &mut Gathered, flat: &FlatScene) -> Vec<u32> {
    let scene = flat.scene;
    let mut light_of = vec![INVALID; scene.instances.len()];
    let mut means = HashMap::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        // an unlit surface lights nothing: it only shows
        if material.emissive == Vec3::ZERO || material.unlit {
            continue;
        }
        let to_world = instance.object_to_world;
        let first = all.records.len() as u32;
        let base = LightRecord {
            intensity: material.emissive.to_array(),
            instance: i as u32,
            flags: if material.double_sided { TWO_SIDED } else { 0 },
            ..Default::default()
        };
        let texture = material.emissive_texture.map(|slot| slot.texture);
        let mean = *means.entry(texture).or_insert_with(|| mean_texture(flat, texture));
        let brightness = luminance(material.emissive * mean);
        match &mesh.geometry {
            Geometry::Triangles(t) => {
                let point = |k: u32| to_world.transform_point3(t.positions[k as usize].as_dvec3()) - flat.origin;
                // a transform that mirrors turns the winding
                let mirrored = to_world.matrix3.determinant() < 0.0;
                for (primitive, corners) in t.indices.iter().enumerate() {
                    let [a, b, c] = corners.map(point);
                    let (e1, e2) = (b - a, c - a);
                    let normal = e1.cross(e2) * if mirrored { -1.0 } else { 1.0 };
                    let area = 0.5 * normal.length();
                    let extent = a.abs().max(b.abs()).max(c.abs()).max_element() + e1.abs().max(e2.abs()).max_element();
                    // barycentrics follow the corners; a turned winding is a turned normal
                    let edge = |e: DVec3| e.as_vec3().to_array();
                    let record = LightRecord {
                        kind: TRIANGLE,
                        position: a.as_vec3().to_array(),
                        axis: edge(e1),
                        edge: edge(e2),
                        flags: base.flags | if mirrored { MIRRORED } else { 0 },
                        primitive: primitive as u32,
                        lift: (extent * LIFT) as f32,
                        ..base
                    };
                    let sides = if material.double_sided { 2.0 } else { 1.0 };
                    let bounds = Bounds {
                        lo: a.min(b).min(c),
                        hi: a.max(b).max(c),
                        axis: normal.normalize_or(DVec3::Z),
                        spread: 0.0,
                        falloff: 0.5 * PI,
                        both_ways: material.double_sided,
                        intensity: area * brightness,
                    };
                    all.push(record, sides * PI * area * brightness, Some(bounds));
                }
            }
            Geometry::Spheres(spheres) => {
                let m = to_world.matrix3;
                let scale = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
                if scale.iter().any(|s| (s / scale[0] - 1.0).abs() > 1e-6) {
                    continue;
                }
                for (primitive, s) in spheres.iter().enumerate() {
                    let centre = to_world.transform_point3(s.center.as_dvec3()) - flat.origin;
                    let radius = f64::from(s.radius) * scale[0];
                    let record = LightRecord {
                        kind: SPHERE,
                        position: centre.as_vec3().to_array(),
                        radius: radius as f32,
                        primitive: primitive as u32,
                        lift: ((centre.abs().max_element() + radius) * LIFT) as f32,
                        ..base
                    };
                    let bounds = Bounds {
                        lo: centre - radius,
                        hi: centre + radius,
                        axis: DVec3::Z,
                        spread: PI,
                        falloff: 0.5 * PI,
                        both_ways: false,
                        intensity: PI * radius * radius * brightness,
                    };
                    all.push(record, 4.0 * PI.powi(2) * radius * radius * brightness, Some(bounds));
                }
            }
        }
        light_of[i] = first;
    }
    if light_of.iter().all(|&first| first == INVALID) { Vec::new() } else { light_of }
}

/// Share of its coordinates by which rounding may have moved a point of a light.
const LIFT: f64 = 8.0 / 16_777_216.0;

/// Of the ball that holds the scene.
fn radius(flat: &FlatScene) -> f64 {
    flat.scene.bounds().map_or(1.0, |(lo, hi)| 0.5 * (hi - lo).length()).max(1e-30)
}

/// Mean of the texture that multiplies a material's emission.
fn mean_texture(flat: &FlatScene, texture: Option<usize>) -> Vec3 {
    let Some(texture) = texture else { return Vec3::ONE };
    let texels = &flat.scene.textures[texture].texels;
    let mut sum = DVec3::ZERO;
    for i in 0..texels.len() {
        let [r, g, b, _] = texels.decode_srgb(i);
        sum += Vec3::new(r, g, b).as_dvec3();
    }
    (sum / texels.len().max(1) as f64).as_vec3()
}
