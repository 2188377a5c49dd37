//! Materials: core metallic-roughness and the KHR_materials extensions, to [`crate::scene::Material`].

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use serde::Deserialize;

use super::schema::{one, white};
use crate::scene::material::{
    AlphaMode, Anisotropy, Clearcoat, Material as SceneMaterial, Sheen, Specular, TextureSlot, Transmission,
};

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Material {
    name: String,
    pbr_metallic_roughness: Pbr,
    normal_texture: Option<TextureInfo>,
    occlusion_texture: Option<TextureInfo>,
    emissive_texture: Option<TextureInfo>,
    emissive_factor: [f32; 3],
    alpha_mode: Option<String>,
    alpha_cutoff: Option<f32>,
    double_sided: bool,
    extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Pbr {
    base_color_factor: [f32; 4],
    base_color_texture: Option<TextureInfo>,
    metallic_factor: f32,
    roughness_factor: f32,
    metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct TextureInfo {
    index: usize,
    #[serde(default)]
    tex_coord: usize,
    /// Of normal textures only.
    #[serde(default = "one")]
    scale: f32,
    #[serde(default)]
    extensions: TextureInfoExtensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Option<TextureTransform>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct TextureTransform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<usize>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Extensions {
    #[serde(rename = "KHR_materials_clearcoat")]
    clearcoat: Option<ClearcoatJson>,
    #[serde(rename = "KHR_materials_sheen")]
    sheen: Option<SheenJson>,
    #[serde(rename = "KHR_materials_transmission")]
    transmission: Option<TransmissionJson>,
    #[serde(rename = "KHR_materials_volume")]
    volume: Option<VolumeJson>,
    #[serde(rename = "KHR_materials_ior")]
    ior: Option<IorJson>,
    #[serde(rename = "KHR_materials_specular")]
    specular: Option<SpecularJson>,
    #[serde(rename = "KHR_materials_anisotropy")]
    anisotropy: Option<AnisotropyJson>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    emissive_strength: Option<EmissiveStrengthJson>,
    #[serde(rename = "KHR_materials_unlit")]
    unlit: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ClearcoatJson {
    #[serde(default)]
    clearcoat_factor: f32,
    clearcoat_texture: Option<TextureInfo>,
    #[serde(default)]
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<TextureInfo>,
    clearcoat_normal_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SheenJson {
    #[serde(default)]
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<TextureInfo>,
    #[serde(default)]
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct TransmissionJson {
    #[serde(default)]
    transmission_factor: f32,
    transmission_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct VolumeJson {
    #[serde(default)]
    thickness_factor: f32,
    thickness_texture: Option<TextureInfo>,
    attenuation_distance: Option<f32>,
    #[serde(default = "white")]
    attenuation_color: [f32; 3],
}

#[derive(Deserialize)]
struct IorJson {
    ior: Option<f32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SpecularJson {
    #[serde(default = "one")]
    specular_factor: f32,
    specular_texture: Option<TextureInfo>,
    #[serde(default = "white")]
    specular_color_factor: [f32; 3],
    specular_color_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct AnisotropyJson {
    #[serde(default)]
    anisotropy_strength: f32,
    #[serde(default)]
    anisotropy_rotation: f32,
    anisotropy_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct EmissiveStrengthJson {
    #[serde(default = "one")]
    emissive_strength: f32,
}

impl TextureInfo {
    /// The slot, with the index of the glTF texture, not yet of the scene's.
    fn slot(&self) -> TextureSlot {
        let transform = self.extensions.transform.as_ref();
        TextureSlot {
            texture: self.index,
            texcoord: transform.and_then(|t| t.tex_coord).unwrap_or(self.tex_coord),
            transform: transform.map_or(Affine2::IDENTITY, TextureTransform::affine),
        }
    }
}

impl TextureTransform {
    /// `translation * rotation * scale` of the extension. Its rotation is counter-clockwise as seen in an image whose v
    /// points down, hence the signs.
    fn affine(&self) -> Affine2 {
        let (s, c) = self.rotation.sin_cos();
        let rotation = Mat2::from_cols(Vec2::new(c, -s), Vec2::new(s, c));
        let scale = Mat2::from_diagonal(self.scale.into());
        Affine2::from_mat2_translation(rotation * scale, self.offset.into())
    }
}

fn slot(info: &Option<TextureInfo>) -> Option<TextureSlot> {
    info.as_ref().map(TextureInfo::slot)
}

/// What a primitive without a material looks like.
pub(super) fn default_material() -> SceneMaterial {
    Material::default().to_scene()
}

impl Material {
    /// The scene's material, whose slots still hold indices of glTF textures.
    pub(super) fn to_scene(&self) -> SceneMaterial {
        let (pbr, ext) = (&self.pbr_metallic_roughness, &self.extensions);
        let strength = ext.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength);
        SceneMaterial {
            name: self.name.clone(),
            base_color: Vec4::from(pbr.base_color_factor),
            base_color_texture: slot(&pbr.base_color_texture),
            metallic: pbr.metallic_factor,
            roughness: pbr.roughness_factor,
            metallic_roughness_texture: slot(&pbr.metallic_roughness_texture),
            normal_texture: slot(&self.normal_texture),
            normal_scale: self.normal_texture.as_ref().map_or(1.0, |t| t.scale),
            occlusion_texture: slot(&self.occlusion_texture),
            emissive: Vec3::from(self.emissive_factor) * strength,
            emissive_texture: slot(&self.emissive_texture),
            alpha_mode: self.alpha_mode(),
            double_sided: self.double_sided,
            // 0 stands for "perfect mirror, no refraction" in the extension; as an index of refraction it means nothing
            ior: ext.ior.as_ref().and_then(|i| i.ior).filter(|&i| i >= 1.0).unwrap_or(1.5),
            unlit: ext.unlit.is_some(),
            clearcoat: ext.clearcoat.as_ref().map(ClearcoatJson::to_scene).unwrap_or_default(),
            sheen: ext.sheen.as_ref().map(SheenJson::to_scene).unwrap_or_default(),
            transmission: self.transmission(),
            specular: ext.specular.as_ref().map(SpecularJson::to_scene).unwrap_or_default(),
            anisotropy: ext.anisotropy.as_ref().map(AnisotropyJson::to_scene).unwrap_or_default(),
            ..SceneMaterial::default()
        }
    }

    fn alpha_mode(&self) -> AlphaMode {
        match self.alpha_mode.as_deref() {
            Some("MASK") => AlphaMode::Mask { cutoff: self.alpha_cutoff.unwrap_or(0.5) },
            Some("BLEND") => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        }
    }

    fn transmission(&self) -> Transmission {
        let mut transmission = Transmission::default();
        if let Some(t) = &self.extensions.transmission {
            transmission.factor = t.transmission_factor;
            transmission.texture = slot(&t.transmission_texture);
        }
        if let Some(v) = &self.extensions.volume {
            transmission.thickness = v.thickness_factor;
            transmission.thickness_texture = slot(&v.thickness_texture);
            transmission.attenuation_color = v.attenuation_color.into();
            transmission.attenuation_distance = v.attenuation_distance.filter(|&d| d > 0.0).unwrap_or(f32::INFINITY);
        }
        transmission
    }
}

impl ClearcoatJson {
    fn to_scene(&self) -> Clearcoat {
        Clearcoat {
            factor: self.clearcoat_factor,
            texture: slot(&self.clearcoat_texture),
            roughness: self.clearcoat_roughness_factor,
            roughness_texture: slot(&self.clearcoat_roughness_texture),
            normal_texture: slot(&self.clearcoat_normal_texture),
        }
    }
}

impl SheenJson {
    fn to_scene(&self) -> Sheen {
        Sheen {
            color: self.sheen_color_factor.into(),
            color_texture: slot(&self.sheen_color_texture),
            roughness: self.sheen_roughness_factor,
            roughness_texture: slot(&self.sheen_roughness_texture),
        }
    }
}

impl SpecularJson {
    fn to_scene(&self) -> Specular {
        Specular {
            factor: self.specular_factor,
            texture: slot(&self.specular_texture),
            color: self.specular_color_factor.into(),
            color_texture: slot(&self.specular_color_texture),
        }
    }
}

impl AnisotropyJson {
    fn to_scene(&self) -> Anisotropy {
        Anisotropy {
            strength: self.anisotropy_strength,
            rotation: self.anisotropy_rotation,
            texture: slot(&self.anisotropy_texture),
        }
    }
}
