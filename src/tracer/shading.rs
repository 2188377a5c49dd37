//! Materials for the path tracer: their [`ShadingRecord`], and the shader features that the scene
//! requires.

use super::needs::Needs;
use crate::accel::flatten::FlatScene;
use crate::interface::records::scene::TextureUse;
use crate::interface::records::shading::ShadingRecord;
use crate::interface::{
    BsdfModel, BsdfModels, MaterialFeature, MaterialFeatures, ShadingFeatures, TextureFeature, TextureFeatures,
    TransmissionMode,
};
use crate::scene::material::MaterialKind;
use crate::scene::{Geometry, Material, TextureSlot};

// shaders/path/shading.glsl loads the first four words together
const _: () =
    assert!(std::mem::offset_of!(ShadingRecord, emission) == 0 && std::mem::offset_of!(ShadingRecord, model) == 12);

/// Number of textures of a material beside that of the base colour, in the order of
/// [`TextureFeature`].
pub(super) const SLOTS: usize = TextureFeature::ALL.len();

/// Complex index of refraction of a conductor at the wavelengths of sRGB's primaries: eta and k of
/// the measurements of Palik's handbook (1985) as Mitsuba and pbrt carry them, integrated to linear
/// sRGB.
fn metal(kind: MaterialKind) -> Option<[[f32; 3]; 2]> {
    match kind {
        MaterialKind::Copper => Some([[0.200_438, 0.924_033, 1.102_212], [3.912_949, 2.452_848, 2.142_188]]),
        MaterialKind::Gold => Some([[0.143_119, 0.374_957, 1.442_479], [3.983_16, 2.385_721, 1.603_215]]),
        _ => None,
    }
}

/// The BSDF of a material; `None` for an unlit one.
fn model(m: &Material) -> Option<BsdfModel> {
    match m.kind {
        _ if m.unlit => None,
        MaterialKind::Matte | MaterialKind::MetallicRoughness
            if m.parameter("sigma").is_some_and(|sigma| sigma > 0.0) =>
        {
            Some(BsdfModel::OrenNayar)
        }
        MaterialKind::MetallicRoughness => Some(BsdfModel::Gltf),
        MaterialKind::Matte => Some(BsdfModel::Diffuse),
        MaterialKind::Mirror => Some(BsdfModel::Mirror),
        MaterialKind::Glass => Some(BsdfModel::Dielectric),
        MaterialKind::Copper | MaterialKind::Gold => Some(BsdfModel::Conductor),
    }
}

/// Parameters of a BSDF beyond the common ones.
fn parameters(m: &Material) -> [f32; 2] {
    match model(m) {
        Some(BsdfModel::OrenNayar) => [m.parameter("sigma").unwrap_or(0.0).clamp(0.0, 1.0), 0.0],
        _ => [0.0; 2],
    }
}

/// The textures that the path tracer uses, in the order of [`TextureFeature`].
pub(super) fn slots(m: &Material, needs: Needs) -> [Option<TextureSlot>; SLOTS] {
    if !needs.shading || needs.white {
        return [None; SLOTS];
    }
    std::array::from_fn(|k| match TextureFeature::ALL[k] {
        TextureFeature::Occlusion if !needs.baked_occlusion => None,
        feature => feature.slot(m),
    })
}

impl TextureFeature {
    /// The texture that a material has of this kind.
    fn slot(self, m: &Material) -> Option<TextureSlot> {
        match self {
            Self::MetallicRoughness => m.metallic_roughness_texture,
            Self::Emission => m.emissive_texture,
            Self::Normal => m.normal_texture,
            Self::Clearcoat => m.clearcoat.texture,
            Self::ClearcoatRoughness => m.clearcoat.roughness_texture,
            Self::ClearcoatNormal => m.clearcoat.normal_texture,
            Self::SheenColor => m.sheen.color_texture,
            Self::SheenRoughness => m.sheen.roughness_texture,
            Self::Transmission => m.transmission.texture,
            Self::Specular => m.specular.texture,
            Self::SpecularColor => m.specular.color_texture,
            Self::Anisotropy => m.anisotropy.texture,
            Self::Occlusion => m.occlusion_texture,
            Self::Iridescence => m.iridescence.texture,
            Self::IridescenceThickness => m.iridescence.thickness_texture,
            Self::DiffuseTransmission => m.diffuse_transmission.texture,
            Self::DiffuseTransmissionColor => m.diffuse_transmission.color_texture,
            Self::Retroreflection => m.retroreflection.texture,
        }
    }
}

/// Beyond this mean cosine the phase function is narrower than single precision samples it.
const MAX_ANISOTROPY: f32 = 0.999;

/// Whether and how the material transmits light: not at all, through a thin wall, or into a volume.
fn walls(m: &Material) -> TransmissionMode {
    match m.kind {
        MaterialKind::MetallicRoughness
            if !m.unlit && (m.transmission.factor > 0.0 || m.diffuse_transmission.factor > 0.0) =>
        {
            // glTF's index of refraction 0 does not refract: such a material transmits straight on,
            // as a thin wall
            if m.transmission.thickness > 0.0 && m.ior != 0.0 {
                TransmissionMode::Volume
            } else if m.transmission.factor > 0.0 {
                TransmissionMode::Thin
            } else {
                TransmissionMode::Opaque
            }
        }
        _ => TransmissionMode::Opaque,
    }
}

/// Whether the material bounds a volume that refracts light.
pub(crate) fn is_medium(m: &Material) -> bool {
    refracts(m)
}

/// Whether the volume absorbs light.
pub(crate) fn absorbs(m: &Material) -> bool {
    absorption(m).iter().any(|&a| a > 0.0)
}

/// Whether the volume scatters light.
pub(crate) fn scatters(m: &Material) -> bool {
    absorbs(m) && m.volume_scatter.color.max_element() > 0.0
}

/// The albedo of a single scattering by that of many (Kulla and Conty, "Revisiting Physically Based
/// Shading at Imageworks", SIGGRAPH 2017 course; KHR_materials_volume_scatter).
fn scattered(m: &Material) -> [f32; 3] {
    let single = |many: f32| {
        let many = f64::from(many);
        let s = 4.09712 + 4.20863 * many - (9.59217 + 41.6808 * many + 17.7126 * many * many).sqrt();
        // the fit is a little off at both ends
        if many <= 0.0 {
            0.0
        } else if many >= 1.0 {
            1.0
        } else {
            (1.0 - s * s).clamp(0.0, 1.0) as f32
        }
    };
    m.volume_scatter.color.to_array().map(single)
}

/// Whether the index of refraction of the volume depends on the wavelength.
pub(crate) fn disperses(m: &Material) -> bool {
    cauchy(m) > 0.0
}

/// The coefficient B of Cauchy's equation n = A + B / wavelength^2 in square micrometres, by the
/// Abbe number (n_d - 1) / (n_F - n_C) and Fraunhofer's lines F and C (KHR_materials_dispersion).
fn cauchy(m: &Material) -> f32 {
    const F_LINE: f32 = 0.4861;
    const C_LINE: f32 = 0.6563;
    if walls(m) != TransmissionMode::Volume {
        return 0.0;
    }
    (m.ior - 1.0).max(0.0) * (m.dispersion / 20.0) / (F_LINE.powi(-2) - C_LINE.powi(-2))
}

/// Whether light may pass straight through: a thin wall that is smooth, or that a roughness texture
/// may make smooth.
pub(crate) fn has_clear_walls(m: &Material) -> bool {
    walls(m) == TransmissionMode::Thin && (m.roughness < 0.1 || m.metallic_roughness_texture.is_some())
}

/// Absorption coefficient per scene unit (metres in glTF).
fn absorption(m: &Material) -> [f32; 3] {
    if walls(m) != TransmissionMode::Volume {
        return [0.0; 3];
    }
    // a colour of 0 would need an infinite coefficient: the smallest positive float stands for it
    let per_unit = |c: f32| -c.clamp(f32::MIN_POSITIVE, 1.0).ln() / m.transmission.attenuation_distance;
    m.transmission.attenuation_color.to_array().map(per_unit)
}

/// The distinct indices of refraction of all refracting materials: each has an albedo table
/// ([`super::albedo`]).
pub(super) fn indices_of_refraction(flat: &FlatScene) -> Vec<f32> {
    let states = (0..flat.scene.materials.len()).flat_map(|k| flat.motion.states(flat.scene, k));
    let mut all: Vec<f32> = states.filter(|m| refracts(m)).map(|m| m.ior).collect();
    all.sort_by(f32::total_cmp);
    all.dedup();
    all
}

fn refracts(m: &Material) -> bool {
    m.kind == MaterialKind::Glass && !m.unlit || walls(m) == TransmissionMode::Volume
}

/// Shader features that the materials of a scene require of the path tracer.
pub(super) fn features(flat: &FlatScene, needs: Needs) -> ShadingFeatures {
    // in the white-furnace mode every surface is diffuse
    let mut bsdfs: BsdfModels = [BsdfModel::Diffuse].into_iter().collect();
    let mut materials = MaterialFeatures::default();
    let mut textures = TextureFeatures::default();
    materials.insert_if(needs.compensation, MaterialFeature::Compensation);
    materials.insert_if(needs.white, MaterialFeature::White);
    materials.insert_if(needs.mip_levels && !needs.white, MaterialFeature::RayCones);

    // features that some visible surface uses
    for part in flat.groups.iter().flat_map(|g| &g.submeshes) {
        let mesh = &flat.scene.meshes[part.mesh];
        let has_normals = matches!(&mesh.geometry, Geometry::Triangles(t) if !t.normals.is_empty());
        materials.insert_if(has_normals, MaterialFeature::ShadingNormals);
        if needs.white {
            continue;
        }
        for m in flat.motion.states(flat.scene, mesh.material) {
            let gltf = m.kind == MaterialKind::MetallicRoughness && !m.unlit;
            match model(m) {
                Some(model) => bsdfs.insert(model),
                None => materials.insert(MaterialFeature::Unlit),
            }

            // a feature is compiled in only if a material needs it
            let normal_maps =
                m.normal_texture.is_some() || m.clearcoat.factor > 0.0 && m.clearcoat.normal_texture.is_some();
            let separate = matches!(&mesh.geometry, Geometry::Triangles(t) if !t.clearcoat_tangents.is_empty() || !t.anisotropy_tangents.is_empty());
            let has_colors = matches!(&mesh.geometry, Geometry::Triangles(t) if !t.colors.is_empty());
            let varies = has_colors || m.base_color_texture.is_some();
            for (slot, &feature) in slots(m, needs).iter().zip(TextureFeature::ALL) {
                textures.insert_if(slot.is_some(), feature);
            }
            for (required, feature) in [
                (gltf && m.clearcoat.factor > 0.0, MaterialFeature::Clearcoat),
                (gltf && m.sheen.color.max_element() > 0.0, MaterialFeature::Sheen),
                (walls(m) == TransmissionMode::Thin, MaterialFeature::ThinWalls),
                (walls(m) == TransmissionMode::Volume, MaterialFeature::Volumes),
                (absorbs(m), MaterialFeature::Absorption),
                (gltf && m.anisotropy.strength > 0.0, MaterialFeature::Anisotropy),
                (gltf && m.iridescence.factor > 0.0, MaterialFeature::Iridescence),
                (gltf && m.diffuse_transmission.factor > 0.0, MaterialFeature::DiffuseTransmission),
                (gltf && m.retroreflection.factor > 0.0, MaterialFeature::Retroreflection),
                (disperses(m), MaterialFeature::Dispersion),
                (scatters(m), MaterialFeature::Scattering),
                (normal_maps, MaterialFeature::ShadingNormals),
                (separate, MaterialFeature::SeparateTangents),
                (varies, MaterialFeature::BaseColors),
                (m.emissive.max_element() > 0.0 && !m.unlit, MaterialFeature::Emission),
            ] {
                materials.insert_if(required, feature);
            }
        }
    }
    ShadingFeatures { bsdfs, materials, textures }
}

/// Whether a tracer and its passes that were built for a scene with the material `before` can show
/// it as `after`: it needs nothing else of shaders, structures and lists of lights. `may_emit`: the
/// lists of lights allow for another emission.
pub(crate) fn is_shown_alike(before: &Material, after: &Material, may_emit: bool) -> bool {
    let [was_dark, is_dark] = [before, after].map(|m| m.emissive.max_element() <= 0.0);
    let shape = |m: &Material| (model(m), walls(m), refracts(m), has_clear_walls(m), m.unlit, m.base_color.w);
    was_dark == is_dark && (is_dark || may_emit) && shape(before) == shape(after)
}

/// Position of the index of refraction that is nearest to one: between keys of an animation there
/// is no table of its own.
fn nearest(indices: &[f32], ior: f32) -> u32 {
    let distance = |k: &usize| (indices[*k] - ior).abs();
    (0..indices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0) as u32
}

/// The record of a material. `indices`: those of [`indices_of_refraction`].
pub(super) fn record(
    m: &Material,
    needs: Needs,
    indices: &[f32],
    texture: impl Fn(Option<TextureSlot>) -> TextureUse,
) -> ShadingRecord {
    let metal = metal(m.kind);

    // the colour of a conductor is in its index of refraction already
    let tint = if metal.is_some() { [1.0; 3] } else { m.specular_color.to_array() };
    let specular_color = if m.kind == MaterialKind::MetallicRoughness { m.specular.color.to_array() } else { tint };
    let (sin, cos) = m.anisotropy.rotation.sin_cos();
    ShadingRecord {
        emission: if m.unlit { [0.0; 3] } else { m.emissive.to_array() },
        model: model(m).map_or(0, BsdfModel::number),
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
        clearcoat: m.clearcoat.factor,
        clearcoat_roughness: m.clearcoat.roughness,
        sheen_color: m.sheen.color.to_array(),
        sheen_roughness: m.sheen.roughness,
        absorption: absorption(m),
        walls: walls(m) as u32,
        anisotropy: [m.anisotropy.strength * cos, m.anisotropy.strength * sin],
        normal_scale: m.normal_scale,
        clearcoat_normal_scale: m.clearcoat.normal_scale,
        glass_layer: nearest(indices, m.ior),
        priority: m.dielectric_priority,
        parameters: parameters(m),
        occlusion_strength: m.occlusion_strength,
        iridescence: m.iridescence.factor,
        iridescence_thickness: m.iridescence.thickness,
        iridescence_ior: m.iridescence.ior,
        diffuse_transmission: m.diffuse_transmission.factor,
        diffuse_transmission_color: m.diffuse_transmission.color.to_array(),
        retroreflection: m.retroreflection.factor,
        dispersion: cauchy(m),
        scatter_anisotropy: m.volume_scatter.anisotropy.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY),
        scattered: scattered(m),
        reserved: 0,
        uses: slots(m, needs).map(texture),
    }
}
