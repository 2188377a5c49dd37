//! Materials as files describe them: glTF metallic-roughness with its extensions, and the named
//! materials of `.brhan`.

use std::collections::BTreeMap;

use glam::{Affine2, Vec3, Vec4};

/// Use of a texture by a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureSlot {
    /// Index into [`super::Scene::textures`].
    pub texture: usize,
    /// Which set of texture coordinates.
    pub texcoord: usize,
    /// KHR_texture_transform, applied to the coordinates; identity without it.
    pub transform: Affine2,
}

/// Meaning of the base colour's alpha (glTF alphaMode).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Visible where alpha is at least the cutoff.
    Mask {
        /// Usually 0.5.
        cutoff: f32,
    },
    /// Coverage: the path tracer treats it as stochastic alpha, occlusion streams as a mask with
    /// cutoff 0.5.
    Blend,
}

/// Material model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MaterialKind {
    /// glTF 2.0 metallic-roughness and extensions.
    #[default]
    MetallicRoughness,
    /// `.brhan` matte: Lambert.
    Matte,
    /// `.brhan` mirror: perfect specular reflection.
    Mirror,
    /// `.brhan` glass: smooth dielectric.
    Glass,
    /// `.brhan` copper: Beckmann conductor.
    Copper,
    /// `.brhan` gold: Beckmann conductor.
    Gold,
}

/// KHR_materials_clearcoat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// Strength, 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (red).
    pub texture: Option<TextureSlot>,
    /// Roughness, 0 to 1.
    pub roughness: f32,
    /// Multiplies `roughness` (green).
    pub roughness_texture: Option<TextureSlot>,
    /// Normal map of the coat.
    pub normal_texture: Option<TextureSlot>,
    /// Scale of that map's x and y.
    pub normal_scale: f32,
}

impl Default for Clearcoat {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            roughness: 0.0,
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
        }
    }
}

/// KHR_materials_sheen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sheen {
    /// Linear colour.
    pub color: Vec3,
    /// Multiplies `color` (sRGB texture).
    pub color_texture: Option<TextureSlot>,
    /// 0 to 1.
    pub roughness: f32,
    /// Multiplies `roughness` (alpha).
    pub roughness_texture: Option<TextureSlot>,
}

/// KHR_materials_transmission and KHR_materials_volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Fraction of light that is transmitted, 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (red).
    pub texture: Option<TextureSlot>,
    /// Thickness in object units; 0 = thin-walled.
    pub thickness: f32,
    /// Multiplies `thickness` (green).
    pub thickness_texture: Option<TextureSlot>,
    /// Linear colour of white light after travelling `attenuation_distance`.
    pub attenuation_color: Vec3,
    /// In scene units (metres in glTF); infinite without absorption.
    pub attenuation_distance: f32,
}

impl Default for Transmission {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            thickness: 0.0,
            thickness_texture: None,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
        }
    }
}

/// KHR_materials_specular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specular {
    /// 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (alpha).
    pub texture: Option<TextureSlot>,
    /// Linear colour at normal incidence.
    pub color: Vec3,
    /// Multiplies `color` (sRGB texture).
    pub color_texture: Option<TextureSlot>,
}

impl Default for Specular {
    fn default() -> Self {
        Self { factor: 1.0, texture: None, color: Vec3::ONE, color_texture: None }
    }
}

/// KHR_materials_anisotropy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// 0 to 1.
    pub strength: f32,
    /// Radians, counter-clockwise from the tangent.
    pub rotation: f32,
    /// Direction (red, green) and strength (blue).
    pub texture: Option<TextureSlot>,
}

/// KHR_materials_iridescence: a thin film over the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iridescence {
    /// 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (red).
    pub texture: Option<TextureSlot>,
    /// Index of refraction of the film.
    pub ior: f32,
    /// Thickness in nanometres where the texture is 0, and where it is 1 or missing.
    pub thickness: [f32; 2],
    /// Chooses between the two (green).
    pub thickness_texture: Option<TextureSlot>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self { factor: 0.0, texture: None, ior: 1.3, thickness: [100.0, 400.0], thickness_texture: None }
    }
}

/// KHR_materials_diffuse_transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Share of what is diffuse that goes to the other side, 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (alpha).
    pub texture: Option<TextureSlot>,
    /// Linear colour of what is transmitted, in place of the base colour.
    pub color: Vec3,
    /// Multiplies `color` (sRGB texture).
    pub color_texture: Option<TextureSlot>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self { factor: 0.0, texture: None, color: Vec3::ONE, color_texture: None }
    }
}

/// KHR_materials_retroreflection: light that returns to where it came from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Retroreflection {
    /// Share of what is reflected specularly, 0 to 1.
    pub factor: f32,
    /// Multiplies `factor` (red).
    pub texture: Option<TextureSlot>,
}

/// KHR_materials_volume_scatter: particles of a volume that send light another way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VolumeScatter {
    /// Linear colour of a thick volume under light from everywhere; black does not scatter.
    pub color: Vec3,
    /// Mean cosine of the angle between the directions before and after, between -1 and 1.
    pub anisotropy: f32,
}

/// Materials that replace one another by the variant of a scene (KHR_materials_variants).
#[derive(Clone, Debug, PartialEq)]
pub struct VariantMaterials {
    /// Index of the material without a variant, and in variants that do not replace it.
    pub base: usize,
    /// Indices of a variant in [`super::Scene::variants`], and of the material that it has instead.
    pub replacements: Vec<(usize, usize)>,
}

impl VariantMaterials {
    /// Index of the material in a variant, or without one.
    pub fn material(&self, variant: Option<usize>) -> usize {
        let replacement = self.replacements.iter().find(|(of, _)| Some(*of) == variant);
        replacement.map_or(self.base, |(_, material)| *material)
    }

    /// Indices of all materials that it can be, to change them.
    pub fn all_mut(&mut self) -> impl Iterator<Item = &mut usize> {
        std::iter::once(&mut self.base).chain(self.replacements.iter_mut().map(|(_, material)| material))
    }

    /// Indices of all materials that it can be.
    pub fn all(&self) -> impl Iterator<Item = usize> {
        std::iter::once(self.base).chain(self.replacements.iter().map(|(_, material)| *material))
    }
}

/// The material of an index, and all that it can be in variants of a scene with these materials.
pub fn all_variants(materials: &[Material], index: usize) -> Vec<&Material> {
    let replacements = materials[index].variants.iter().flat_map(VariantMaterials::all);
    std::iter::once(index).chain(replacements).map(|i| &materials[i]).collect()
}

/// A surface's appearance. Colours are linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file; may be empty.
    pub name: String,
    /// Material model.
    pub kind: MaterialKind,
    /// Linear base colour and alpha; for `.brhan` and MTL the diffuse colour.
    pub base_color: Vec4,
    /// Multiplies `base_color` (sRGB texture, linear alpha).
    pub base_color_texture: Option<TextureSlot>,
    /// 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness, 0 to 1.
    pub roughness: f32,
    /// Multiplies metallic (blue) and roughness (green).
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normal map.
    pub normal_texture: Option<TextureSlot>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
    /// Baked occlusion (red): for the AOV only, never used in light transport.
    pub occlusion_texture: Option<TextureSlot>,
    /// How much of the occlusion texture applies, 0 to 1: visibility is 1 + strength (texture - 1).
    pub occlusion_strength: f32,
    /// Linear emitted radiance, KHR_materials_emissive_strength included.
    pub emissive: Vec3,
    /// Multiplies `emissive` (sRGB texture).
    pub emissive_texture: Option<TextureSlot>,
    /// Meaning of alpha.
    pub alpha_mode: AlphaMode,
    /// Both faces are shaded. Visibility does not depend on it: rays hit both faces.
    pub double_sided: bool,
    /// Index of refraction (KHR_materials_ior, `Ni`): at least 1. In glTF also 0, for a Fresnel
    /// term of 1 that leaves reflection to the specular colour; such a material does not refract.
    pub ior: f32,
    /// Specular colour of MTL/.brhan (`Ks`, `specular[]`, `reflectance[]`).
    pub specular_color: Vec3,
    /// Transmitted colour of MTL/.brhan (`Tf`, `transmittance[]`).
    pub transmittance: Vec3,
    /// `d` of an MTL material where it is below 1 and nothing else says glass: what it means is a
    /// setting ([`super::SceneSettings`]).
    pub mtl_dissolve: Option<f32>,
    /// Others that it is a copy of, one at a time: which one is a setting
    /// ([`super::SceneSettings`]).
    pub variants: Option<VariantMaterials>,
    /// KHR_materials_unlit.
    pub unlit: bool,
    /// KHR_materials_clearcoat.
    pub clearcoat: Clearcoat,
    /// KHR_materials_sheen.
    pub sheen: Sheen,
    /// KHR_materials_transmission and KHR_materials_volume.
    pub transmission: Transmission,
    /// Priority of nested dielectrics: where volumes overlap, the one with the highest priority
    /// applies; of equal ones, the one that the path entered last (Schmidt, Budge 2002). glTF:
    /// `extras.dielectricPriority` of the material.
    pub dielectric_priority: i32,
    /// KHR_materials_specular.
    pub specular: Specular,
    /// KHR_materials_anisotropy.
    pub anisotropy: Anisotropy,
    /// KHR_materials_iridescence.
    pub iridescence: Iridescence,
    /// KHR_materials_diffuse_transmission.
    pub diffuse_transmission: DiffuseTransmission,
    /// KHR_materials_retroreflection.
    pub retroreflection: Retroreflection,
    /// KHR_materials_volume_scatter.
    pub volume_scatter: VolumeScatter,
    /// KHR_materials_dispersion: 20 over the Abbe number of a volume; 0 without dispersion.
    pub dispersion: f32,
    /// Parameters by name for BSDFs that the file format does not have: numeric `extras` of a glTF
    /// material, unknown statements of an MTL file, `sigma[]` of `.brhan`.
    /// docs/reference/materials.md lists those that are used.
    pub parameters: BTreeMap<String, f32>,
}

impl Default for Material {
    /// White, rough and not metallic.
    fn default() -> Self {
        Self {
            name: String::new(),
            kind: MaterialKind::default(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::default(),
            double_sided: false,
            ior: 1.5,
            specular_color: Vec3::ZERO,
            transmittance: Vec3::ZERO,
            mtl_dissolve: None,
            variants: None,
            unlit: false,
            clearcoat: Clearcoat::default(),
            sheen: Sheen::default(),
            transmission: Transmission::default(),
            dielectric_priority: 0,
            specular: Specular::default(),
            anisotropy: Anisotropy::default(),
            iridescence: Iridescence::default(),
            diffuse_transmission: DiffuseTransmission::default(),
            retroreflection: Retroreflection::default(),
            volume_scatter: VolumeScatter::default(),
            dispersion: 0.0,
            parameters: BTreeMap::new(),
        }
    }
}

impl Material {
    /// All texture slots, empty ones included.
    pub fn texture_slots_mut(&mut self) -> [&mut Option<TextureSlot>; 20] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
            &mut self.clearcoat.texture,
            &mut self.clearcoat.roughness_texture,
            &mut self.clearcoat.normal_texture,
            &mut self.sheen.color_texture,
            &mut self.sheen.roughness_texture,
            &mut self.transmission.texture,
            &mut self.transmission.thickness_texture,
            &mut self.specular.texture,
            &mut self.specular.color_texture,
            &mut self.anisotropy.texture,
            &mut self.iridescence.texture,
            &mut self.iridescence.thickness_texture,
            &mut self.diffuse_transmission.texture,
            &mut self.diffuse_transmission.color_texture,
            &mut self.retroreflection.texture,
        ]
    }

    /// The textures in use.
    pub fn textures(&self) -> impl Iterator<Item = TextureSlot> {
        let mut copy = self.clone();
        let slots = copy.texture_slots_mut().map(|slot| *slot);
        slots.into_iter().flatten()
    }

    /// The parameter of this name, if the file has it.
    pub fn parameter(&self, name: &str) -> Option<f32> {
        self.parameters.get(name).copied()
    }

    /// Whether shading needs the tangents of a mesh: a normal map, or anisotropy.
    pub fn needs_tangents(&self) -> bool {
        self.normal_texture.is_some() || self.clearcoat.normal_texture.is_some() || self.anisotropy.strength > 0.0
    }
}
