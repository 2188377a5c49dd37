//! Baked values in the model's own file: occlusion textures of materials, or colours of vertices.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::map::BakedMap;
use super::picture::{self, Bits};
use super::plan::{PlannedMaterial, PlannedTexture, Surface};
use super::vertices::{BakedVertices, colors};
use super::{BakeSettings, pack};
use crate::error::{Error, Result};
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

/// Name of a planned texture in the file.
pub fn texture_name(texture: &PlannedTexture) -> String {
    let placement = texture.placement.map_or_else(String::new, |k| format!("-{}", k + 1));
    format!("{}{placement}-occlusion", files::portable_name(&texture.name))
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
    // new vertices, where coordinates were made: copies of meshes have them, too
    for (texture, mesh) in baked.iter().flat_map(|(texture, _)| texture.unwrapped.iter().map(move |m| (texture, m))) {
        let [index, primitive] = mesh.primitive;
        let texcoords = (&mesh.texcoords[..], texture.texcoord);
        file.replace_vertices(
            index,
            primitive,
            &NewVertices { sources: &mesh.sources, triangles: &mesh.triangles, texcoords },
        )?;
    }

    // textures, of the primitives' materials
    let mut copies = MeshCopies::default();
    for (texture, map) in baked {
        let partner = images.are_packed.then(|| pack::partner(scene, texture).ok()).flatten();
        let png = match partner {
            Some(partner) => pack::png(map, partner)?,
            None => picture::png(map, settings, images.bits)?,
        };
        let index = file.add_texture(&texture_name(texture), png, texture.repeats());
        for (number, shown) in texture.materials.iter().enumerate() {
            // that of the file, or one more: where it has none, and of further instances
            let copy = texture.placement.filter(|k| *k > 0).map(|k| format!("{}-{}", shown.name, k + 1));
            let material = match (shown.index, &copy) {
                (Some(material), None) => material,
                (Some(material), Some(name)) => file.copy_material(material, name)?,
                (None, name) => file.add_material(name.as_ref().unwrap_or(&shown.name)),
            };
            if shown.index != Some(material) {
                for surface in texture.surfaces.iter().filter(|surface| surface.material == number) {
                    let Some(source) = scene.meshes[surface.mesh].source.as_ref() else { continue };
                    let mesh = if copy.is_some() { copies.of_surface(&mut file, scene, surface)? } else { source.mesh };
                    file.set_material(mesh, source.primitive, material)?;
                }
            }
            file.set_occlusion(material, index, texture.texcoord)?;
            if partner.is_some() {
                file.set_metallic_roughness(material, index, texture.texcoord)?;
            }
        }
    }
    file.save(path)
}

/// Meshes of the file that were copied for nodes of further instances.
#[derive(Default)]
struct MeshCopies {
    /// Indices of the copies, by node.
    by_node: BTreeMap<usize, usize>,
}

impl MeshCopies {
    /// Index of the copy for the node of a surface, which is made where there is none.
    fn of_surface(&mut self, file: &mut AmendedFile, scene: &Scene, surface: &Surface) -> Result<usize> {
        let node = surface.instances.first().and_then(|instance| scene.report.instance_nodes.get(*instance));
        let node = *node.ok_or_else(|| Error::Scene(format!("{}: an instance has no node", scene.name)))?;
        if let Some(known) = self.by_node.get(&node) {
            return Ok(*known);
        }
        let made = file.copy_mesh_of_node(node)?;
        self.by_node.insert(node, made);
        Ok(made)
    }
}

/// Sentences on materials of which further instances get copies that something in the file does
/// not reach.
pub fn remarks_on_copies(file: &AmendedFile, textures: &[PlannedTexture]) -> Vec<String> {
    let copied = textures.iter().filter(|texture| texture.placement == Some(1)).flat_map(|texture| &texture.materials);
    let animated = copied.filter(|material| material.index.is_some_and(|index| file.is_animated(index)));
    let remark = |m: &PlannedMaterial| {
        format!("an animation of material `{}` changes its first instance alone: the others have copies of it", m.name)
    };
    animated.map(remark).collect()
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
