//! The lights of a scene as the path tracer samples them: [`LightRecord`]. Few are chosen by their power; of many, a tree
//! chooses by what they may do at a point ([`super::light_tree`]).

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec3, DVec4, Vec3, Vec4};

use super::light_tree::{self, Bounds};
use super::params::INVALID;
use crate::accel::features::{AlphaClass, alpha_classes};
use crate::accel::flatten::FlatScene;
use crate::interface::records::lights::{LIGHT_ALPHA, LIGHT_MIRRORED, LIGHT_TWO_SIDED, LightNode, LightRecord};
use crate::interface::{LightKind as Kind, PathFeature};
use crate::sampling::CumulativeTable;
use crate::scene::{AlphaMode, Geometry, Light, LightKind, Material, TriangleMesh};

/// More lights with a position than these are chosen from a tree.
const MAX_BY_POWER: usize = 256;

/// All lights.
#[derive(Clone, Debug, Default)]
pub(super) struct Lights {
    pub records: Vec<LightRecord>,
    /// The first of the records that are chosen by power, which are all from there on.
    pub first: u32,
    /// [`CumulativeTable::starts`] of the power of those.
    pub starts: Vec<u32>,
    /// Over the lights that have a position, where they are many: the tree then is the last that is chosen by power.
    pub tree: Vec<LightNode>,
    /// For each instance of the scene, the place further on in this table where the lights of its primitives begin, or [`INVALID`]; then those
    /// lights, one for each primitive, or [`INVALID`]. Empty where no surface is a light.
    pub light_of: Vec<u32>,
    /// Index of the environment.
    pub environment: Option<u32>,
    /// Directional lights.
    pub directional: Range<u32>,
    /// Some of them have an extent: paths meet them.
    pub has_disks: bool,
}

/// How much a light of this radiance (or intensity, or irradiance; linear RGB) counts: the root mean square of its channels. Sampled in proportion to it, the
/// squared error summed over channels is least. In proportion to luminance, blue lights would be sampled too seldom, and be noise.
pub(super) fn brightness(c: Vec3) -> f64 {
    (c.as_dvec3().length_squared() / 3.0).sqrt()
}

/// Lights that are being gathered: each with its power, and with bounds where it has a position.
#[derive(Default)]
struct Gathered {
    records: Vec<LightRecord>,
    powers: Vec<f64>,
    bounds: Vec<Bounds>,
}

impl Gathered {
    /// Returns its index. What has no power is not sampled: [`INVALID`].
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
    /// Nothing but an environment.
    pub fn sky_only() -> Self {
        let record = LightRecord { kind: Kind::Environment as u32, instance: INVALID, probability: 1.0, ..Default::default() };
        Self { records: vec![record], starts: vec![0; 2], environment: Some(0), ..Default::default() }
    }

    /// The kinds that there are: the first features are [`Kind::ALL`].
    pub fn kinds(&self) -> impl Iterator<Item = PathFeature> {
        self.records.iter().map(|r| PathFeature::ALL[r.kind as usize])
    }

    /// How many are chosen by power.
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
        let first_far = all.records.len() as u32;
        scene.lights.iter().filter(is_far).for_each(|l| add_punctual(&mut all, flat, l));
        let directional = first_far..all.records.len() as u32;
        let has_disks = all.records[first_far as usize..].iter().any(|r| r.radius > 0.0);
        let mut lights = Self { light_of, directional, has_disks, ..Default::default() };
        if environment != Vec3::ZERO {
            // what crosses the disk that the scene fills, from everywhere
            let power = 4.0 * PI.powi(2) * radius(flat).powi(2) * brightness(environment);
            let index =
                all.push(LightRecord { kind: Kind::Environment as u32, instance: INVALID, ..Default::default() }, power, None);
            lights.environment = Some(index).filter(|&k| k != INVALID);
        }
        let placed = all.bounds.len();
        if placed > MAX_BY_POWER && placed <= light_tree::MAX_LIGHTS {
            let (nodes, trails) = light_tree::build(&all.bounds);
            for (record, trail) in all.records.iter_mut().zip(trails) {
                record.trail = trail;
            }
            let power = all.powers[..placed].iter().sum();
            all.push(LightRecord { kind: Kind::Tree as u32, instance: INVALID, ..Default::default() }, power, None);
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

fn add_punctual(all: &mut Gathered, flat: &FlatScene, light: &Light) {
    let position = light.position - flat.origin;
    let brightness = brightness(light.intensity);
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
            all.push(
                LightRecord { kind: Kind::Point as u32, ..base },
                4.0 * PI * brightness,
                Some(place(DVec3::Z, PI, 0.5 * PI)),
            );
        }
        LightKind::Spot { inner_angle, outer_angle } => {
            let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
            // as if it fell off half-way between the two
            let solid = 2.0 * PI * (1.0 - 0.5 * f64::from(inner + outer));
            let record = LightRecord { kind: Kind::Spot as u32, cos_inner: inner, cos_outer: outer, ..base };
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
            let record = LightRecord { kind: Kind::Directional as u32, radius: one_minus_cos as f32, ..base };
            all.push(record, PI * radius(flat).powi(2) * brightness, None);
        }
    }
}

/// Every primitive whose material emits; returns [`Lights::light_of`]. A sphere that its instance stretches has no closed form: BSDF samples find it.
fn add_surfaces(all: &mut Gathered, flat: &FlatScene) -> Vec<u32> {
    let scene = flat.scene;
    let (mut light_of, mut of_primitives) = (vec![INVALID; scene.instances.len()], Vec::new());
    let alpha = alpha_classes(scene, flat.blend);
    let mut means = HashMap::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        // an unlit surface lights nothing: it only shows; what no ray meets does neither
        if material.emissive == Vec3::ZERO || material.unlit || alpha[instance.mesh] == AlphaClass::Absent {
            continue;
        }
        let to_world = instance.object_to_world;
        let base = LightRecord {
            intensity: material.emissive.to_array(),
            instance: i as u32,
            flags: if material.double_sided { LIGHT_TWO_SIDED } else { 0 },
            ..Default::default()
        };
        let mut mean = |texture: Option<usize>| *means.entry(texture).or_insert_with(|| mean_texture(flat, texture));
        let mut brightness =
            brightness(material.emissive * mean(material.emissive_texture.map(|slot| slot.texture)).truncate());
        let is_tested = alpha[instance.mesh] == AlphaClass::Tested;
        if is_tested {
            brightness *= mean_alpha(material, &mesh.geometry, mean(material.base_color_texture.map(|slot| slot.texture)).w);
        }
        let first = of_primitives.len();
        match &mesh.geometry {
            Geometry::Triangles(t) => {
                let flags = base.flags
                    | if to_world.matrix3.determinant() < 0.0 { LIGHT_MIRRORED } else { 0 }
                    | if is_tested { LIGHT_ALPHA } else { 0 };
                let plain = material.emissive_texture.is_none() && !is_tested;
                let point = |k: u32| to_world.transform_point3(t.positions[k as usize].as_dvec3()) - flat.origin;
                add_triangles(all, t, point, plain, brightness, LightRecord { flags, ..base }, &mut of_primitives);
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
                        kind: Kind::Sphere as u32,
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
                    of_primitives.push(all.push(record, 4.0 * PI.powi(2) * radius * radius * brightness, Some(bounds)));
                }
            }
        }
        light_of[i] = (scene.instances.len() + first) as u32;
    }
    if light_of.iter().all(|&first| first == INVALID) {
        return Vec::new();
    }
    light_of.extend(of_primitives);
    light_of
}

/// The triangles of a mesh: two neighbours that make a rectangle of one radiance (`plain`) are one light.
fn add_triangles(
    all: &mut Gathered,
    mesh: &TriangleMesh,
    point: impl Fn(u32) -> DVec3,
    plain: bool,
    brightness: f64,
    base: LightRecord,
    of_primitives: &mut Vec<u32>,
) {
    let both_ways = base.flags & LIGHT_TWO_SIDED != 0;
    // a transform that mirrors turns the winding
    let turn = if base.flags & LIGHT_MIRRORED != 0 { -1.0 } else { 1.0 };
    let mut push = |kind: Kind, [a, e1, e2]: [DVec3; 3], primitive: usize, slack: f64| {
        let normal = turn * e1.cross(e2);
        let area = if kind == Kind::Rectangle { 1.0 } else { 0.5 } * normal.length();
        let (b, c) = (a + e1, a + e2);
        let far = if kind == Kind::Rectangle { a + e1 + e2 } else { a };
        let extent = a.abs().max(b.abs()).max(c.abs()).max_element() + e1.abs().max(e2.abs()).max_element();
        // barycentrics follow the corners; a turned winding is a turned normal
        let record = LightRecord {
            kind: kind as u32,
            position: a.as_vec3().to_array(),
            axis: e1.as_vec3().to_array(),
            edge: e2.as_vec3().to_array(),
            primitive: primitive as u32,
            lift: (extent * LIFT + slack) as f32,
            ..base
        };
        let bounds = Bounds {
            lo: a.min(b).min(c).min(far),
            hi: a.max(b).max(c).max(far),
            axis: normal.normalize_or(DVec3::Z),
            spread: 0.0,
            falloff: 0.5 * PI,
            both_ways,
            intensity: area * brightness,
        };
        all.push(record, if both_ways { 2.0 } else { 1.0 } * PI * area * brightness, Some(bounds))
    };
    let mut k = 0;
    while k < mesh.indices.len() {
        let corners = mesh.indices[k].map(&point);
        let next = mesh.indices.get(k + 1).filter(|_| plain).map(|n| n.map(&point));
        if let Some((rectangle, slack)) = next.and_then(|next| rectangle(corners, next)) {
            let index = push(Kind::Rectangle, rectangle, k, slack);
            of_primitives.extend([index; 2]);
            k += 2;
            continue;
        }
        let [a, b, c] = corners;
        of_primitives.push(push(Kind::Triangle, [a, b - a, c - a], k, 0.0));
        k += 1;
    }
}

/// The rectangle that two triangles make, as a corner and two edges, and how far a corner is from where it should be; `None` where they make none.
fn rectangle(first: [DVec3; 3], second: [DVec3; 3]) -> Option<([DVec3; 3], f64)> {
    let extent = first.iter().chain(&second).fold(0.0f64, |e, p| e.max(p.abs().max_element()));
    // positions are rounded to single precision, of their own coordinates and of the instance's
    let slack = 2.0 * extent / 16_777_216.0;
    for k in 0..3 {
        let [a, b, c] = [first[k], first[(k + 1) % 3], first[(k + 2) % 3]];
        let (e1, e2) = (b - a, c - a);
        let shorter = e1.length().min(e2.length());
        if shorter.is_nan() || shorter <= 1e4 * slack || e1.dot(e2).abs() > 1e-5 * e1.length() * e2.length() {
            continue;
        }
        // the other has the diagonal, the other way round, and the fourth corner
        let d = a + e1 + e2;
        for j in 0..3 {
            let other = [second[j], second[(j + 1) % 3], second[(j + 2) % 3]];
            if other[0] == c && other[1] == b && (other[2] - d).length() <= slack {
                return Some(([a, e1, e2], slack));
            }
        }
    }
    None
}

/// Mean of the alpha of an emitter that is not everywhere: only its order of magnitude matters, for how often it is chosen.
fn mean_alpha(material: &Material, geometry: &Geometry, of_texture: f32) -> f64 {
    let of_vertices = match geometry {
        Geometry::Triangles(t) if !t.colors.is_empty() => t.colors.iter().map(|c| c.w).sum::<f32>() / t.colors.len() as f32,
        _ => 1.0,
    };
    let mean = material.base_color.w * of_texture * of_vertices;
    match material.alpha_mode {
        // of a mask it says too little: present texels may have any alpha above the cutoff
        AlphaMode::Mask { .. } => f64::from(mean.clamp(0.25, 1.0)),
        _ => f64::from(mean.clamp(1e-3, 1.0)),
    }
}

/// Share of its coordinates by which rounding may have moved a point of a light.
const LIFT: f64 = 8.0 / 16_777_216.0;

/// Of the ball that holds the scene.
fn radius(flat: &FlatScene) -> f64 {
    flat.scene.bounds().map_or(1.0, |(lo, hi)| 0.5 * (hi - lo).length()).max(1e-30)
}

/// Mean of a texture of sRGB colours, linear, and of its alpha.
fn mean_texture(flat: &FlatScene, texture: Option<usize>) -> Vec4 {
    let Some(texture) = texture else { return Vec4::ONE };
    let texels = &flat.scene.textures[texture].texels;
    let mut sum = DVec4::ZERO;
    for i in 0..texels.len() {
        sum += Vec4::from_array(texels.decode_srgb(i)).as_dvec4();
    }
    (sum / texels.len().max(1) as f64).as_vec4()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What matters of a light is how much it brings, in whichever channel.
    #[test]
    fn colours_count_alike() {
        let colours = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let counts = colours.map(brightness);
        assert!(counts[0] == counts[1] && counts[1] == counts[2] && (counts[3] - 1.0).abs() < 1e-12, "{counts:?}");
        assert_eq!(brightness(3.0 * Vec3::Z), 3.0 * counts[2]);
    }
}
