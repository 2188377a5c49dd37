//! Materials to glTF JSON: the inverse of the loader.

use std::collections::BTreeSet;

use glam::{Affine2, Vec3};
use serde_json::{Map, Value, json};

use crate::scene::material::{AlphaMode, Material, TextureSlot, Transmission};

/// JSON of `material`; the extensions it takes are added to `used`.
pub(super) fn material(material: &Material, used: &mut BTreeSet<&'static str>) -> Value {
    let mut writer = Writer { used, extensions: Map::new() };

    // what core glTF has
    let mut out = json!({
        "name": material.name,
        "doubleSided": material.double_sided,
        "pbrMetallicRoughness": {
            "baseColorFactor": material.base_color.to_array(),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
    });
    writer.texture(&mut out["pbrMetallicRoughness"], "baseColorTexture", &material.base_color_texture);
    writer.texture(&mut out["pbrMetallicRoughness"], "metallicRoughnessTexture", &material.metallic_roughness_texture);
    writer.texture(&mut out, "normalTexture", &material.normal_texture);
    writer.texture(&mut out, "occlusionTexture", &material.occlusion_texture);
    writer.texture(&mut out, "emissiveTexture", &material.emissive_texture);
    if material.normal_texture.is_some() && material.normal_scale != 1.0 {
        out["normalTexture"]["scale"] = json!(material.normal_scale);
    }
    if material.occlusion_texture.is_some() && material.occlusion_strength != 1.0 {
        out["occlusionTexture"]["strength"] = json!(material.occlusion_strength);
    }

    // alpha and emission
    match material.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            out["alphaMode"] = json!("MASK");
            out["alphaCutoff"] = json!(cutoff);
        }
        AlphaMode::Blend => out["alphaMode"] = json!("BLEND"),
    }
    let (factor, strength) = split(material.emissive);
    if material.emissive != Vec3::ZERO {
        out["emissiveFactor"] = json!(factor.to_array());
    }
    if strength > 1.0 {
        writer.extension("KHR_materials_emissive_strength", json!({ "emissiveStrength": strength }));
    }

    // what only extensions can say
    if !material.parameters.is_empty() {
        out["extras"] = json!(material.parameters);
    }
    writer.extensions_of(material);
    if !writer.extensions.is_empty() {
        out["extensions"] = Value::Object(writer.extensions);
    }
    out
}

/// `color` as a factor of at most 1 and a strength of at least 1, a power of two so that the
/// product is exact.
pub(super) fn split(color: Vec3) -> (Vec3, f32) {
    let max = color.max_element();
    if !(max > 1.0 && max.is_finite()) {
        return (color, 1.0);
    }
    let strength = max.log2().ceil().exp2();
    (color / strength, strength)
}

struct Writer<'a> {
    used: &'a mut BTreeSet<&'static str>,
    extensions: Map<String, Value>,
}

impl Writer<'_> {
    fn extension(&mut self, name: &'static str, value: Value) {
        self.used.insert(name);
        self.extensions.insert(name.to_owned(), value);
    }

    fn texture(&mut self, parent: &mut Value, key: &str, slot: &Option<TextureSlot>) {
        let Some(slot) = slot else { return };
        let mut info = json!({ "index": slot.texture });
        if slot.texcoord != 0 {
            info["texCoord"] = json!(slot.texcoord);
        }
        if slot.transform != Affine2::IDENTITY {
            self.used.insert("KHR_texture_transform");
            info["extensions"] = json!({ "KHR_texture_transform": transform(&slot.transform) });
        }
        parent[key] = info;
    }

    fn extensions_of(&mut self, m: &Material) {
        if m.unlit {
            self.extension("KHR_materials_unlit", json!({}));
        }
        if m.ior != 1.5 {
            self.extension("KHR_materials_ior", json!({ "ior": m.ior }));
        }

        // layers over the surface
        let coat = &m.clearcoat;
        if *coat != Default::default() {
            let mut e = json!({ "clearcoatFactor": coat.factor, "clearcoatRoughnessFactor": coat.roughness });
            self.texture(&mut e, "clearcoatTexture", &coat.texture);
            self.texture(&mut e, "clearcoatRoughnessTexture", &coat.roughness_texture);
            self.texture(&mut e, "clearcoatNormalTexture", &coat.normal_texture);
            if coat.normal_texture.is_some() && coat.normal_scale != 1.0 {
                e["clearcoatNormalTexture"]["scale"] = json!(coat.normal_scale);
            }
            self.extension("KHR_materials_clearcoat", e);
        }
        let sheen = &m.sheen;
        if *sheen != Default::default() {
            let mut e = json!({ "sheenColorFactor": sheen.color.to_array(), "sheenRoughnessFactor": sheen.roughness });
            self.texture(&mut e, "sheenColorTexture", &sheen.color_texture);
            self.texture(&mut e, "sheenRoughnessTexture", &sheen.roughness_texture);
            self.extension("KHR_materials_sheen", e);
        }

        // what the surface itself reflects and lets through
        self.transmission(&m.transmission);
        let specular = &m.specular;
        if *specular != Default::default() {
            let mut e = json!({ "specularFactor": specular.factor, "specularColorFactor": specular.color.to_array() });
            self.texture(&mut e, "specularTexture", &specular.texture);
            self.texture(&mut e, "specularColorTexture", &specular.color_texture);
            self.extension("KHR_materials_specular", e);
        }
        let anisotropy = &m.anisotropy;
        if *anisotropy != Default::default() {
            let mut e = json!({ "anisotropyStrength": anisotropy.strength, "anisotropyRotation": anisotropy.rotation });
            self.texture(&mut e, "anisotropyTexture", &anisotropy.texture);
            self.extension("KHR_materials_anisotropy", e);
        }
        let film = &m.iridescence;
        if *film != Default::default() {
            let [least, most] = film.thickness;
            let mut e = json!({
                "iridescenceFactor": film.factor, "iridescenceIor": film.ior,
                "iridescenceThicknessMinimum": least, "iridescenceThicknessMaximum": most,
            });
            self.texture(&mut e, "iridescenceTexture", &film.texture);
            self.texture(&mut e, "iridescenceThicknessTexture", &film.thickness_texture);
            self.extension("KHR_materials_iridescence", e);
        }
        let through = &m.diffuse_transmission;
        if *through != Default::default() {
            let mut e = json!({
                "diffuseTransmissionFactor": through.factor,
                "diffuseTransmissionColorFactor": through.color.to_array(),
            });
            self.texture(&mut e, "diffuseTransmissionTexture", &through.texture);
            self.texture(&mut e, "diffuseTransmissionColorTexture", &through.color_texture);
            self.extension("KHR_materials_diffuse_transmission", e);
        }
        let retro = &m.retroreflection;
        if *retro != Default::default() {
            let mut e = json!({ "retroreflectionFactor": retro.factor });
            self.texture(&mut e, "retroreflectionTexture", &retro.texture);
            self.extension("KHR_materials_retroreflection", e);
        }
        let scatter = &m.volume_scatter;
        if *scatter != Default::default() {
            let e = json!({
                "multiscatterColor": scatter.color.to_array(), "scatterAnisotropy": scatter.anisotropy,
            });
            self.extension("KHR_materials_volume_scatter", e);
        }
        if m.dispersion != 0.0 {
            self.extension("KHR_materials_dispersion", json!({ "dispersion": m.dispersion }));
        }
    }

    fn transmission(&mut self, t: &Transmission) {
        if t.factor != 0.0 || t.texture.is_some() {
            let mut e = json!({ "transmissionFactor": t.factor });
            self.texture(&mut e, "transmissionTexture", &t.texture);
            self.extension("KHR_materials_transmission", e);
        }
        let none = Transmission { factor: t.factor, texture: t.texture, ..Default::default() };
        if *t != none {
            let mut e = json!({ "thicknessFactor": t.thickness, "attenuationColor": t.attenuation_color.to_array() });
            if t.attenuation_distance.is_finite() {
                e["attenuationDistance"] = json!(t.attenuation_distance);
            }
            self.texture(&mut e, "thicknessTexture", &t.thickness_texture);
            self.extension("KHR_materials_volume", e);
        }
    }
}

/// Offset, rotation and scale of a transform without shear; the sign of the determinant goes to the
/// second scale.
fn transform(t: &Affine2) -> Value {
    let (x, y) = (t.matrix2.x_axis, t.matrix2.y_axis);
    let scale = [x.length(), y.length() * t.matrix2.determinant().signum()];
    // the loader's x axis is scale * (cos, -sin)
    json!({ "offset": t.translation.to_array(), "rotation": (-x.y).atan2(x.x), "scale": scale })
}
