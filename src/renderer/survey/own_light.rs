//! Whether the light of a scene itself shows what is in view.
//!
//! Surfaces that emit are no proof: a display or a small lamp leaves a view black that is meant to
//! be seen by other light. The direct light of surfaces in view is estimated, with a few samples of
//! all emitters a surface (Pharr, Jakob, Humphreys: Physically Based Rendering, 4th
//! edition, 13.4).

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::light::VIEW;
use super::rays::{clip, view_rays};
use super::{Survey, VisibleSurface};
use crate::error::Result;
use crate::sampling::sobol::{hash_combine, to_unit};
use crate::scene::material::TextureSlot;
use crate::scene::{Camera, Environment, Geometry, LightKind, Material, Scene, TexelData};

/// Samples of emitting surfaces for each surface in view.
const SAMPLES: usize = 8;
/// Placed and distant lights that are asked for each surface in view.
const MAX_LIGHTS: usize = 64;
/// Radiance that shows a surface, as a share of that under the light for scenes without any.
const ENOUGH: f64 = 0.03;
/// Share of surfaces in view that emitting ones must show. Others may have light by reflection.
const SHOWN: f64 = 0.25;
/// Surfaces that emit on more than this share of themselves are emitters, and not shown by them.
const MOST: f64 = 0.5;
/// Share of surfaces in view that a light must reach to be meant for the view, however weak it is.
const REACHED: f64 = 0.1;
/// Irradiance of surfaces under the light for scenes without any, about: pi times half of the
/// radiance of a white floor.
const DEFAULT: f64 = 0.45 * PI;

/// How much of a view the light of a scene itself shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnLight {
    /// The scene has no light.
    None,
    /// The view is all but black by it.
    LeavesBlack,
    /// It shows the view, or there is nothing in view.
    ShowsView,
}

/// Finds what the light of a scene itself shows of a camera's view.
///
/// # Errors
/// Those of the survey's rays.
pub fn in_view(survey: &Survey, camera: &Camera, aspect: f64) -> Result<OwnLight> {
    if survey.scene().is_dark() {
        return Ok(OwnLight::None);
    }
    Ok(if shows_view(survey, camera, aspect)? { OwnLight::ShowsView } else { OwnLight::LeavesBlack })
}

fn shows_view(survey: &Survey, camera: &Camera, aspect: f64) -> Result<bool> {
    let scene = survey.scene();
    // an environment shows its background at least; scenes that are too large are taken as they are
    if scene.environment != Environment::Black || !survey.is_small() {
        return Ok(true);
    }
    let views = view_rays(camera, aspect, VIEW);
    let mut seen = survey.trace(&views)?;
    clip(camera, &views, &mut seen);
    let place = |((from, direction), seen): (&(DVec3, DVec3), Option<VisibleSurface>)| {
        seen.map(|surface| (*from + *direction * surface.distance, surface))
    };
    let surfaces: Vec<(DVec3, VisibleSurface)> = views.iter().zip(seen).filter_map(place).collect();
    if surfaces.is_empty() {
        return Ok(true);
    }

    // lights that are meant for the view
    let lights: Vec<_> = scene.lights.iter().take(MAX_LIGHTS).collect();
    let by_lights =
        irradiance(survey, &surfaces, lights.len(), |_, i, (at, normal)| light_sample(lights[i as usize], at, normal))?;
    let reached = by_lights.iter().filter(|e| **e > 0.0).count() as f64;
    if reached >= REACHED * surfaces.len() as f64 {
        return Ok(true);
    }

    // surfaces that reflect enough, or emit in parts; those that emit all over are seen, and do not
    // show what is beside them
    let emission: Vec<Emission> = scene.materials.iter().map(|m| Emission::from_material(scene, m)).collect();
    let emitters = Emitters::new(scene, &emission);
    let by_surfaces = irradiance(survey, &surfaces, SAMPLES, |k, i, at| emitters.sample(at, hash_combine(k, i)))?;
    let (mut count, mut shown) = (0.0, 0.0);
    for (((_, surface), surfaces), lights) in surfaces.iter().zip(&by_surfaces).zip(&by_lights) {
        let bright = emission[surface.material].bright;
        if bright < MOST {
            let is_lit = surfaces / SAMPLES as f64 + lights >= ENOUGH * DEFAULT;
            count += 1.0;
            shown += if is_lit { 1.0 } else { bright };
        }
    }
    Ok(shown >= SHOWN * count)
}

/// Light that a material emits, or shows unlit.
struct Emission {
    /// Mean luminance.
    mean: f64,
    /// Share of its surface that is bright enough to be seen.
    bright: f64,
}

impl Emission {
    fn from_material(scene: &Scene, material: &Material) -> Self {
        let of = |factor: Vec3, texture: Option<TextureSlot>| {
            let factor = luminance(factor.as_dvec3());
            let texels = texture.filter(|_| factor > 0.0).map(|slot| &scene.textures[slot.texture].texels);
            let values = texels.map_or_else(|| vec![factor], |t| luminances(t).map(|l| factor * l).collect());
            let bright = values.iter().filter(|l| **l >= ENOUGH * DEFAULT / PI).count();
            let count = values.len().max(1) as f64;
            Self { mean: values.iter().sum::<f64>() / count, bright: bright as f64 / count }
        };
        let emissive = of(material.emissive, material.emissive_texture);
        let unlit = if material.unlit { material.base_color.truncate() } else { Vec3::ZERO };
        let unlit = of(unlit, material.base_color_texture);
        Self { mean: emissive.mean + unlit.mean, bright: emissive.bright.max(unlit.bright) }
    }
}

fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Luminance of some thousand texels of an sRGB texture.
fn luminances(texels: &TexelData) -> impl Iterator<Item = f64> + '_ {
    let step = texels.len().div_ceil(4096).max(1);
    (0..texels.len()).step_by(step).map(|i| {
        let [r, g, b, _] = texels.decode_srgb(i);
        luminance(DVec3::new(f64::from(r), f64::from(g), f64::from(b)))
    })
}

/// A direction to light, its distance, and the irradiance that it brings if nothing is in the way.
type LightSample = (DVec3, f64, f64);

/// Irradiance of surfaces: the sum over `count` samples of light each, of which a sampler makes the
/// `i`-th of the `k`-th surface from its place and normal.
fn irradiance(
    survey: &Survey,
    surfaces: &[(DVec3, VisibleSurface)],
    count: usize,
    sample: impl Fn(u32, u32, (DVec3, DVec3)) -> Option<LightSample>,
) -> Result<Vec<f64>> {
    let slack = 1e-6 * survey.diagonal();
    let (mut rays, mut samples) = (Vec::new(), Vec::new());
    for (k, (at, surface)) in surfaces.iter().enumerate() {
        for i in 0..count {
            if let Some((direction, distance, value)) = sample(k as u32, i as u32, (*at, surface.normal)) {
                rays.push((*at + surface.normal * slack, direction));
                samples.push((k, distance, value));
            }
        }
    }
    let mut sums = vec![0.0; surfaces.len()];
    for ((k, distance, value), hit) in samples.into_iter().zip(survey.trace(&rays)?) {
        // what is sampled is a surface itself
        if hit.is_none_or(|hit| hit.distance > distance * 0.999 - 2.0 * slack) {
            sums[k] += value;
        }
    }
    Ok(sums)
}

/// The irradiance of a light that no surface emits.
fn light_sample(light: &crate::scene::Light, at: DVec3, normal: DVec3) -> Option<LightSample> {
    let strength = luminance(light.intensity.as_dvec3());
    if matches!(light.kind, LightKind::Directional { .. }) {
        let cosine = normal.dot(-light.direction);
        return (cosine > 0.0).then_some((-light.direction, f64::INFINITY, strength * cosine));
    }
    let to_light = light.position - at;
    let distance = to_light.length();
    let direction = to_light / distance.max(1e-30);
    let cosine = normal.dot(direction);
    let limit = match light.kind {
        LightKind::Spot { outer_angle, .. } => f64::from(outer_angle).cos(),
        LightKind::Led { .. } => 0.0,
        _ => -1.0,
    };
    let is_lit = cosine > 0.0 && distance <= light.range && light.direction.dot(-direction) >= limit;
    is_lit.then(|| (direction, distance, strength * cosine / (distance * distance).max(1e-30)))
}

/// Triangles and spheres that emit, to be sampled by their power.
struct Emitters {
    shapes: Vec<Shape>,
    /// Sums of power over pi: luminance times area.
    sums: Vec<f64>,
}

enum Shape {
    /// A corner and two edges; whether its back emits as well.
    Triangle([DVec3; 3], bool),
    /// Centre and radius.
    Sphere(DVec3, f64),
}

impl Emitters {
    fn new(scene: &Scene, emission: &[Emission]) -> Self {
        let mut emitters = Self { shapes: Vec::new(), sums: Vec::new() };
        for instance in scene.shown_instances() {
            let mesh = &scene.meshes[instance.mesh];
            let luminance = emission[mesh.material].mean;
            if luminance <= 0.0 || scene.materials[mesh.material].unlit {
                continue;
            }
            let to_world = instance.object_to_world;
            let turned = to_world.matrix3.determinant().signum();
            match &mesh.geometry {
                Geometry::Triangles(t) => {
                    let double_sided = scene.materials[mesh.material].double_sided;
                    for corners in &t.indices {
                        let [a, b, c] = corners.map(|i| to_world.transform_point3(t.positions[i as usize].as_dvec3()));
                        let (e1, e2) = if turned < 0.0 { (c - a, b - a) } else { (b - a, c - a) };
                        let shape = Shape::Triangle([a, e1, e2], double_sided);
                        emitters.push(shape, luminance * 0.5 * e1.cross(e2).length());
                    }
                }
                Geometry::Spheres(spheres) => {
                    let scale = to_world.matrix3.determinant().abs().cbrt();
                    for sphere in spheres {
                        let (centre, radius) =
                            (to_world.transform_point3(sphere.center.as_dvec3()), scale * f64::from(sphere.radius));
                        let area = 4.0 * PI * radius * radius;
                        emitters.push(Shape::Sphere(centre, radius), luminance * area);
                    }
                }
            }
        }
        emitters
    }

    fn push(&mut self, shape: Shape, power: f64) {
        if power > 0.0 {
            self.sums.push(self.sums.last().unwrap_or(&0.0) + power);
            self.shapes.push(shape);
        }
    }

    /// A point of an emitter, chosen by power, and the irradiance it stands for.
    fn sample(&self, (at, normal): (DVec3, DVec3), seed: u32) -> Option<LightSample> {
        let total = *self.sums.last()?;
        let unit = |dimension: u32| f64::from(to_unit(hash_combine(seed, dimension)));
        let chosen = self.sums.partition_point(|sum| *sum <= unit(0) * total).min(self.shapes.len() - 1);
        let (u, v) = (unit(1), unit(2));
        let (point, outwards, both) = match self.shapes[chosen] {
            Shape::Triangle([a, e1, e2], both) => {
                let s = u.sqrt();
                (a + e1 * (1.0 - s) + e2 * (s * v), e1.cross(e2).normalize_or_zero(), both)
            }
            Shape::Sphere(centre, radius) => {
                let (z, angle) = (1.0 - 2.0 * u, std::f64::consts::TAU * v);
                let (sin, cos) = angle.sin_cos();
                let direction = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
                (centre + direction * radius, direction, false)
            }
        };
        let to_light = point - at;
        let distance = to_light.length();
        let direction = to_light / distance.max(1e-30);
        let facing = if both { outwards.dot(direction).abs() } else { -outwards.dot(direction) };
        let cosine = normal.dot(direction);
        // a point of the emitter itself has no distance
        let reach = (distance * distance).max(1e-30);
        (cosine > 0.0 && facing > 0.0).then(|| (direction, distance, total * cosine * facing / reach))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Light;
    use crate::scene::builtin::by_name;

    fn shows(scene: &Scene) -> bool {
        shows_view(&Survey::new(scene), &scene.cameras[0], 1.5).unwrap()
    }

    #[test]
    fn lamps_of_rooms_show_them() {
        for name in ["cornell-box", "cornell-spheres", "pendulum"] {
            assert!(shows(&by_name(name).unwrap()), "{name}");
        }
        assert!(!shows(&by_name("stairs").unwrap()), "nothing emits");
    }

    #[test]
    fn small_emitters_leave_a_view_black() {
        let mut scene = by_name("cornell-box").unwrap();
        for material in scene.materials.iter_mut() {
            material.emissive *= 1e-4;
        }
        assert!(!shows(&scene));
        // what is bright, and seen, does not show the rest
        let mut dot = by_name("stairs").unwrap();
        let camera = dot.cameras[0].camera_to_world;
        let at = camera.translation - camera.matrix3.z_axis;
        let mut material = dot.materials[0].clone();
        (material.emissive, material.double_sided) = (glam::Vec3::splat(50.0), false);
        dot.materials.push(material);
        let sphere = crate::scene::Sphere { center: at.as_vec3(), radius: 1e-3 };
        let mesh = crate::scene::Mesh {
            name: String::new(),
            geometry: Geometry::Spheres(vec![sphere]),
            material: dot.materials.len() - 1,
            source: None,
        };
        dot.meshes.push(mesh);
        let mesh = dot.meshes.len() - 1;
        let object_to_world = glam::DAffine3::IDENTITY;
        dot.instances.push(crate::scene::Instance { name: String::new(), mesh, object_to_world });
        assert!(!dot.is_dark() && !shows(&dot));
    }

    #[test]
    fn lights_count_if_they_reach_the_view() {
        let mut scene = by_name("stairs").unwrap();
        let camera = scene.cameras[0].camera_to_world;
        let mut light = Light {
            name: String::new(),
            kind: LightKind::Point,
            intensity: glam::Vec3::splat(1e-3),
            position: camera.translation,
            direction: DVec3::NEG_Y,
            range: f64::INFINITY,
        };
        scene.lights.push(light.clone());
        assert!(shows(&scene), "weak light is a matter of exposure");
        light.position = DVec3::new(0.0, -100.0, 0.0);
        scene.lights[0] = light;
        assert!(!shows(&scene), "from below the floor");
    }
}
