//! Settings of how a scene file is understood where its format leaves it open.

use super::Scene;
use super::material::{AlphaMode, Material, MaterialKind};
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
    }
}

impl SceneSettings {
    /// Applies them to a loaded scene, whatever was applied before. Returns true if that has
    /// changed it.
    pub fn apply(&self, scene: &mut Scene) -> bool {
        let meaning = self.mtl_dissolve.unwrap_or_default();
        let mut has_changed = false;
        for material in scene.materials.iter_mut().filter(|m| m.mtl_dissolve.is_some()) {
            let before = material.alpha_mode;
            meaning.apply_to(material);
            has_changed |= material.alpha_mode != before;
        }
        has_changed
    }
}
