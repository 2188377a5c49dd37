//! Textures and their mip levels in device memory, and how records refer to them.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use super::mipmap;
use super::needs::Needs;
use super::shading;
use super::upload::concatenate;
use crate::accel::features::{Blend, alpha_cutoff};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::gpu::{Buffer, Device};
use crate::interface::records::ray::INVALID;
use crate::interface::records::scene::{MaterialRecord, MipRecord, TextureRecord, TextureUse};
use crate::interface::{TexelFormat, Texels, TextureFeature};
use crate::scene::{AlphaMode, Filter, Material, TexelData, TextureSlot};

/// The textures that are used, in one buffer.
pub(super) struct Textures {
    pub texels: Buffer,
    pub records: Vec<TextureRecord>,
    pub slots: TextureSlots,
    pub mips: Option<Mips>,
}

/// The record of each texture of the scene, by which materials refer to it.
#[derive(Clone)]
pub(super) struct TextureSlots {
    record_of: Vec<u32>,
}

/// Mip levels of textures, in one buffer.
pub(super) struct Mips {
    pub texels: Buffer,
    pub records: Vec<MipRecord>,
}

impl Mips {
    /// Makes the levels of the used textures, for each use of a texture (`uses`, by [`Texels`]).
    fn upload(device: &Arc<Device>, flat: &FlatScene, used: &[usize], uses: &[[bool; 3]]) -> Result<Self> {
        let texture = |t: usize| &flat.scene.textures[t];
        let mut records: Vec<_> = used.iter().map(|&t| mipmap::record([texture(t).width, texture(t).height])).collect();
        // textures that share an image share its levels, too
        let mut pyramids: Vec<Cow<[u8]>> = Vec::new();
        let mut pyramid_of = HashMap::new();
        let mut destinations = Vec::new();
        for (k, (&t, uses)) in used.iter().zip(uses).enumerate() {
            for texels in Texels::ALL.into_iter().filter(|&texels| uses[texels as usize]) {
                let pyramid = *pyramid_of.entry((texture(t).texels.as_bytes().as_ptr(), texels)).or_insert_with(|| {
                    pyramids.push(Cow::Owned(mipmap::pyramid(texture(t), texels)));
                    pyramids.len() - 1
                });
                destinations.push((k, texels, pyramid));
            }
        }
        let (texels, addresses) = concatenate(device, "mip levels", &pyramids)?;
        for (k, texels, pyramid) in destinations {
            records[k].texels[texels as usize] = addresses[pyramid];
        }
        Ok(Self { texels, records })
    }
}

impl Textures {
    /// Writes the textures that `needs` and the materials require.
    pub fn upload(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        // which textures are used, and how
        let mut record_of = vec![INVALID; flat.scene.textures.len()];
        let (mut used, mut uses) = (Vec::new(), Vec::new());
        for part in flat.groups.iter().flat_map(|g| &g.submeshes) {
            let material = &flat.scene.materials[flat.scene.meshes[part.mesh].material];
            let base = material.base_color_texture.filter(|_| needs.albedo || part.alpha_tested);
            let base_texels = if alpha_cutoff(material).is_some() { Texels::Covered } else { Texels::Srgb };
            let slots = shading::slots(material, needs);
            let slots = slots.into_iter().zip(TextureFeature::ALL).map(|(slot, feature)| (slot, feature.texels()));
            for (slot, texels) in slots.chain([(base, base_texels)]) {
                let Some(slot) = slot else { continue };
                if record_of[slot.texture] == INVALID {
                    record_of[slot.texture] = used.len() as u32;
                    used.push(slot.texture);
                    uses.push([false; 3]);
                }
                uses[record_of[slot.texture] as usize][texels as usize] = true;
            }
        }

        // their images: two textures may share one, which is stored once
        let mut images: Vec<Cow<[u8]>> = Vec::new();
        let mut image_of = HashMap::new();
        let mut image = Vec::new();
        for &t in &used {
            let texture = &flat.scene.textures[t];
            image.push(*image_of.entry(texture.texels.as_bytes().as_ptr()).or_insert_with(|| {
                images.push(Cow::Borrowed(texture.texels.as_bytes()));
                images.len() - 1
            }));
        }
        let (texels, addresses) = concatenate(device, "texels", &images)?;

        // their records and mip levels
        let records = used
            .iter()
            .zip(image)
            .map(|(&t, image)| {
                let texture = &flat.scene.textures[t];
                TextureRecord {
                    texels: addresses[image],
                    width: texture.width,
                    height: texture.height,
                    wrap_u: texture.wrap[0] as u32,
                    wrap_v: texture.wrap[1] as u32,
                    nearest: (texture.filter == Filter::Nearest) as u32,
                    format: match texture.texels {
                        TexelData::Unorm8(_) => TexelFormat::Unorm8,
                        TexelData::Unorm16(_) => TexelFormat::Unorm16,
                        TexelData::Float(_) => TexelFormat::Float,
                    } as u32,
                }
            })
            .collect();
        let has_mips = needs.mip_levels && needs.shading && !needs.white && !used.is_empty();
        let mips = if has_mips { Some(Mips::upload(device, flat, &used, &uses)?) } else { None };
        Ok(Self { texels, records, slots: TextureSlots { record_of }, mips })
    }
}

impl TextureSlots {
    /// The record of an uploaded texture's use; without a texture, one that reads 1 everywhere.
    pub fn slot(&self, slot: Option<TextureSlot>) -> TextureUse {
        match slot {
            Some(s) => TextureUse {
                transform: s.transform.matrix2.to_cols_array(),
                offset: s.transform.translation.to_array(),
                texture: self.record_of[s.texture],
                set: s.texcoord as u32,
            },
            None => TextureUse { transform: [1.0, 0.0, 0.0, 1.0], offset: [0.0; 2], texture: INVALID, set: 0 },
        }
    }

    /// The record of a material's base colour and alpha.
    pub fn material(&self, m: &Material, blend: Blend) -> MaterialRecord {
        let slot = m.base_color_texture.filter(|s| self.record_of[s.texture] != INVALID);
        let transform = slot.map_or(glam::Affine2::IDENTITY, |s| s.transform);
        MaterialRecord {
            base_color: m.base_color.to_array(),
            texcoord_transform: transform.matrix2.to_cols_array(),
            texcoord_offset: transform.translation.to_array(),
            base_color_texture: slot.map_or(INVALID, |s| self.record_of[s.texture]),
            texcoord_set: slot.map_or(0, |s| s.texcoord as u32),
            alpha_cutoff: alpha_cutoff(m).unwrap_or(-1.0),
            coverage: (blend == Blend::Stochastic && m.alpha_mode == AlphaMode::Blend).into(),
            ..Default::default()
        }
    }
}
