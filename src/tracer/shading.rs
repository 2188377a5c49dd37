//! What of materials the path tracer gets: `ShadingRecord` of shaders/path/shading.glsl.

use bytemuck::{Pod, Zeroable};

use crate::scene::material::MaterialKind;
use crate::scene::{Material, TextureSlot};

/// Textures of a material beside its base colour's.
pub(super) const SLOTS: usize = 2;

/// `TextureUse` of shaders/scene/scene.glsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct TextureUse {
    /// 2x2, column by column.
    pub transform: [f32; 4],
    pub offset: [f32; 2],
    /// Texture record, or all ones.
    pub texture: u32,
    /// Of texture coordinates.
    pub set: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct ShadingRecord {
    emission: [f32; 3],
    model: u32,
    metallic: f32,
    roughness: f32,
    ior: f32,
    specular: f32,
    specular_color: [f32; 3],
    emits_back: u32,
    eta: [f32; 3],
    reserved0: f32,
    k: [f32; 3],
    reserved1: f32,
    transmitted: [f32; 3],
    reserved2: f32,
    metallic_roughness_texture: TextureUse,
    emission_texture: TextureUse,
}

const METALLIC_ROUGHNESS: u32 = 0;
const MATTE: u32 = 1;
const MIRROR: u32 = 2;
const GLASS: u32 = 3;
const CONDUCTOR: u32 = 4;
const UNLIT: u32 = 5;

/// Complex index of refraction of a metal at the wavelengths of sRGB's primaries: eta and k of the measurements of Palik's handbook (1985) as
/// Mitsuba and pbrt carry them, integrated to linear sRGB.
fn metal(kind: MaterialKind) -> Option<[[f32; 3]; 2]> {
    match kind {
        MaterialKind::Copper => Some([[0.200_438, 0.924_033, 1.102_212], [3.912_949, 2.452_848, 2.142_188]]),
        MaterialKind::Gold => Some([[0.143_119, 0.374_957, 1.442_479], [3.983_16, 2.385_721, 1.603_215]]),
        _ => None,
    }
}

/// The textures that paths ask for.
pub(super) fn slots(m: &Material) -> [Option<TextureSlot>; SLOTS] {
    [m.metallic_roughness_texture, m.emissive_texture]
}

impl ShadingRecord {
    pub fn new(m: &Material, texture: impl Fn(Option<TextureSlot>) -> TextureUse) -> Self {
        let metal = metal(m.kind);
        let [metallic_roughness_texture, emission_texture] = slots(m).map(texture);
        // the colour of a metal is in its index of refraction already
        let tint = if metal.is_some() { [1.0; 3] } else { m.specular_color.to_array() };
        let specular_color = if m.kind == MaterialKind::MetallicRoughness { m.specular.color.to_array() } else { tint };
        Self {
            emission: m.emissive.to_array(),
            model: match m.kind {
                _ if m.unlit => UNLIT,
                MaterialKind::MetallicRoughness => METALLIC_ROUGHNESS,
                MaterialKind::Matte => MATTE,
                MaterialKind::Mirror => MIRROR,
                MaterialKind::Glass => GLASS,
                MaterialKind::Copper | MaterialKind::Gold => CONDUCTOR,
            },
            metallic: m.metallic,
            roughness: m.roughness,
            ior: m.ior,
            specular: m.specular.factor,
            specular_color,
            emits_back: m.double_sided.into(),
            eta: metal.map_or([0.0; 3], |m| m[0]),
            k: metal.map_or([0.0; 3], |m| m[1]),
            transmitted: m.transmittance.to_array(),
            metallic_roughness_texture,
            emission_texture,
            ..Self::default()
        }
    }
}
