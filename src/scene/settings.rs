//! Settings of how a scene file is understood where its format leaves it open.

use std::collections::BTreeSet;

use super::Scene;
use super::material::{AlphaMode, Material, MaterialKind};
use super::material_edit::{self, EditedScene, MaterialEdit};
use super::nodes::find_instances;
use crate::error::{Error, Result};
use crate::settings::{AppliesTo, choices, settings};

choices! {
    /// What `d` below 1 means in a material of an .obj.
    pub enum MtlDissolve {
        /// Coverage, as the format says: blended with what is behind
        Alpha = "alpha",
        /// Glass, as some exporters write it: smooth, refracts by Ni
        Glass = "glass",
    }
}

impl MtlDissolve {
    /// Gives the material the meaning of its `d`, if it has one.
    pub(super) fn apply_to(self, material: &mut Material) {
        let Some(dissolve) = material.mtl_dissolve else { return };
        let (kind, alpha, mode, transmission) = match self {
            Self::Alpha => (MaterialKind::MetallicRoughness, dissolve, AlphaMode::Blend, 0.0),
            Self::Glass => (MaterialKind::Glass, 1.0, AlphaMode::Opaque, 1.0),
        };
        (material.kind, material.alpha_mode, material.base_color.w) = (kind, mode, alpha);
        material.transmission.factor = transmission;
    }
}

settings! {
    /// Meaning of scene files.
    "Scene"
    pub struct SceneSettings {
        /// What `d` below 1 means in an .mtl file without anything else that says glass [default: alpha]
        mtl_dissolve: Option<MtlDissolve>, option(value_enum), applies(AppliesTo::ALL);
        /// Variant of the materials, by its name or its number from 0 [default: none]
        variant: Option<String>, option(value_name = "NAME|INDEX"), applies(AppliesTo::ALL);
        /// Replace values of a material, like "Red plastic roughness=0.3 metallic=1"; may be
        /// repeated
        ///
        /// The material is given by its name or its number from 0.
        ///
        /// Keys: base_color=R,G,B (linear, 0 to 1), metallic, roughness, transmission (0 to 1) and
        /// emission=R,G,B (linear radiance). Textures multiply them, as they do the file's values.
        material: Vec<MaterialEdit>,
            option(value_name = "NAME|INDEX KEY=VALUE...", value_parser = material_edit::parse), applies(AppliesTo::ALL);
        /// Leave out an object, or a node with all that is below it; may be repeated
        ///
        /// Objects are instances of meshes: they are given by a name, a number from 0, or a range
        /// of numbers, A..B, from A up to B without B. Nodes, such as the groups of an .obj, are
        /// given by a name. Lights stay.
        hide: Vec<String>, option(value_name = "NAME|INDEX|A..B"), applies(AppliesTo::ALL);
        /// Leave out all objects but this one, or all but those below a node; may be repeated
        ///
        /// Names, numbers and ranges are those that --hide takes.
        only: Vec<String>, option(value_name = "NAME|INDEX|A..B"), applies(AppliesTo::ALL);
    }
}

impl SceneSettings {
    /// Applies them to a loaded scene, whatever was applied before. Returns true if that has
    /// changed it.
    ///
    /// # Errors
    /// [`Error::Usage`] for a variant, a material or an object that the scene does not have; then
    /// nothing is changed.
    pub fn apply(&self, scene: &mut Scene) -> Result<bool> {
        let variant = self.variant.as_deref().map(|text| find_variant(&scene.variants, text)).transpose()?;
        let hidden = self.hidden(scene)?;
        let mut has_changed = restore(scene, self);

        // what `d` means
        let meaning = self.mtl_dissolve.unwrap_or_default();
        for material in scene.materials.iter_mut().filter(|m| m.mtl_dissolve.is_some()) {
            let before = material.alpha_mode;
            meaning.apply_to(material);
            has_changed |= material.alpha_mode != before;
        }

        // the variant
        for i in 0..scene.materials.len() {
            let Some(variants) = scene.materials[i].variants.clone() else { continue };
            let copied = scene.materials[variants.material(variant)].clone();
            let copy = Material { variants: Some(variants), ..copied };
            has_changed |= scene.materials[i] != copy;
            scene.materials[i] = copy;
        }
        if let Some(rig) = &mut scene.rig {
            rig.set_variant(variant);
        }

        // values of materials, and objects that are left out
        if self.edits() {
            let changed = scene.edited_materials(&self.material);
            let originals = changed.iter().map(|(k, _)| (*k, scene.materials[*k].clone())).collect();
            let objects = [self.hide.clone(), self.only.clone()];
            let before = scene.hidden.clone();
            let materials = self.material.clone();
            scene.edited = Some(Box::new(EditedScene { materials, objects, originals, hidden: before }));
            changed.into_iter().for_each(|(k, material)| scene.materials[k] = material);
            scene.hidden.extend(hidden);
        }
        Ok(has_changed)
    }

    /// The instances that are to be left out, if the scene has them and the materials.
    fn hidden(&self, scene: &Scene) -> Result<Vec<usize>> {
        let materials = || scene.materials.iter().map(|m| m.name.as_str());
        let instances = || scene.instances.iter().map(|i| i.name.as_str());
        let none = |option: &str, text: &str, what: &str, names: &mut dyn Iterator<Item = &str>, count: usize| {
            const MOST: usize = 8;
            let mut shown: Vec<&str> = Vec::new();
            for name in names {
                if shown.len() < MOST && !name.is_empty() && !shown.contains(&name) {
                    shown.push(name);
                }
            }
            let named = if shown.is_empty() { String::new() } else { format!(", such as {}", shown.join(", ")) };
            Err(Error::Usage(format!("{option} {text}: the scene has no such {what}, but {count}{named}")))
        };
        for edit in &self.material {
            if material_edit::named(materials(), &edit.material).is_empty() {
                return none("--material", &edit.material, "material", &mut materials(), scene.materials.len());
            }
        }
        let mut found = [Vec::new(), Vec::new()];
        for ((option, texts), found) in [("--hide", &self.hide), ("--only", &self.only)].into_iter().zip(&mut found) {
            for (text, ranges) in texts.iter().zip(find_instances(instances(), &scene.nodes, texts)) {
                if ranges.is_empty() {
                    let mut names = scene.nodes.iter().map(|node| &*node.name).chain(instances());
                    let count = scene.nodes.len() + scene.instances.len();
                    return none(option, text, "object or node", &mut names, count);
                }
                found.extend(ranges.into_iter().flatten());
            }
        }
        let [mut hidden, only] = found;
        let only: BTreeSet<usize> = only.into_iter().collect();
        if !only.is_empty() {
            hidden.extend((0..scene.instances.len()).filter(|k| !only.contains(k)));
        }
        Ok(hidden)
    }

    /// Whether they change materials or leave objects out.
    fn edits(&self) -> bool {
        !self.material.is_empty() || !self.hide.is_empty() || !self.only.is_empty()
    }
}

impl Scene {
    /// The materials that edits change, by index, with all of their values. An edit of a material
    /// that the scene does not have changes nothing. Edits that are in effect do not count.
    pub fn edited_materials(&self, edits: &[MaterialEdit]) -> Vec<(usize, Material)> {
        let mut changed: Vec<(usize, Material)> = Vec::new();
        for edit in edits {
            for k in material_edit::named(self.materials.iter().map(|m| m.name.as_str()), &edit.material) {
                let at = changed.iter().position(|(at, _)| *at == k).unwrap_or_else(|| {
                    changed.push((k, self.unedited_material(k).clone()));
                    changed.len() - 1
                });
                edit.apply_to(&mut changed[at].1);
            }
        }
        changed
    }

    /// The instances that settings leave out, beside those that the file hides.
    pub fn left_out(&self) -> BTreeSet<usize> {
        let edited = self.edited.iter().flat_map(|e| self.hidden.difference(&e.hidden));
        edited.copied().collect()
    }

    /// A material as it is without edits.
    pub fn unedited_material(&self, index: usize) -> &Material {
        let original = self.edited.as_ref().and_then(|e| e.originals.iter().find(|(k, _)| *k == index));
        original.map_or(&self.materials[index], |(_, material)| material)
    }
}

/// Takes back what settings have replaced. Returns true if these replace something else.
fn restore(scene: &mut Scene, by: &SceneSettings) -> bool {
    let Some(edited) = scene.edited.take() else { return by.edits() };
    for (k, material) in edited.originals {
        scene.materials[k] = material;
    }
    scene.hidden = edited.hidden;
    edited.materials != by.material || edited.objects[0] != by.hide || edited.objects[1] != by.only
}

/// Index of a variant by its name or, where none is called that, its number.
pub fn variant_index(names: &[String], text: &str) -> Option<usize> {
    let number = || text.parse().ok().filter(|n| *n < names.len());
    names.iter().position(|name| name == text).or_else(number)
}

/// [`variant_index`], or an error that names the variants.
fn find_variant(names: &[String], text: &str) -> Result<usize> {
    variant_index(names, text).ok_or_else(|| {
        Error::Usage(if names.is_empty() {
            format!("--variant {text}: the scene has no variants")
        } else {
            format!("--variant {text}: the scene has no such variant, but {}", names.join(", "))
        })
    })
}
