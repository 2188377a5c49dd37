//! `KHR_animation_pointer`: animation channels whose target is a JSON pointer.
//!
//! Which properties there are is the glTF 2.0 Asset Object Model; those of nodes are read as
//! channels without a pointer are.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_animation_pointer>

use ::gltf::json::Root;
use ::gltf::json::material::Material as MaterialJson;
use glam::{Vec2, Vec3};
use serde_json::Value;

use crate::scene::animation::{
    AnimatedMaterial, CameraProperty, LightProperty, MaterialProperty as Number, SLOTS, TextureTransform,
};

/// The property that a pointer names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pointer<'p> {
    /// A node, and the path of a channel that targets it without a pointer.
    Node(usize, &'p str),
    /// Whether a node is visible.
    Visibility(usize),
    /// A property of a material.
    Material(usize, Number),
    /// A property of a punctual light.
    Light(usize, LightProperty),
    /// A property of a camera.
    Camera(usize, CameraProperty),
    /// A property of a camera that changes the shape of the image, which stays as it is.
    Nothing,
}

/// The textures of a material below it, in the order of
/// [`crate::scene::Material::texture_slots_mut`].
const TEXTURES: [&str; SLOTS] = [
    "pbrMetallicRoughness/baseColorTexture",
    "pbrMetallicRoughness/metallicRoughnessTexture",
    "normalTexture",
    "occlusionTexture",
    "emissiveTexture",
    "extensions/KHR_materials_clearcoat/clearcoatTexture",
    "extensions/KHR_materials_clearcoat/clearcoatRoughnessTexture",
    "extensions/KHR_materials_clearcoat/clearcoatNormalTexture",
    "extensions/KHR_materials_sheen/sheenColorTexture",
    "extensions/KHR_materials_sheen/sheenRoughnessTexture",
    "extensions/KHR_materials_transmission/transmissionTexture",
    "extensions/KHR_materials_volume/thicknessTexture",
    "extensions/KHR_materials_specular/specularTexture",
    "extensions/KHR_materials_specular/specularColorTexture",
    "extensions/KHR_materials_anisotropy/anisotropyTexture",
    "extensions/KHR_materials_iridescence/iridescenceTexture",
    "extensions/KHR_materials_iridescence/iridescenceThicknessTexture",
    "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionTexture",
    "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorTexture",
];

const TRANSFORM: &str = "/extensions/KHR_texture_transform";

impl<'p> Pointer<'p> {
    /// Reads a pointer; `None` for one that names nothing that skylit animates.
    pub fn parse(pointer: &'p str) -> Option<Self> {
        let (collection, rest) = ["/nodes/", "/materials/", "/cameras/", "/extensions/KHR_lights_punctual/lights/"]
            .iter()
            .find_map(|c| Some((*c, pointer.strip_prefix(c)?)))?;
        let (index, property) = rest.split_once('/')?;
        // RFC 6901 has indices without leading zeros or signs
        let index = index.parse().ok().filter(|k: &usize| k.to_string() == index)?;
        match collection {
            "/nodes/" => match property {
                "translation" | "rotation" | "scale" | "weights" => Some(Self::Node(index, property)),
                "extensions/KHR_node_visibility/visible" => Some(Self::Visibility(index)),
                _ => None,
            },
            "/materials/" => Some(Self::Material(index, material(property)?)),
            "/cameras/" => match property {
                "perspective/yfov" => Some(Self::Camera(index, CameraProperty::FovY)),
                "orthographic/ymag" => Some(Self::Camera(index, CameraProperty::HalfHeight)),
                "perspective/znear" | "orthographic/znear" => Some(Self::Camera(index, CameraProperty::Near)),
                "perspective/zfar" | "orthographic/zfar" => Some(Self::Camera(index, CameraProperty::Far)),
                "orthographic/xmag" | "perspective/aspectRatio" => Some(Self::Nothing),
                _ => None,
            },
            _ => Some(Self::Light(index, light(property)?)),
        }
    }
}

fn light(property: &str) -> Option<LightProperty> {
    Some(match property {
        "color" => LightProperty::Color,
        "intensity" => LightProperty::Intensity,
        "range" => LightProperty::Range,
        "spot/innerConeAngle" => LightProperty::InnerConeAngle,
        "spot/outerConeAngle" => LightProperty::OuterConeAngle,
        _ => return None,
    })
}

fn material(property: &str) -> Option<Number> {
    if let Some((texture, transform)) = property.split_once(TRANSFORM) {
        let slot = TEXTURES.iter().position(|t| *t == texture)?;
        return Some(match transform {
            "/offset" => Number::TextureOffset(slot),
            "/rotation" => Number::TextureRotation(slot),
            "/scale" => Number::TextureScale(slot),
            _ => return None,
        });
    }

    // the core, then its extensions
    let Some(extension) = property.strip_prefix("extensions/KHR_materials_") else {
        return Some(match property {
            "pbrMetallicRoughness/baseColorFactor" => Number::BaseColor,
            "pbrMetallicRoughness/metallicFactor" => Number::Metallic,
            "pbrMetallicRoughness/roughnessFactor" => Number::Roughness,
            "normalTexture/scale" => Number::NormalScale,
            "occlusionTexture/strength" => Number::OcclusionStrength,
            "emissiveFactor" => Number::EmissiveFactor,
            "alphaCutoff" => Number::AlphaCutoff,
            _ => return None,
        });
    };
    Some(match extension {
        "emissive_strength/emissiveStrength" => Number::EmissiveStrength,
        "ior/ior" => Number::Ior,
        "clearcoat/clearcoatFactor" => Number::Clearcoat,
        "clearcoat/clearcoatRoughnessFactor" => Number::ClearcoatRoughness,
        "clearcoat/clearcoatNormalTexture/scale" => Number::ClearcoatNormalScale,
        "sheen/sheenColorFactor" => Number::SheenColor,
        "sheen/sheenRoughnessFactor" => Number::SheenRoughness,
        "transmission/transmissionFactor" => Number::Transmission,
        "volume/thicknessFactor" => Number::Thickness,
        "volume/attenuationColor" => Number::AttenuationColor,
        "volume/attenuationDistance" => Number::AttenuationDistance,
        "specular/specularFactor" => Number::Specular,
        "specular/specularColorFactor" => Number::SpecularColor,
        "anisotropy/anisotropyStrength" => Number::AnisotropyStrength,
        "anisotropy/anisotropyRotation" => Number::AnisotropyRotation,
        "iridescence/iridescenceFactor" => Number::Iridescence,
        "iridescence/iridescenceIor" => Number::IridescenceIor,
        "iridescence/iridescenceThicknessMinimum" => Number::IridescenceThicknessMinimum,
        "iridescence/iridescenceThicknessMaximum" => Number::IridescenceThicknessMaximum,
        "diffuse_transmission/diffuseTransmissionFactor" => Number::DiffuseTransmission,
        "diffuse_transmission/diffuseTransmissionColorFactor" => Number::DiffuseTransmissionColor,
        _ => return None,
    })
}

/// A material of the file at rest. `copies`: the scene's materials that it became.
pub(super) fn animated_material(material: &MaterialJson, copies: Vec<usize>) -> AnimatedMaterial {
    let extensions = material.extensions.as_ref();
    let json = serde_json::to_value(material).unwrap_or(Value::Null);
    let transform = |texture: &str| {
        let number = |v: &Value| v.as_f64().map(|v| v as f32);
        let found = json.pointer(&format!("/{texture}{TRANSFORM}"));
        let pair = |key: &str| found.and_then(|t| Some(Vec2::new(number(&t[key][0])?, number(&t[key][1])?)));
        TextureTransform {
            offset: pair("offset").unwrap_or(Vec2::ZERO),
            rotation: found.and_then(|t| number(&t["rotation"])).unwrap_or(0.0),
            scale: pair("scale").unwrap_or(Vec2::ONE),
        }
    };
    AnimatedMaterial {
        materials: copies,
        emissive_factor: Vec3::from(material.emissive_factor.0),
        emissive_strength: extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0),
        transforms: TEXTURES.map(transform),
    }
}

/// The nodes of a file that animations may hide or show.
pub(super) fn switched_nodes<'a>(
    document: &Root,
    pointers: impl Iterator<Item = &'a str>,
) -> impl Iterator<Item = usize> {
    let count = document.nodes.len();
    pointers.filter_map(move |pointer| match Pointer::parse(pointer)? {
        Pointer::Visibility(node) if node < count => Some(node),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::animation::MaterialProperty;

    #[test]
    fn pointers_are_read_to_the_letter() {
        for (pointer, expected) in [
            ("/nodes/3/rotation", Pointer::Node(3, "rotation")),
            ("/nodes/0/extensions/KHR_node_visibility/visible", Pointer::Visibility(0)),
            ("/materials/2/pbrMetallicRoughness/baseColorFactor", Pointer::Material(2, MaterialProperty::BaseColor)),
            (
                "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset",
                Pointer::Material(0, MaterialProperty::TextureOffset(0)),
            ),
            (
                "/materials/1/occlusionTexture/extensions/KHR_texture_transform/scale",
                Pointer::Material(1, MaterialProperty::TextureScale(3)),
            ),
            (
                "/extensions/KHR_lights_punctual/lights/1/spot/outerConeAngle",
                Pointer::Light(1, LightProperty::OuterConeAngle),
            ),
            ("/cameras/0/perspective/yfov", Pointer::Camera(0, CameraProperty::FovY)),
            ("/cameras/0/orthographic/xmag", Pointer::Nothing),
        ] {
            assert_eq!(Pointer::parse(pointer), Some(expected), "{pointer}");
        }
        for pointer in [
            "",
            "/nodes/01/scale",
            "/nodes/+1/scale",
            "/nodes/1",
            "/nodes/1/scale/0",
            "/materials/0/doubleSided",
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/texCoord",
            "/meshes/0/weights",
            "nodes/0/scale",
        ] {
            assert_eq!(Pointer::parse(pointer), None, "{pointer}");
        }
    }
}
