//! `KHR_materials_variants`: other materials of primitives, by the name of a variant.
//!
//! A primitive that has some gets a material of its own in the scene, which says what replaces it
//! ([`crate::scene::material::VariantMaterials`]): a setting chooses the variant after loading.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_materials_variants>

use ::gltf::json::Root;
use ::gltf::json::mesh::Primitive;
use serde::Deserialize;

use super::material::UnmodelledExtension;
use crate::scene::material::VariantMaterials;

#[derive(Deserialize, Default)]
#[serde(default)]
struct VariantNames {
    variants: Vec<VariantName>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct VariantName {
    name: String,
}

impl UnmodelledExtension for VariantNames {
    const NAME: &str = "KHR_materials_variants";
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Mappings {
    mappings: Vec<Mapping>,
}

#[derive(Deserialize)]
struct Mapping {
    material: usize,
    variants: Vec<usize>,
}

impl UnmodelledExtension for Mappings {
    const NAME: &str = "KHR_materials_variants";
}

/// Names of the variants of a document.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn names(document: &Root) -> Result<Vec<String>, String> {
    let names = VariantNames::from_extensions(document.extensions.as_ref().map(|e| &e.others))?;
    Ok(names.variants.into_iter().map(|v| v.name).collect())
}

/// Materials of a primitive by variants; `None` if it has none. `base`: its material without a
/// variant; `variants`, `materials`: how many the document has.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn materials(
    primitive: &Primitive,
    base: usize,
    variants: usize,
    materials: usize,
) -> Result<Option<VariantMaterials>, String> {
    let mappings = Mappings::from_extensions(primitive.extensions.as_ref().map(|e| &e.others))?.mappings;
    let mut replacements = Vec::new();
    for Mapping { material, variants: of } in mappings {
        if material >= materials {
            return Err(format!("{}: material {material} does not exist", Mappings::NAME));
        }
        if let Some(variant) = of.iter().find(|v| **v >= variants) {
            return Err(format!("{}: variant {variant} does not exist", Mappings::NAME));
        }
        replacements.extend(of.into_iter().map(|variant| (variant, material)));
    }
    Ok((!replacements.is_empty()).then_some(VariantMaterials { base, replacements }))
}
