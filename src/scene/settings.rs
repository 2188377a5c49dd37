//! Settings of how a scene file is understood where its format leaves it open.

use super::Scene;
use super::material::{AlphaMode, Material, MaterialKind};
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
        /// Variant of the materials, by its name or its number from 0, of files that have several [default: none]
        variant: Option<String>, option(value_name = "NAME|INDEX"), applies(AppliesTo::ALL);
    }
}

impl SceneSettings {
    /// Applies them to a loaded scene, whatever was applied before. Returns true if that has
    /// changed it.
    ///
    /// # Errors
    /// [`Error::Usage`] for a variant that the scene does not have; nothing is changed then.
    pub fn apply(&self, scene: &mut Scene) -> Result<bool> {
        let variant = self.variant.as_deref().map(|text| find_variant(&scene.variants, text)).transpose()?;
        let mut has_changed = false;

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
        Ok(has_changed)
    }
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
