//! Values of materials in place of the file's, in a line of text:
//! `Red plastic base_color=0.8,0.1,0.1 roughness=0.3`.

use glam::Vec3;

use super::lights::keys;
use super::material::{Material, MaterialKind};
use crate::settings::parse::{parse_number, parse_vector};

/// Keys of the values, for messages.
const KEYS: &str = "base_color, metallic, roughness, emission, transmission";

/// Values that replace those of a material. Textures multiply them, as they do the file's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialEdit {
    /// Name of the material, or its index; all that have the name are meant.
    pub material: String,
    /// Linear base colour, each from 0 to 1.
    pub base_color: Option<Vec3>,
    /// 0 to 1.
    pub metallic: Option<f32>,
    /// Perceptual roughness, 0 to 1.
    pub roughness: Option<f32>,
    /// Linear emitted radiance, 0 or above.
    pub emission: Option<Vec3>,
    /// Share of light that is transmitted, 0 to 1.
    pub transmission: Option<f32>,
}

/// Reads an edit: the material, then key=value.
///
/// # Errors
/// What is wrong with it, in a line.
pub fn parse(text: &str) -> Result<MaterialEdit, String> {
    // names may have spaces: the values are the words at the end that are key=value
    let is_value = |word: &str| word.split_once('=').is_some_and(|(key, _)| KEYS.split(", ").any(|k| k == key));
    let words: Vec<&str> = text.split(' ').filter(|word| !word.is_empty()).collect();
    let names = words.len() - words.iter().rev().take_while(|word| is_value(word)).count();
    let (name, values) = words.split_at(names);
    if name.is_empty() || values.is_empty() {
        return Err(format!("expected a material's name or number, then key=value of {KEYS}"));
    }

    // each value in its range
    let mut edit = MaterialEdit { material: name.join(" "), ..MaterialEdit::default() };
    for (key, value) in values.iter().filter_map(|word| word.split_once('=')) {
        let wrong = |e: String| format!("{key}={value}: {e}");
        let share = || share(value).map_err(wrong);
        match key {
            "base_color" => edit.base_color = Some(shares(value).map_err(wrong)?),
            "metallic" => edit.metallic = Some(share()?),
            "roughness" => edit.roughness = Some(share()?),
            "transmission" => edit.transmission = Some(share()?),
            _ => edit.emission = Some(keys::colour(value).map_err(wrong)?),
        }
    }
    Ok(edit)
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f32, String> {
    let value = parse_number(text)?;
    if (0.0..=1.0).contains(&value) { Ok(value as f32) } else { Err("must be from 0 to 1".into()) }
}

/// A colour whose parts are from 0 to 1.
fn shares(text: &str) -> Result<Vec3, String> {
    let colour = parse_vector(text)?.as_vec3();
    let is_share = colour.min_element() >= 0.0 && colour.max_element() <= 1.0;
    if is_share { Ok(colour) } else { Err("each must be from 0 to 1".into()) }
}

impl std::fmt::Display for MaterialEdit {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.material)?;
        let colour = |c: Vec3| format!("{},{},{}", c.x, c.y, c.z);
        for (key, value) in [
            ("base_color", self.base_color.map(colour)),
            ("metallic", self.metallic.map(|v| v.to_string())),
            ("roughness", self.roughness.map(|v| v.to_string())),
            ("emission", self.emission.map(colour)),
            ("transmission", self.transmission.map(|v| v.to_string())),
        ] {
            if let Some(value) = value {
                write!(f, " {key}={value}")?;
            }
        }
        Ok(())
    }
}

impl serde::Serialize for MaterialEdit {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for MaterialEdit {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        parse(&text).map_err(serde::de::Error::custom)
    }
}

impl MaterialEdit {
    /// Returns true if it replaces nothing.
    pub fn is_empty(&self) -> bool {
        *self == Self { material: self.material.clone(), ..Self::default() }
    }

    /// Gives a material these values. A mirror, glass, metal or matte surface of another format
    /// becomes one of glTF's model first, if it is given a value that only those have.
    pub fn apply_to(&self, material: &mut Material) {
        if self.metallic.is_some() || self.roughness.is_some() || self.transmission.is_some() {
            become_gltf(material);
        }
        if let Some(colour) = self.base_color {
            material.base_color = colour.extend(material.base_color.w);
        }
        material.metallic = self.metallic.unwrap_or(material.metallic);
        material.roughness = self.roughness.unwrap_or(material.roughness);
        material.emissive = self.emission.unwrap_or(material.emissive);
        material.transmission.factor = self.transmission.unwrap_or(material.transmission.factor);
    }
}

/// Turns a material of another model into the nearest of glTF's.
fn become_gltf(material: &mut Material) {
    let values = match material.kind {
        MaterialKind::MetallicRoughness => return,
        MaterialKind::Matte => [0.0, 1.0, 0.0],
        MaterialKind::Mirror | MaterialKind::Copper | MaterialKind::Gold => [1.0, material.roughness, 0.0],
        MaterialKind::Glass => [0.0, 0.0, 1.0],
    };
    [material.metallic, material.roughness, material.transmission.factor] = values;
    material.kind = MaterialKind::MetallicRoughness;
    material.parameters.remove("sigma");
}

/// The edits of a scene, and what they have replaced.
#[derive(Clone, Debug, Default)]
pub struct EditedScene {
    /// Edits in effect.
    pub(super) materials: Vec<MaterialEdit>,
    /// Objects that are left out, and those that alone are not.
    pub(super) objects: [Vec<String>; 2],
    /// The materials before, by index, and the instances that were hidden then.
    pub(super) originals: Vec<(usize, Material)>,
    pub(super) hidden: std::collections::BTreeSet<usize>,
}

impl EditedScene {
    /// Edits of materials in effect.
    pub fn materials(&self) -> &[MaterialEdit] {
        &self.materials
    }

    /// Indices of the materials that they change.
    pub fn edited(&self) -> impl Iterator<Item = usize> {
        self.originals.iter().map(|(k, _)| *k)
    }
}

/// Indices of all that have this name or, where none is called that, this number.
pub(super) fn named<'a>(names: impl Iterator<Item = &'a str> + Clone, text: &str) -> Vec<usize> {
    let all: Vec<usize> = names.clone().enumerate().filter(|(_, name)| *name == text).map(|(k, _)| k).collect();
    let number = || text.parse().ok().filter(|n| *n < names.count());
    if all.is_empty() { number().into_iter().collect() } else { all }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_read_as_they_are_written() {
        let text = "Red plastic base_color=0.8,0.1,0.1 roughness=0.3 emission=2,0,0";
        let edit = parse(text).unwrap();
        assert_eq!((edit.material.as_str(), edit.roughness, edit.metallic), ("Red plastic", Some(0.3), None));
        assert_eq!(edit.to_string(), text);
        assert_eq!(parse("3 a=b metallic=1").unwrap().material, "3 a=b", "names are not looked into");
        for (text, part) in [
            ("roughness=1", "expected a material's name"),
            ("Red", "key=value"),
            ("Red roughness=1.5", "roughness=1.5: must be from 0 to 1"),
            ("Red base_color=1,2,0", "base_color=1,2,0"),
            ("Red emission=-1,0,0", "not negative"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn other_models_become_gltf_when_they_have_to() {
        let glass = Material { kind: MaterialKind::Glass, ..Material::default() };
        let edited = |text: &str| {
            let mut material = glass.clone();
            parse(text).unwrap().apply_to(&mut material);
            material
        };
        assert_eq!(edited("0 base_color=1,0,0").kind, MaterialKind::Glass);
        let rough = edited("0 roughness=0.25");
        assert_eq!((rough.kind, rough.roughness), (MaterialKind::MetallicRoughness, 0.25));
        assert_eq!((rough.metallic, rough.transmission.factor), (0.0, 1.0));
    }
}
