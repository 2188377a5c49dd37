//! `KHR_materials_pbrSpecularGlossiness`, what files had before `KHR_materials_specular`.
//!
//! It is what the newer extensions say with an index of refraction of 0, by which a surface
//! reflects its specular colour: the same material and no guess at a metal. Roughness is 1 minus
//! glossiness, which is the alpha channel of the specular texture: a texture of its own is made.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Archived>

use ::gltf::json::texture::Info;
use glam::{Vec3, Vec4};
use serde::Deserialize;

use super::material::{UnmodelledExtension, slot};
use crate::scene::load::picture::DecodedImage;
use crate::scene::{Material, TexelData};

/// The extension of a material.
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SpecularGlossiness {
    diffuse_factor: Option<[f32; 4]>,
    diffuse_texture: Option<Info>,
    specular_factor: Option<[f32; 3]>,
    glossiness_factor: Option<f32>,
    specular_glossiness_texture: Option<Info>,
}

impl UnmodelledExtension for SpecularGlossiness {
    const NAME: &str = "KHR_materials_pbrSpecularGlossiness";
}

/// A texture of roughness that is made of one of glossiness.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct RoughnessTexture {
    /// Index of the glTF texture, whose alpha is glossiness.
    pub texture: usize,
    /// Factor of glossiness.
    pub factor: f32,
}

impl SpecularGlossiness {
    /// Gives a material what the extension says. `textures`: number of the file's textures, after
    /// which those of `made` are numbered.
    pub(super) fn apply(&self, material: &mut Material, textures: usize, made: &mut Vec<RoughnessTexture>) {
        let glossiness = self.glossiness_factor.unwrap_or(1.0);
        material.base_color = Vec4::from(self.diffuse_factor.unwrap_or([1.0; 4]));
        material.base_color_texture = slot(&self.diffuse_texture);
        (material.metallic, material.roughness) = (0.0, 1.0 - glossiness);
        material.metallic_roughness_texture = None;
        material.ior = 0.0;
        material.specular.color = Vec3::from(self.specular_factor.unwrap_or([1.0; 3]));
        material.specular.color_texture = slot(&self.specular_glossiness_texture);
        (material.specular.factor, material.specular.texture) = (1.0, None);

        // roughness varies as glossiness does
        if let Some(source) = material.specular.color_texture {
            let wanted = RoughnessTexture { texture: source.texture, factor: glossiness };
            let known = made.iter().position(|m| *m == wanted).unwrap_or(made.len());
            if known == made.len() {
                made.push(wanted);
            }
            let mut roughness = source;
            roughness.texture = textures + known;
            (material.roughness, material.metallic_roughness_texture) = (1.0, Some(roughness));
        }
    }
}

impl RoughnessTexture {
    /// Texels whose green channel is roughness. With a factor of 1 no digit is lost.
    pub(super) fn make(&self, glossiness: &DecodedImage) -> TexelData {
        if let (TexelData::Unorm8(texels), true) = (&glossiness.texels, self.factor == 1.0) {
            let texel = |texel: &[u8]| [0, u8::MAX - texel[3], 0, u8::MAX];
            return texels.chunks_exact(4).flat_map(texel).collect::<Vec<u8>>().into();
        }
        let roughness = |i: usize| (1.0 - self.factor * glossiness.texels.get(i)[3]).clamp(0.0, 1.0);
        let texel = |i: usize| [0, (roughness(i) * f32::from(u16::MAX)).round() as u16, 0, u16::MAX];
        (0..glossiness.texels.len()).flat_map(texel).collect::<Vec<u16>>().into()
    }
}
