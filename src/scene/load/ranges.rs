//! Ranges of the numbers of materials, lights and vertex colours, whatever format they come from:
//! one table. What lies outside becomes the nearest value that is possible, and a warning says so;
//! what is no number becomes the default. Negative light and reflection beyond 1 would go through
//! every image that shows them.
//!
//! Ranges are those of glTF 2.0 and its extensions:
//! <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#reference-material>. Emission has no
//! upper bound there.

use crate::scene::material::{AlphaMode, Material, MaterialKind};
use crate::scene::{Geometry, Scene};

/// Distance from its range at which a number counts as rounded: nothing is said of it.
const ROUNDING: f32 = 1e-3;

/// The least and the largest value.
type Range = (f32, f32);

const SHARE: Range = (0.0, 1.0);
const AMOUNT: Range = (0.0, f32::MAX);
const ANY: Range = (f32::MIN, f32::MAX);
const COSINE: Range = (-1.0, 1.0);
const REFRACTION: Range = (1.0, f32::MAX);

/// The numbers of a material: what they are called, their range, and where they are.
#[rustfmt::skip]
fn numbers(m: &mut Material) -> Vec<(&'static str, Range, &mut [f32])> {
    // what every material has
    let single = std::slice::from_mut::<f32>;
    let [r, g, b, alpha] = m.base_color.as_mut();
    let mut all: Vec<(&'static str, Range, &mut [f32])> = vec![
        ("a base colour", SHARE, single(r)),
        ("a base colour", SHARE, single(g)),
        ("a base colour", SHARE, single(b)),
        ("an alpha", SHARE, single(alpha)),
        ("a metalness", SHARE, single(&mut m.metallic)),
        ("a roughness", SHARE, single(&mut m.roughness)),
        ("a scale of its normal map", ANY, single(&mut m.normal_scale)),
        ("an occlusion strength", SHARE, single(&mut m.occlusion_strength)),
        ("an emission", AMOUNT, m.emissive.as_mut()),
        ("a specular colour", SHARE, m.specular_color.as_mut()),
        ("a transmitted colour", SHARE, m.transmittance.as_mut()),
        ("a clearcoat", SHARE, single(&mut m.clearcoat.factor)),
        ("a clearcoat roughness", SHARE, single(&mut m.clearcoat.roughness)),
        ("a scale of its clearcoat's normal map", ANY, single(&mut m.clearcoat.normal_scale)),
        ("a sheen colour", SHARE, m.sheen.color.as_mut()),
        ("a sheen roughness", SHARE, single(&mut m.sheen.roughness)),
        ("a transmission", SHARE, single(&mut m.transmission.factor)),
        ("a thickness", AMOUNT, single(&mut m.transmission.thickness)),
        ("an attenuation colour", SHARE, m.transmission.attenuation_color.as_mut()),
        ("a specular factor", SHARE, single(&mut m.specular.factor)),
        // it may raise the reflectance of a low index of refraction to 1
        ("a specular colour factor", AMOUNT, m.specular.color.as_mut()),
        ("an anisotropy", SHARE, single(&mut m.anisotropy.strength)),
        ("an anisotropy rotation", ANY, single(&mut m.anisotropy.rotation)),
        ("an iridescence", SHARE, single(&mut m.iridescence.factor)),
        ("an index of refraction of a thin film", REFRACTION, single(&mut m.iridescence.ior)),
        ("a thickness of a thin film", AMOUNT, m.iridescence.thickness.as_mut_slice()),
        ("a diffuse transmission", SHARE, single(&mut m.diffuse_transmission.factor)),
        ("a colour of diffuse transmission", SHARE, m.diffuse_transmission.color.as_mut()),
        ("a retroreflection", SHARE, single(&mut m.retroreflection.factor)),
        ("a colour of volume scattering", SHARE, m.volume_scatter.color.as_mut()),
        ("an anisotropy of volume scattering", COSINE, single(&mut m.volume_scatter.anisotropy)),
        ("a dispersion", AMOUNT, single(&mut m.dispersion)),
    ];

    // what has a range of its own, or is not always there; 0 is glTF's word for a Fresnel term of 1
    if m.ior != 0.0 || m.kind != MaterialKind::MetallicRoughness {
        all.push(("an index of refraction", REFRACTION, single(&mut m.ior)));
    }
    if let AlphaMode::Mask { cutoff } = &mut m.alpha_mode {
        all.push(("an alpha cutoff", AMOUNT, single(cutoff)));
    }
    all.extend(m.mtl_dissolve.as_mut().map(|d| ("a `d`", SHARE, single(d))));
    all.extend(m.parameters.iter_mut().map(|(_, value)| ("an extra", ANY, single(value))));
    all
}

/// Brings the numbers of materials, lights and vertex colours into their ranges.
pub(super) fn apply(scene: &mut Scene) {
    let mut warnings = Vec::new();

    // an infinite distance attenuates nothing
    for transmission in scene.materials.iter_mut().map(|m| &mut m.transmission) {
        if transmission.attenuation_distance.is_nan() || transmission.attenuation_distance <= 0.0 {
            transmission.attenuation_distance = f32::INFINITY;
        }
    }

    // numbers of materials, each with the default that stands in for it
    for material in &mut scene.materials {
        let name = material.name.clone();
        let mut defaults = Material { kind: material.kind, ..Material::default() };
        // as many numbers
        if matches!(material.alpha_mode, AlphaMode::Mask { .. }) {
            defaults.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        }
        defaults.mtl_dissolve = material.mtl_dissolve.map(|_| 1.0);
        defaults.parameters = material.parameters.keys().map(|name| (name.clone(), 0.0)).collect();
        // what may be 0 in one is so in both
        if material.ior == 0.0 {
            defaults.ior = 0.0;
        }
        for ((what, range, values), (_, _, fallback)) in numbers(material).into_iter().zip(numbers(&mut defaults)) {
            if let Some(text) = bring_into(range, values, fallback) {
                warnings.push(format!("material `{name}` has {what} of {text}"));
            }
        }
    }

    // lights and colours of vertices
    for light in &mut scene.lights {
        if let Some(text) = bring_into(AMOUNT, light.intensity.as_mut(), &[0.0; 3]) {
            warnings.push(format!("light `{}` has an intensity of {text}", light.name));
        }
    }
    for mesh in &mut scene.meshes {
        let Geometry::Triangles(triangles) = &mut mesh.geometry else { continue };
        let is_outside = |c: &&mut glam::Vec4| c.min_element() < 0.0 || c.max_element() > 1.0;
        let mut count = 0;
        for color in triangles.colors.iter_mut().filter(is_outside) {
            count += usize::from(color.min_element() < -ROUNDING || color.max_element() > 1.0 + ROUNDING);
            *color = color.clamp(glam::Vec4::ZERO, glam::Vec4::ONE);
        }
        if count > 0 {
            warnings.push(format!(
                "mesh `{}`: {count} colours of vertices lie outside of 0 to 1: the nearest ones instead",
                mesh.name
            ));
        }
    }
    scene.report.warnings.extend(warnings);
}

/// Brings values into their range, and says so of the first that was not there.
fn bring_into((least, most): Range, values: &mut [f32], fallback: &[f32]) -> Option<String> {
    let mut said = None;
    for (value, fallback) in values.iter_mut().zip(fallback) {
        let before = *value;
        let (after, why) = match before {
            _ if before.is_nan() => (*fallback, "is no number".to_owned()),
            _ if before < least => (least, format!("is below {least}")),
            _ if before > most && most < f32::MAX => (most, format!("is above {most}")),
            _ if before > most => (most, "is too large".to_owned()),
            _ => continue,
        };
        *value = after;
        // NaN is not
        let is_rounding = (before - after).abs() <= ROUNDING;
        if !is_rounding {
            said.get_or_insert(format!("{before}, which {why}: {after} instead"));
        }
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A material all of whose numbers are this one.
    fn material(value: f32) -> Material {
        let mut m =
            Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, mtl_dissolve: Some(1.0), ..Material::default() };
        m.parameters.insert("sigma".into(), 0.5);
        numbers(&mut m).into_iter().for_each(|(_, _, values)| values.fill(value));
        m.ior = value;
        m
    }

    #[test]
    fn all_numbers_have_ranges() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MIN, f32::MAX, 1e25, -1e-30] {
            let mut scene = Scene { materials: vec![material(value)], ..Scene::default() };
            apply(&mut scene);
            for (what, (least, most), values) in numbers(&mut scene.materials[0]) {
                assert!(values.iter().all(|v| (least..=most).contains(v)), "{value}: {what}: {values:?}");
            }
            // an index of refraction is not close to its range
            assert!(!scene.report.warnings.is_empty(), "{value}");
        }
    }

    #[test]
    fn what_is_possible_stays() {
        for mut m in [Material::default(), Material { ior: 0.0, ..Material::default() }] {
            (m.emissive, m.normal_scale, m.metallic) = (glam::Vec3::splat(1e30), -2.0, 1.0);
            m.transmission.attenuation_distance = 3.0;
            let mut scene = Scene { materials: vec![m.clone()], ..Scene::default() };
            apply(&mut scene);
            assert!(scene.materials[0] == m && scene.report.warnings.is_empty());
        }
    }

    #[test]
    fn rounding_is_not_worth_a_word() {
        let mut values = [1.000_000_1, 0.5, -1e-9];
        assert_eq!(bring_into(SHARE, &mut values, &[0.0; 3]), None);
        assert_eq!(values, [1.0, 0.5, 0.0]);
        let mut values = [2.0, 3.0];
        assert_eq!(bring_into(SHARE, &mut values, &[0.0; 2]).unwrap(), "2, which is above 1: 1 instead");
    }
}
