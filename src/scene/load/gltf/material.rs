//! Materials: core metallic-roughness and the KHR_materials extensions, to
//! [`crate::scene::Material`].

use std::collections::BTreeMap;

use ::gltf::json::extensions::texture::TextureTransform;
use ::gltf::json::material::{self as json, AlphaMode as JsonAlphaMode};
use ::gltf::json::texture::Info;
use glam::{Affine2, Vec3, Vec4};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::glossiness::{RoughnessTexture, SpecularGlossiness};
use super::values::{text, valid};
use crate::scene::animation;
use crate::scene::material::{
    AlphaMode, Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Material, Retroreflection, Sheen, Specular,
    TextureSlot, Transmission, VolumeScatter,
};

/// The extensions that the crate does not model; their names come with them.
pub(super) trait UnmodelledExtension: Default + for<'a> Deserialize<'a> {
    const NAME: &str;

    /// Reads it from the extensions of an object, with its default where it is absent.
    fn from_extensions(extensions: Option<&Map<String, Value>>) -> Result<Self, String> {
        match extensions.and_then(|e| e.get(Self::NAME)) {
            Some(value) => Self::deserialize(value).map_err(|e| format!("{}: {e}", Self::NAME)),
            None => Ok(Self::default()),
        }
    }
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct ClearcoatJson {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<json::NormalTexture>,
}

impl UnmodelledExtension for ClearcoatJson {
    const NAME: &str = "KHR_materials_clearcoat";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct SheenJson {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<Info>,
}

impl UnmodelledExtension for SheenJson {
    const NAME: &str = "KHR_materials_sheen";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct AnisotropyJson {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<Info>,
}

impl UnmodelledExtension for AnisotropyJson {
    const NAME: &str = "KHR_materials_anisotropy";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct IridescenceJson {
    iridescence_factor: f32,
    iridescence_texture: Option<Info>,
    iridescence_ior: Option<f32>,
    iridescence_thickness_minimum: Option<f32>,
    iridescence_thickness_maximum: Option<f32>,
    iridescence_thickness_texture: Option<Info>,
}

impl UnmodelledExtension for IridescenceJson {
    const NAME: &str = "KHR_materials_iridescence";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct DiffuseTransmissionJson {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<Info>,
    diffuse_transmission_color_factor: Option<[f32; 3]>,
    diffuse_transmission_color_texture: Option<Info>,
}

impl UnmodelledExtension for DiffuseTransmissionJson {
    const NAME: &str = "KHR_materials_diffuse_transmission";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct RetroreflectionJson {
    retroreflection_factor: f32,
    retroreflection_texture: Option<Info>,
}

impl UnmodelledExtension for RetroreflectionJson {
    const NAME: &str = "KHR_materials_retroreflection";
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct VolumeScatterJson {
    multiscatter_color: [f32; 3],
    scatter_anisotropy: f32,
}

impl UnmodelledExtension for VolumeScatterJson {
    const NAME: &str = "KHR_materials_volume_scatter";
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct DispersionJson {
    dispersion: f32,
}

impl UnmodelledExtension for DispersionJson {
    const NAME: &str = "KHR_materials_dispersion";
}

/// The crate models it on textures of its type `Info` only, which those for normals and occlusion
/// are not.
impl UnmodelledExtension for TextureTransform {
    const NAME: &str = "KHR_texture_transform";
}

/// Transform of texture coordinates.
fn affine(t: &TextureTransform) -> Affine2 {
    let (offset, scale) = (t.offset.0.into(), t.scale.0.into());
    animation::TextureTransform { offset, rotation: t.rotation.0, scale }.affine()
}

/// A slot, with the index of the glTF texture, not yet of the scene's.
fn make_slot(texture: usize, texcoord: u32, transform: Option<&TextureTransform>) -> TextureSlot {
    TextureSlot {
        texture,
        texcoord: transform.and_then(|t| t.tex_coord).unwrap_or(texcoord) as usize,
        transform: transform.map_or(Affine2::IDENTITY, affine),
    }
}

pub(super) fn slot(info: &Option<Info>) -> Option<TextureSlot> {
    let info = info.as_ref()?;
    let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
    Some(make_slot(info.index.value(), info.tex_coord, transform))
}

fn normal_slot(info: &Option<json::NormalTexture>) -> Result<Option<TextureSlot>, String> {
    let Some(info) = info else { return Ok(None) };
    let transform = TextureTransform::from_extensions(info.extensions.as_ref().map(|e| &e.others))?;
    Ok(Some(make_slot(info.index.value(), info.tex_coord, Some(&transform))))
}

fn occlusion_slot(info: &Option<json::OcclusionTexture>) -> Result<Option<TextureSlot>, String> {
    let Some(info) = info else { return Ok(None) };
    let transform = TextureTransform::from_extensions(info.extensions.as_ref().map(|e| &e.others))?;
    Ok(Some(make_slot(info.index.value(), info.tex_coord, Some(&transform))))
}

/// Material of a primitive that names none.
pub(super) fn default_material() -> Material {
    // without extensions nothing can fail
    convert(&json::Material::default(), 0, &mut Vec::new()).unwrap_or_default()
}

/// The scene's material, whose slots still hold indices of glTF textures, of which there are
/// `textures`, or of textures that are to be made, which follow them.
///
/// # Errors
/// What is wrong with an extension, in words.
pub(super) fn convert(
    material: &json::Material,
    textures: usize,
    made: &mut Vec<RoughnessTexture>,
) -> Result<Material, String> {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = material.extensions.as_ref();
    let others = extensions.map(|e| &e.others);
    let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
    let specular = extensions.and_then(|e| e.specular.as_ref());
    let mut out = Material {
        name: text(&material.name).to_owned(),
        base_color: Vec4::from(pbr.base_color_factor.0),
        base_color_texture: slot(&pbr.base_color_texture),
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        metallic_roughness_texture: slot(&pbr.metallic_roughness_texture),
        normal_texture: normal_slot(&material.normal_texture)?,
        normal_scale: material.normal_texture.as_ref().map_or(1.0, |t| t.scale),
        occlusion_texture: occlusion_slot(&material.occlusion_texture)?,
        occlusion_strength: material.occlusion_texture.as_ref().map_or(1.0, |t| t.strength.0),
        emissive: Vec3::from(material.emissive_factor.0) * strength,
        emissive_texture: slot(&material.emissive_texture),
        alpha_mode: alpha_mode(material),
        double_sided: material.double_sided,
        ior: extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |i| i.ior.0),
        unlit: extensions.is_some_and(|e| e.unlit.is_some()),
        clearcoat: ClearcoatJson::from_extensions(others)?.to_scene()?,
        sheen: SheenJson::from_extensions(others)?.to_scene(),
        transmission: transmission(material),
        dielectric_priority: dielectric_priority(material)?,
        specular: specular.map_or_else(Specular::default, |s| Specular {
            factor: s.specular_factor.0,
            texture: slot(&s.specular_texture),
            color: s.specular_color_factor.0.into(),
            color_texture: slot(&s.specular_color_texture),
        }),
        anisotropy: AnisotropyJson::from_extensions(others)?.to_scene(),
        iridescence: IridescenceJson::from_extensions(others)?.to_scene(),
        diffuse_transmission: DiffuseTransmissionJson::from_extensions(others)?.to_scene(),
        retroreflection: RetroreflectionJson::from_extensions(others)?.to_scene(),
        volume_scatter: VolumeScatterJson::from_extensions(others)?.to_scene(),
        dispersion: DispersionJson::from_extensions(others)?.dispersion,
        parameters: parameters(material),
        ..Material::default()
    };

    // it stands for base colour, metalness and roughness
    if others.is_some_and(|e| e.contains_key(SpecularGlossiness::NAME)) {
        SpecularGlossiness::from_extensions(others)?.apply(&mut out, textures, made);
    }
    Ok(out)
}

/// Numbers among the material's `extras`.
fn parameters(material: &json::Material) -> BTreeMap<String, f32> {
    let extras = material.extras.as_ref().and_then(|e| serde_json::from_str::<BTreeMap<String, Value>>(e.get()).ok());
    let numbers =
        extras.unwrap_or_default().into_iter().filter_map(|(name, value)| Some((name, value.as_f64()? as f32)));
    numbers.filter(|(_, value)| value.is_finite()).collect()
}

/// `extras.dielectricPriority`; other extras are somebody else's.
fn dielectric_priority(material: &json::Material) -> Result<i32, String> {
    #[derive(Deserialize)]
    struct Extras {
        #[serde(rename = "dielectricPriority")]
        priority: Option<Value>,
    }
    let extras = material.extras.as_ref().and_then(|e| serde_json::from_str::<Extras>(e.get()).ok());
    let Some(priority) = extras.and_then(|e| e.priority) else { return Ok(0) };
    let whole = priority.as_i64().and_then(|p| i32::try_from(p).ok());
    whole.ok_or_else(|| format!("extras.dielectricPriority: {priority} is not a 32-bit integer"))
}

fn alpha_mode(material: &json::Material) -> AlphaMode {
    match valid(material.alpha_mode) {
        Some(JsonAlphaMode::Mask) => AlphaMode::Mask { cutoff: material.alpha_cutoff.unwrap_or_default().0 },
        Some(JsonAlphaMode::Blend) => AlphaMode::Blend,
        Some(JsonAlphaMode::Opaque) | None => AlphaMode::Opaque,
    }
}

fn transmission(material: &json::Material) -> Transmission {
    let mut transmission = Transmission::default();
    let Some(extensions) = &material.extensions else { return transmission };
    if let Some(t) = &extensions.transmission {
        transmission.factor = t.transmission_factor.0;
        transmission.texture = slot(&t.transmission_texture);
    }
    if let Some(v) = &extensions.volume {
        transmission.thickness = v.thickness_factor.0;
        transmission.thickness_texture = slot(&v.thickness_texture);
        transmission.attenuation_color = v.attenuation_color.0.into();
        let distance = v.attenuation_distance.0;
        transmission.attenuation_distance = if distance > 0.0 { distance } else { f32::INFINITY };
    }
    transmission
}

impl ClearcoatJson {
    fn to_scene(&self) -> Result<Clearcoat, String> {
        Ok(Clearcoat {
            factor: self.clearcoat_factor,
            texture: slot(&self.clearcoat_texture),
            roughness: self.clearcoat_roughness_factor,
            roughness_texture: slot(&self.clearcoat_roughness_texture),
            normal_texture: normal_slot(&self.clearcoat_normal_texture)?,
            normal_scale: self.clearcoat_normal_texture.as_ref().map_or(1.0, |t| t.scale),
        })
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

impl IridescenceJson {
    fn to_scene(&self) -> Iridescence {
        let default = Iridescence::default();
        let [least, most] = default.thickness;
        Iridescence {
            factor: self.iridescence_factor,
            texture: slot(&self.iridescence_texture),
            ior: self.iridescence_ior.unwrap_or(default.ior),
            thickness: [
                self.iridescence_thickness_minimum.unwrap_or(least),
                self.iridescence_thickness_maximum.unwrap_or(most),
            ],
            thickness_texture: slot(&self.iridescence_thickness_texture),
        }
    }
}

impl DiffuseTransmissionJson {
    fn to_scene(&self) -> DiffuseTransmission {
        DiffuseTransmission {
            factor: self.diffuse_transmission_factor,
            texture: slot(&self.diffuse_transmission_texture),
            color: self.diffuse_transmission_color_factor.map_or(Vec3::ONE, Vec3::from),
            color_texture: slot(&self.diffuse_transmission_color_texture),
        }
    }
}

impl VolumeScatterJson {
    fn to_scene(&self) -> VolumeScatter {
        VolumeScatter { color: self.multiscatter_color.into(), anisotropy: self.scatter_anisotropy }
    }
}

impl RetroreflectionJson {
    fn to_scene(&self) -> Retroreflection {
        Retroreflection { factor: self.retroreflection_factor, texture: slot(&self.retroreflection_texture) }
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
