//! Baked values in the model's own file: occlusion textures of materials, or colours of vertices.

use std::path::{Path, PathBuf};

use super::map::BakedMap;
use super::picture::{self, Bits};
use super::plan::PlannedTexture;
use super::vertices::{BakedVertices, colors};
use super::{BakeSettings, pack};
use crate::error::Result;
use crate::files;
use crate::scene::Scene;
use crate::scene::export::amend::{AmendedFile, NewVertices, companions};

/// How the images of textures are made.
#[derive(Clone, Copy, Debug, Default)]
pub struct TextureImages {
    /// Bits of a channel of those that are not packed.
    pub bits: Bits,
    /// Roughness and metalness share the texture, where they lie by the same coordinates.
    pub are_packed: bool,
}

/// Name of the texture of a planned texture's material.
pub fn texture_name(texture: &PlannedTexture) -> String {
    format!("{}-occlusion", files::portable_name(&texture.name))
}

/// The files beside a `.gltf` that [`save_textures`] writes.
pub fn texture_companions(path: &Path, textures: &[PlannedTexture]) -> Vec<PathBuf> {
    companions(path, &textures.iter().map(texture_name).collect::<Vec<_>>())
}

/// Writes a model whose materials have these occlusion textures; returns the files. `scene`: the
/// one that was read from it.
///
/// # Errors
/// Those of [`AmendedFile`].
pub fn save_textures(
    mut file: AmendedFile,
    scene: &Scene,
    baked: &[(PlannedTexture, BakedMap)],
    settings: &BakeSettings,
    images: TextureImages,
    path: &Path,
) -> Result<Vec<PathBuf>> {
    for (texture, map) in baked {
        // new vertices, where coordinates were made
        for mesh in &texture.unwrapped {
            let [index, primitive] = mesh.primitive;
            let texcoords = (&mesh.texcoords[..], texture.texcoord);
            file.replace_vertices(
                index,
                primitive,
                &NewVertices { sources: &mesh.sources, triangles: &mesh.triangles, texcoords },
            )?;
        }

        // the texture, of the primitives' material
        let partner = images.are_packed.then(|| pack::partner(scene, texture).ok()).flatten();
        let png = match partner {
            Some(partner) => pack::png(map, partner)?,
            None => picture::png(map, settings, images.bits)?,
        };
        let index = file.add_texture(&texture_name(texture), png, texture.repeats());
        let material = match texture.material {
            Some(material) => material,
            None => {
                let material = file.add_material(&texture.name);
                for source in texture.surfaces.iter().filter_map(|s| scene.meshes[s.mesh].source.as_ref()) {
                    file.set_material(source.mesh, source.primitive, material)?;
                }
                material
            }
        };
        file.set_occlusion(material, index, texture.texcoord)?;
        if partner.is_some() {
            file.set_metallic_roughness(material, index, texture.texcoord)?;
        }
    }
    file.save(path)
}

/// Writes a model whose vertices have these values as colours; returns the files.
///
/// # Errors
/// Those of [`AmendedFile`].
pub fn save_vertices(mut file: AmendedFile, baked: &[BakedVertices], path: &Path) -> Result<Vec<PathBuf>> {
    for mesh in baked {
        let [index, primitive] = mesh.primitive;
        file.set_colors(index, primitive, &colors(&mesh.values))?;
    }
    file.save(path)
}
