//! What of materials the path tracer gets: `ShadingRecord` of shaders/path/shading.glsl, and which of it the scene asks for at all.

use bytemuck::{Pod, Zeroable};

use super::gpu_scene::Needs;
use super::mipmap::Texels;
use crate::scene::flatten::FlatScene;
use crate::scene::material::MaterialKind;
use crate::scene::{Geometry, Material, TextureSlot};

/// Textures of a material beside its base colour's: `USE_*` of shaders/path/shading.glsl.
pub(super) const SLOTS: usize = 13;

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
    transmission: f32,
    k: [f32; 3],
    coat: f32,
    transmitted: [f32; 3],
    coat_roughness: f32,
    sheen_color: [f32; 3],
    sheen_roughness: f32,
    absorption: [f32; 3],
    walls: u32,
    anisotropy: [f32; 2],
    normal_scale: f32,
    coat_normal_scale: f32,
    glass_layer: u32,
    priority: i32,
    reserved: [u32; 2],
    uses: [TextureUse; SLOTS],
}

const GLTF: u32 = 0;
const MATTE: u32 = 1;
const MIRROR: u32 = 2;
const GLASS: u32 = 3;
const CONDUCTOR: u32 = 4;
const UNLIT: u32 = 5;

const NO_WALLS: u32 = 0;
const THIN_WALLS: u32 = 1;
const VOLUME: u32 = 2;

/// Bits of shaders/bsdf/features.glsl, and what is not compiled where one is absent.
pub(crate) mod feature {
    pub const DIFFUSE: u32 = 1;
    pub const GLTF: u32 = 2;
    pub const CONDUCTOR: u32 = 4;
    pub const GLASS: u32 = 8;
    pub const MIRROR: u32 = 16;
    pub const UNLIT: u32 = 32;
    pub const COAT: u32 = 64;
    pub const SHEEN: u32 = 128;
    pub const THIN_WALLS: u32 = 256;
    pub const VOLUMES: u32 = 512;
    pub const ABSORPTION: u32 = 1024;
    pub const ANISOTROPY: u32 = 2048;
    pub const BASE_COLORS: u32 = 8192;
    pub const EMISSION: u32 = 16384;
    pub const COMPENSATION: u32 = 32768;
    pub const BENT_NORMALS: u32 = 65536;
    /// Every surface counts as white: nothing but Lambert is compiled ([`super::Needs::white`]).
    pub const WHITE: u32 = 131072;
    /// Textures have levels ([`super::Needs::mip_levels`]).
    pub const RAY_CONES: u32 = 262144;

    /// Textures in a slot of [`super::slots`].
    pub const fn texture(slot: usize) -> u32 {
        1 << (19 + slot)
    }

    /// All but textures, in words.
    pub const NAMES: [(u32, &str); 16] = [
        (DIFFUSE, "Lambert"),
        (GLTF, "metallic-roughness"),
        (CONDUCTOR, "measured metals"),
        (GLASS, "glass"),
        (MIRROR, "mirrors"),
        (UNLIT, "unlit surfaces"),
        (COAT, "clearcoat"),
        (SHEEN, "sheen"),
        (THIN_WALLS, "thin walls that transmit"),
        (VOLUMES, "volumes"),
        (ABSORPTION, "absorption"),
        (ANISOTROPY, "anisotropy"),
        (BASE_COLORS, "base colours that vary over a surface"),
        (EMISSION, "emissive surfaces"),
        (COMPENSATION, "energy compensation"),
        (BENT_NORMALS, "interpolated normals"),
    ];

    /// Textures beside base colours', in words, slot by slot.
    pub const TEXTURES: [&str; super::SLOTS] = [
        "metallic-roughness",
        "emissive",
        "normal",
        "clearcoat",
        "clearcoat roughness",
        "clearcoat normal",
        "sheen colour",
        "sheen roughness",
        "transmission",
        "specular",
        "specular colour",
        "anisotropy",
        "occlusion",
    ];
}

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
pub(super) fn slots(m: &Material, needs: Needs) -> [Option<TextureSlot>; SLOTS] {
    if !needs.shading || needs.white {
        return [None; SLOTS];
    }
    [
        m.metallic_roughness_texture,
        m.emissive_texture,
        m.normal_texture,
        m.clearcoat.texture,
        m.clearcoat.roughness_texture,
        m.clearcoat.normal_texture,
        m.sheen.color_texture,
        m.sheen.roughness_texture,
        m.transmission.texture,
        m.specular.texture,
        m.specular.color_texture,
        m.anisotropy.texture,
        m.occlusion_texture.filter(|_| needs.baked_occlusion),
    ]
}

/// What the texture in a slot holds, as shaders/path/shading.glsl reads it.
pub(super) fn texels(slot: usize) -> Texels {
    // emission, colours of sheen and of specular reflection
    if [1, 6, 10].contains(&slot) { Texels::Srgb } else { Texels::Linear }
}

/// Does light pass through it, and how?
fn walls(m: &Material) -> u32 {
    match m.kind {
        MaterialKind::MetallicRoughness if !m.unlit && m.transmission.factor > 0.0 => {
            // an index of 0 has no refraction, and no inside: what it transmits goes straight on
            if m.transmission.thickness > 0.0 && m.ior != 0.0 { VOLUME } else { THIN_WALLS }
        }
        _ => NO_WALLS,
    }
}

/// Is it what bodies are made of that light goes through?
pub(crate) fn is_medium(m: &Material) -> bool {
    refracts(m)
}

/// Does light absorbed in it count?
pub(crate) fn absorbs(m: &Material) -> bool {
    absorption(m).iter().any(|&a| a > 0.0)
}

/// May light go straight through it: walls without thickness that are smooth, or may be where a texture says so?
pub(crate) fn has_clear_walls(m: &Material) -> bool {
    walls(m) == THIN_WALLS && (m.roughness < 0.1 || m.metallic_roughness_texture.is_some())
}

/// Attenuation per world unit.
fn absorption(m: &Material) -> [f32; 3] {
    if walls(m) != VOLUME {
        return [0.0; 3];
    }
    // what absorbs everything at once has no number: the least that single precision holds is left after its distance
    let per_unit = |c: f32| -c.clamp(f32::MIN_POSITIVE, 1.0).ln() / m.transmission.attenuation_distance;
    m.transmission.attenuation_color.to_array().map(per_unit)
}

/// Indices of refraction of all materials that refract, each once: rough ones have tables of albedo ([`super::albedo`]).
pub(super) fn indices_of_refraction(materials: &[Material]) -> Vec<f32> {
    let mut all: Vec<f32> = materials.iter().filter(|m| refracts(m)).map(|m| m.ior).collect();
    all.sort_by(f32::total_cmp);
    all.dedup();
    all
}

fn refracts(m: &Material) -> bool {
    m.kind == MaterialKind::Glass && !m.unlit || walls(m) == VOLUME
}

/// What the materials of a scene ask for: bits of [`feature`].
pub(super) fn features(flat: &FlatScene, needs: Needs) -> u32 {
    let with = |on: bool, bit: u32| if on { bit } else { 0 };
    // under a white sky surfaces are diffuse, whatever they are made of
    let mut bits = feature::DIFFUSE
        | with(needs.compensation, feature::COMPENSATION)
        | with(needs.white, feature::WHITE)
        | with(needs.mip_levels && !needs.white, feature::RAY_CONES);
    for part in flat.groups.iter().flat_map(|g| &g.parts) {
        let mesh = &flat.scene.meshes[part.mesh];
        let m = &flat.scene.materials[mesh.material];
        let bent = |t: &Geometry| matches!(t, Geometry::Triangles(t) if !t.normals.is_empty());
        bits |= with(bent(&mesh.geometry), feature::BENT_NORMALS);
        if needs.white {
            continue;
        }
        let gltf = m.kind == MaterialKind::MetallicRoughness && !m.unlit;
        bits |= match m.kind {
            _ if m.unlit => feature::UNLIT,
            MaterialKind::MetallicRoughness => feature::GLTF,
            MaterialKind::Matte => feature::DIFFUSE,
            MaterialKind::Mirror => feature::MIRROR,
            MaterialKind::Glass => feature::GLASS,
            MaterialKind::Copper | MaterialKind::Gold => feature::CONDUCTOR,
        };
        let normal_maps = m.normal_texture.is_some() || m.clearcoat.factor > 0.0 && m.clearcoat.normal_texture.is_some();
        let varies =
            |g: &Geometry| matches!(g, Geometry::Triangles(t) if !t.colors.is_empty() || m.base_color_texture.is_some());
        let textures = slots(m, needs).map(|t| t.is_some());
        bits |= textures.iter().enumerate().fold(0, |bits, (slot, &there)| bits | with(there, feature::texture(slot)));
        bits |= with(gltf && m.clearcoat.factor > 0.0, feature::COAT)
            | with(gltf && m.sheen.color.max_element() > 0.0, feature::SHEEN)
            | with(walls(m) == THIN_WALLS, feature::THIN_WALLS)
            | with(walls(m) == VOLUME, feature::VOLUMES)
            | with(absorption(m).iter().any(|&a| a > 0.0), feature::ABSORPTION)
            | with(gltf && m.anisotropy.strength > 0.0, feature::ANISOTROPY)
            | with(normal_maps, feature::BENT_NORMALS)
            | with(varies(&mesh.geometry), feature::BASE_COLORS)
            | with(m.emissive.max_element() > 0.0 && !m.unlit, feature::EMISSION);
    }
    bits
}

impl ShadingRecord {
    /// `indices`: those of [`indices_of_refraction`].
    pub fn new(m: &Material, needs: Needs, indices: &[f32], texture: impl Fn(Option<TextureSlot>) -> TextureUse) -> Self {
        let metal = metal(m.kind);
        // the colour of a metal is in its index of refraction already
        let tint = if metal.is_some() { [1.0; 3] } else { m.specular_color.to_array() };
        let specular_color = if m.kind == MaterialKind::MetallicRoughness { m.specular.color.to_array() } else { tint };
        let (sin, cos) = m.anisotropy.rotation.sin_cos();
        Self {
            emission: if m.unlit { [0.0; 3] } else { m.emissive.to_array() },
            model: match m.kind {
                _ if m.unlit => UNLIT,
                MaterialKind::MetallicRoughness => GLTF,
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
            transmission: m.transmission.factor,
            coat: m.clearcoat.factor,
            coat_roughness: m.clearcoat.roughness,
            sheen_color: m.sheen.color.to_array(),
            sheen_roughness: m.sheen.roughness,
            absorption: absorption(m),
            walls: walls(m),
            anisotropy: [m.anisotropy.strength * cos, m.anisotropy.strength * sin],
            normal_scale: m.normal_scale,
            coat_normal_scale: m.clearcoat.normal_scale,
            glass_layer: indices.iter().position(|&ior| ior == m.ior).unwrap_or(0) as u32,
            priority: m.dielectric_priority,
            reserved: [0; 2],
            uses: slots(m, needs).map(texture),
        }
    }
}
