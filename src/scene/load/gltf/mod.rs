//! glTF 2.0: `.gltf` with external files or data URIs, and `.glb`.
//!
//! The crate `gltf` reads the JSON and takes `.glb` files apart. Its validation is left out: it would refuse quantised
//! meshes and every extension that it does not know. Hence indices are checked where they are used, values that it calls
//! invalid are told where they matter, extensions that it does not model come from the maps in which it keeps them, and
//! accessors are read by a reader of our own, which checks every range.
//!
//! <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>

mod accessor;
mod container;
mod material;
mod mesh;
mod node;
mod texture;
mod uri;

use std::collections::BTreeMap;
use std::path::Path;

use ::gltf::json::accessor::Accessor;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root};

use accessor::Reader;

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

type AccessorIndex = Index<Accessor>;

/// What the crate could make sense of.
fn valid<T>(checked: Checked<T>) -> Option<T> {
    match checked {
        Checked::Valid(value) => Some(value),
        Checked::Invalid => None,
    }
}

/// An optional name, or none.
fn text(name: &Option<String>) -> &str {
    name.as_deref().unwrap_or_default()
}

/// Reads a `.gltf` or `.glb` file.
pub(super) fn read(path: &Path) -> Result<Scene> {
    let file = std::fs::read(path).map_err(|e| Error::read(path, &e))?;
    let chunks = container::split(&file, path)?;
    let (document, doubles) = container::document(&chunks.json, path)?;
    let buffers = container::buffers(&document, chunks.bin.as_deref(), path)?;
    let reader = Reader { document: &document, buffers: &buffers };

    let mut scene = Scene::default();
    extensions(&document, path, &mut scene)?;
    if !document.animations.is_empty() {
        scene.report.warnings.push("animations are not played: the rest pose is shown".to_owned());
    }
    let placed = node::place(&document, &doubles).map_err(|e| Error::input(path, e))?;

    let mut warnings = Vec::new();
    let material = |(i, m)| material::convert(m).map_err(|e| Error::input(path, format!("material {i}: {e}")));
    scene.materials = document.materials.iter().enumerate().map(material).collect::<Result<_>>()?;
    scene.textures = texture::resolve(&reader, path, &mut scene.materials, &mut |w| warnings.push(w));

    let mut meshes = Meshes { reader: &reader, path, primitives: BTreeMap::new(), default_material: None };
    for placed in &placed {
        let node = &document.nodes[placed.node];
        let name = text(&node.name);
        if let Some(index) = node.mesh {
            if node.skin.is_some() {
                warnings.push(format!("node {} `{name}` has a skin: its rest shape is shown", placed.node));
            }
            for mesh in meshes.of(index.value(), &mut scene, &mut warnings)? {
                scene.instances.push(Instance { name: name.to_owned(), mesh, object_to_world: placed.to_world });
            }
        }
        if let Some(index) = node.camera {
            match node::camera(&document, &doubles, placed, index.value()) {
                Ok(camera) => scene.cameras.push(camera),
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            match node::light(&document, placed, light.light.value()) {
                Ok(light) => scene.lights.push(light),
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
    }
    scene.report.warnings.append(&mut warnings);
    Ok(scene)
}

/// Refuses files that need what we do not have, and notes what is left out of others.
fn extensions(document: &Root, path: &Path, scene: &mut Scene) -> Result<()> {
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
        let name = text(&mesh.name);
        let mut made = Vec::new();
        for (nth, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {index} `{name}`, primitive {nth}");
            let material = match primitive.material.map(|m| m.value()) {
                Some(m) if m < scene.materials.len() && m < self.reader.document.materials.len() => m,
                Some(m) => return Err(Error::input(self.path, format!("{place}: material {m} does not exist"))),
                None => *self.default_material.get_or_insert_with(|| {
                    scene.materials.push(material::default_material());
                    scene.materials.len() - 1
                }),
            };
            if primitive.targets.as_ref().is_some_and(|t| !t.is_empty()) {
                warnings.push(format!("{place} has morph targets: its rest shape is shown"));
            }
            let tangents = scene.materials[material].needs_tangents();
            let read = mesh::read(self.reader, primitive, tangents, &mut |w| warnings.push(format!("{place} {w}")));
            if let Some(mut triangles) = read.map_err(|e| Error::input(self.path, format!("{place}: {e}")))? {
                let name = if mesh.primitives.len() == 1 { name.to_owned() } else { format!("{name}#{nth}") };
                compact::compact(&mut triangles);
                made.push(scene.meshes.len());
                scene.meshes.push(Mesh { name, geometry: Geometry::Triangles(triangles), material });
            }
        }
        self.primitives.insert(index, made.clone());
        Ok(made)
    }
}
