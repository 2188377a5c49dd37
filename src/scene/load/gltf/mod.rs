//! glTF 2.0: `.gltf` with external files or data URIs, and `.glb`.
//!
//! The JSON is read by a schema of our own, because the extensions we want are not in any crate's and its validation
//! would refuse quantised meshes; accessors are read by our own reader, which checks every range.

mod accessor;
mod container;
mod material;
mod mesh;
mod node;
mod schema;
mod texture;
mod uri;

use std::collections::BTreeMap;
use std::path::Path;

use accessor::Reader;
use schema::Document;

use super::compact;
use crate::error::{Error, Result};
use crate::scene::{Geometry, Instance, Mesh, Scene};

/// Extensions that are read, or that mean nothing to a still image.
const KNOWN: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Reads a `.gltf` or `.glb` file.
pub(super) fn read(path: &Path) -> Result<Scene> {
    let file = std::fs::read(path).map_err(|e| Error::read(path, &e))?;
    let chunks = container::split(&file, path)?;
    let document = container::document(chunks.json, path)?;
    let buffers = container::buffers(&document, chunks.bin, path)?;
    let reader = Reader { document: &document, buffers: &buffers };

    let mut scene = Scene::default();
    extensions(&document, path, &mut scene)?;
    if !document.animations.is_empty() {
        scene.report.warnings.push("animations are not played: the rest pose is shown".to_owned());
    }
    let placed = node::place(&document).map_err(|e| Error::input(path, e))?;

    let mut warnings = Vec::new();
    scene.materials = document.materials.iter().map(material::Material::to_scene).collect();
    scene.textures = texture::resolve(&reader, path, &mut scene.materials, &mut |w| warnings.push(w));

    let mut meshes = Meshes { reader: &reader, path, primitives: BTreeMap::new(), default_material: None };
    for placed in &placed {
        let node = &document.nodes[placed.node];
        if let Some(index) = node.mesh {
            if node.skin.is_some() {
                warnings.push(format!("node {} `{}` has a skin: its rest shape is shown", placed.node, node.name));
            }
            for mesh in meshes.of(index, &mut scene, &mut warnings)? {
                scene.instances.push(Instance { name: node.name.clone(), mesh, object_to_world: placed.to_world });
            }
        }
        if let Some(index) = node.camera {
            match node::camera(&document, placed, index) {
                Ok(camera) => scene.cameras.push(camera),
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
        if let Some(light) = &node.extensions.light {
            match node::light(&document, placed, light.light) {
                Ok(light) => scene.lights.push(light),
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
    }
    scene.report.warnings.append(&mut warnings);
    Ok(scene)
}

/// Refuses files that need what we do not have, and notes what is left out of others.
fn extensions(document: &Document, path: &Path, scene: &mut Scene) -> Result<()> {
    let unknown = |names: &[String]| names.iter().find(|n| !KNOWN.contains(&n.as_str())).cloned();
    if let Some(name) = unknown(&document.extensions_required) {
        let remedy = match name.as_str() {
            "KHR_draco_mesh_compression" | "EXT_meshopt_compression" => "export the file without mesh compression",
            "KHR_texture_basisu" | "EXT_texture_webp" => "export the file with PNG or JPEG textures",
            _ => "export the file without it",
        };
        return Err(Error::input(path, format!("needs the extension {name}, which skylit does not have: {remedy}")));
    }
    for name in document.extensions_used.iter().filter(|n| !KNOWN.contains(&n.as_str())) {
        scene.report.warnings.push(format!("the extension {name} is ignored"));
    }
    Ok(())
}

/// Reads each mesh that is placed, once.
struct Meshes<'a> {
    reader: &'a Reader<'a>,
    path: &'a Path,
    /// The scene's meshes of each glTF mesh.
    primitives: BTreeMap<usize, Vec<usize>>,
    /// The scene's material for primitives without one.
    default_material: Option<usize>,
}

impl Meshes<'_> {
    fn of(&mut self, index: usize, scene: &mut Scene, warnings: &mut Vec<String>) -> Result<Vec<usize>> {
        if let Some(known) = self.primitives.get(&index) {
            return Ok(known.clone());
        }
        let meshes = &self.reader.document.meshes;
        let mesh = meshes.get(index).ok_or_else(|| Error::input(self.path, format!("mesh {index} does not exist")))?;
        let mut made = Vec::new();
        for (nth, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {index} `{}`, primitive {nth}", mesh.name);
            let material = match primitive.material {
                Some(m) if m < scene.materials.len() && m < self.reader.document.materials.len() => m,
                Some(m) => return Err(Error::input(self.path, format!("{place}: material {m} does not exist"))),
                None => *self.default_material.get_or_insert_with(|| {
                    scene.materials.push(material::default_material());
                    scene.materials.len() - 1
                }),
            };
            if !primitive.targets.is_empty() {
                warnings.push(format!("{place} has morph targets: its rest shape is shown"));
            }
            let tangents = scene.materials[material].needs_tangents();
            let read = mesh::read(self.reader, primitive, tangents, &mut |w| warnings.push(format!("{place} {w}")));
            if let Some(mut triangles) = read.map_err(|e| Error::input(self.path, format!("{place}: {e}")))? {
                let name = if mesh.primitives.len() == 1 { mesh.name.clone() } else { format!("{}#{nth}", mesh.name) };
                compact::compact(&mut triangles);
                made.push(scene.meshes.len());
                scene.meshes.push(Mesh { name, geometry: Geometry::Triangles(triangles), material });
            }
        }
        self.primitives.insert(index, made.clone());
        Ok(made)
    }
}
