//! The lights of a scene as the path tracer draws them: `LightRecord` of shaders/path/lights.glsl, with an alias table by power.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::params::INVALID;
use crate::output::png::srgb_decode;
use crate::sampling::AliasTable;
use crate::scene::flatten::FlatScene;
use crate::scene::{Geometry, LightKind, Material};

const POINT: u32 = 0;
const SPOT: u32 = 1;
const DIRECTIONAL: u32 = 2;
const TRIANGLE: u32 = 3;
const SPHERE: u32 = 4;
const ENVIRONMENT: u32 = 5;

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
    two_sided: u32,
    lift: f32,
}

/// All lights.
#[derive(Clone, Debug, Default)]
pub(super) struct Lights {
    pub records: Vec<LightRecord>,
    /// First light of each instance of the scene; empty where no surface is a light.
    pub light_of: Vec<u32>,
    /// Place of the environment.
    pub environment: Option<u32>,
}

/// Luminance of linear sRGB (IEC 61966-2-1).
pub(super) fn luminance(c: Vec3) -> f64 {
    c.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

impl Lights {
    /// Nothing but an environment.
    pub fn sky_only() -> Self {
        let record =
            LightRecord { kind: ENVIRONMENT, instance: INVALID, probability: 1.0, threshold: 1.0, ..Default::default() };
        Self { records: vec![record], light_of: Vec::new(), environment: Some(0) }
    }

    /// Those of a scene. `environment`: radiance of what surrounds it, averaged over the sphere.
    pub fn new(flat: &FlatScene, environment: Vec3) -> Self {
        let mut lights = Self::default();
        let mut powers = Vec::new();
        let scene = flat.scene;
        for light in &scene.lights {
            let base = LightRecord {
                position: (light.position - flat.origin).as_vec3().to_array(),
                axis: light.direction.as_vec3().to_array(),
                intensity: light.intensity.to_array(),
                range: light.range as f32,
                instance: INVALID,
                ..Default::default()
            };
            let (record, power) = match light.kind {
                LightKind::Point => (LightRecord { kind: POINT, ..base }, 4.0 * std::f64::consts::PI),
                LightKind::Spot { inner_angle, outer_angle } => {
                    let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
                    // as if it fell off half-way between the two
                    let solid = 2.0 * std::f64::consts::PI * (1.0 - 0.5 * f64::from(inner + outer));
                    (LightRecord { kind: SPOT, cos_inner: inner, cos_outer: outer, ..base }, solid)
                }
                LightKind::Directional => {
                    (LightRecord { kind: DIRECTIONAL, cos_outer: 1.0, ..base }, std::f64::consts::PI * radius(flat).powi(2))
                }
                // loaders make surfaces of these
                LightKind::Sphere { .. } => continue,
            };
            powers.push(power * luminance(light.intensity));
            lights.records.push(record);
        }
        lights.add_surfaces(flat, &mut powers);
        if environment != Vec3::ZERO {
            lights.environment = Some(lights.records.len() as u32);
            lights.records.push(LightRecord { kind: ENVIRONMENT, instance: INVALID, ..Default::default() });
            // what crosses the disk that the scene fills, from everywhere
            powers.push(4.0 * std::f64::consts::PI.powi(2) * radius(flat).powi(2) * luminance(environment));
        }
        let table = AliasTable::new(&powers);
        for ((record, bin), &probability) in lights.records.iter_mut().zip(&table.bins).zip(&table.probabilities) {
            (record.threshold, record.alias, record.probability) = (bin.threshold, bin.alias, probability);
        }
        lights
    }

    /// Every primitive whose material emits. A sphere that its instance stretches has no closed form: BSDF samples find it.
    fn add_surfaces(&mut self, flat: &FlatScene, powers: &mut Vec<f64>) {
        let scene = flat.scene;
        let mut light_of = vec![INVALID; scene.instances.len()];
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            // an unlit surface lights nothing: it only shows
            if material.emissive == Vec3::ZERO || material.unlit {
                continue;
            }
            let to_world = instance.object_to_world;
            let first = self.records.len() as u32;
            let base = LightRecord {
                intensity: material.emissive.to_array(),
                instance: i as u32,
                two_sided: material.double_sided.into(),
                ..Default::default()
            };
            let brightness = luminance(material.emissive * mean_texture(flat, material));
            match &mesh.geometry {
                Geometry::Triangles(t) => {
                    let point = |k: u32| to_world.transform_point3(t.positions[k as usize].as_dvec3()) - flat.origin;
                    // a transform that mirrors turns the winding
                    let mirrored = to_world.matrix3.determinant() < 0.0;
                    for (primitive, corners) in t.indices.iter().enumerate() {
                        let [a, b, c] = corners.map(point);
                        let (e1, e2) = (b - a, c - a);
                        let area = 0.5 * e1.cross(e2).length();
                        let extent = a.abs().max(b.abs()).max(c.abs()).max_element() + e1.abs().max(e2.abs()).max_element();
                        // barycentrics follow the corners; a turned winding is a turned normal
                        let edge = |e: DVec3| e.as_vec3().to_array();
                        self.records.push(LightRecord {
                            kind: TRIANGLE,
                            position: a.as_vec3().to_array(),
                            axis: edge(e1),
                            edge: edge(e2),
                            cos_outer: if mirrored { -1.0 } else { 1.0 },
                            primitive: primitive as u32,
                            lift: (extent * LIFT) as f32,
                            ..base
                        });
                        let sides = if material.double_sided { 2.0 } else { 1.0 };
                        powers.push(sides * std::f64::consts::PI * area * brightness);
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
                        self.records.push(LightRecord {
                            kind: SPHERE,
                            position: centre.as_vec3().to_array(),
                            radius: radius as f32,
                            primitive: primitive as u32,
                            lift: ((centre.abs().max_element() + radius) * LIFT) as f32,
                            ..base
                        });
                        powers.push(4.0 * std::f64::consts::PI.powi(2) * radius * radius * brightness);
                    }
                }
            }
            light_of[i] = first;
        }
        if light_of.iter().any(|&first| first != INVALID) {
            self.light_of = light_of;
        }
    }
}

/// Share of its coordinates by which rounding may have moved a point of a light.
const LIFT: f64 = 8.0 / 16_777_216.0;

/// Of the ball that holds the scene.
fn radius(flat: &FlatScene) -> f64 {
    flat.scene.bounds().map_or(1.0, |(lo, hi)| 0.5 * (hi - lo).length()).max(1e-30)
}

/// Mean of what multiplies a material's emission.
fn mean_texture(flat: &FlatScene, material: &Material) -> Vec3 {
    let Some(slot) = &material.emissive_texture else { return Vec3::ONE };
    let texels = &flat.scene.textures[slot.texture].rgba8;
    let mut sum = DVec3::ZERO;
    for p in texels.chunks_exact(4) {
        sum += DVec3::from_array([0, 1, 2].map(|c| f64::from(srgb_decode(f32::from(p[c]) / 255.0))));
    }
    (sum / (texels.len() / 4).max(1) as f64).as_vec3()
}
