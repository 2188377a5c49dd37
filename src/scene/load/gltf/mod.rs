//! glTF 2.0: `.gltf` with external files or data URIs, and `.glb`.
//!
//! The crate `gltf` reads the JSON. Its validation is left out: it would refuse quantised
//! meshes and every extension that it does not know; so are its chunks of `.glb` files, which
//! refuse what the specification wants skipped. Hence indices are checked where they are used,
//! values that it calls invalid are told where they matter, extensions that it does not model come
//! from the maps in which it keeps them, and accessors are read by a reader of our own, which
//! checks every range.
//!
//! <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>

mod accessor;
mod animation;
mod compressed;
mod container;
mod decoded;
mod glossiness;
mod image_light;
mod instancing;
mod material;
mod mesh;
mod node;
mod pointer;
mod rig;
mod skin;
pub(super) mod source;
mod texture;
mod uri;
mod values;
mod variants;
mod xmp;

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use ::gltf::json::Root;

use accessor::Reader;
use decoded::Decoded;
use glam::DAffine3;
use rig::{MeshVariant, RigBuilder};
use values::text;

use super::compact;
use super::nodes::NodeTreeBuilder;
use super::options::Loading;
use crate::error::{Error, Result};
use crate::scene::material::{VariantMaterials, all_variants};
use crate::scene::{FileExtension, Geometry, Instance, Material, Mesh, MeshSource, Scene};
use crate::stage;

/// Extensions that skylit reads, and whether this program was built with what they need.
const KNOWN: &[(&str, bool)] = &[
    ("EXT_lights_image_based", true),
    ("EXT_mesh_gpu_instancing", true),
    ("EXT_meshopt_compression", cfg!(feature = "meshopt")),
    ("EXT_texture_webp", true),
    ("KHR_animation_pointer", true),
    ("KHR_draco_mesh_compression", cfg!(feature = "draco")),
    ("KHR_lights_punctual", true),
    ("KHR_materials_anisotropy", true),
    ("KHR_materials_clearcoat", true),
    ("KHR_materials_diffuse_transmission", true),
    ("KHR_materials_dispersion", true),
    ("KHR_materials_emissive_strength", true),
    ("KHR_materials_ior", true),
    ("KHR_materials_iridescence", true),
    ("KHR_materials_pbrSpecularGlossiness", true),
    ("KHR_materials_retroreflection", true),
    ("KHR_materials_sheen", true),
    ("KHR_materials_specular", true),
    ("KHR_materials_transmission", true),
    ("KHR_materials_unlit", true),
    ("KHR_materials_variants", true),
    ("KHR_materials_volume", true),
    ("KHR_materials_volume_scatter", true),
    ("KHR_mesh_quantization", true),
    ("KHR_meshopt_compression", cfg!(feature = "meshopt")),
    ("KHR_node_visibility", true),
    ("KHR_texture_basisu", cfg!(feature = "ktx2")),
    ("KHR_texture_transform", true),
    ("KHR_xmp_json_ld", true),
    ("MSFT_texture_dds", cfg!(feature = "dds")),
];

/// Reads a `.gltf` or `.glb` file.
pub(super) fn read(path: &Path, loading: Loading) -> Result<Scene> {
    // the document and its buffers
    let reading = stage::begin("reading the file");
    let file = crate::files::read_regular(path).map_err(|e| Error::read(path, &e))?;
    let budget = loading.budget;
    budget.read(file.len());
    let chunks = container::split(&file, path)?;
    let (document, doubles) = container::document(&chunks.json, path)?;
    let mut scene = Scene::default();
    extensions(&document, path, &mut scene)?;
    scene.report.files = container::files(&document, path, loading.options.confine.folder())?;
    let buffers = container::buffers(&document, chunks.bin, path, loading);
    let stored = Reader { document: &document, buffers: &buffers, decoded: &Decoded::default(), budget };
    drop(reading);
    let decoded = compressed::decode(&stored, loading.options.progress);
    let reader = Reader { decoded: &decoded, ..stored };
    let input = |e| Error::input(path, e);
    let chosen = node::choose_scene(&document, loading.options.scene).map_err(input)?;
    scene.report.metadata = xmp::read(&document, &doubles.asset);
    scene.report.scenes = document.scenes.iter().map(|s| text(&s.name).to_owned()).collect();
    let placed = node::place(&document, &doubles, chosen, !doubles.skins.is_empty()).map_err(input)?;

    let mut warnings = Vec::new();

    // materials, and the textures that they use
    let mut made = Vec::new();
    let textures = document.textures.len();
    let mut material = |(i, m)| {
        material::convert(m, textures, &mut made).map_err(|e| Error::input(path, format!("material {i}: {e}")))
    };
    scene.materials = document.materials.iter().enumerate().map(&mut material).collect::<Result<_>>()?;
    (scene.textures, scene.report.skipped_images) =
        texture::resolve(&reader, path, &mut scene.materials, &made, loading, &mut |w| warnings.push(w));

    scene.variants = variants::names(&document).map_err(input)?;
    image_light::apply(&reader, path, chosen, loading, &mut scene, &mut |w| warnings.push(w));

    // nodes, and what they carry
    let _stage = stage::begin("reading meshes");
    let mut stage = RigBuilder::new(&reader, &doubles, &placed, &mut |w| warnings.push(w));
    let mut meshes = Meshes {
        reader: &reader,
        path,
        primitives: BTreeMap::new(),
        default_material: None,
        varied: Vec::new(),
        with_sets: BTreeMap::new(),
    };
    let mut nodes = NodeTreeBuilder::default();
    for (at, placed) in placed.iter().enumerate().filter(|(_, p)| p.shown) {
        let node = &document.nodes[placed.node];
        let name = text(&node.name);
        nodes.begin(placed.level, name, &scene);
        if let Some(index) = node.mesh.filter(|_| stage.shows(at)) {
            let copies = instancing::read(&reader, node).map_err(|e| input(format!("node {}: {e}", placed.node)))?;
            if node.skin.is_some() && instancing::is_instanced(node) {
                warnings.push(format!("node {} has instances and a skin: shown once", placed.node));
            }
            let wanted = stage.wanted(at, index.value()).map_err(input)?;
            for made in meshes.read_mesh(&wanted, at, &mut stage, &mut scene, &mut warnings)? {
                // the node's transform does not apply to a skinned mesh
                let places = match (&copies, made.place) {
                    (Some(copies), None) => {
                        let place = |copy: &DAffine3| (placed.to_world * *copy, stage.carrier_of_copy(at, copy));
                        copies.iter().map(place).collect()
                    }
                    (_, None) => vec![(placed.to_world, Some(at))],
                    (_, Some(place)) => vec![(place, None)],
                };
                for (object_to_world, carrier) in places {
                    scene.instances.push(Instance { name: name.to_owned(), mesh: made.mesh, object_to_world });
                    scene.report.instance_nodes.push(placed.node);
                    stage.add_instance(at, carrier);
                }
            }
        }
        if let Some(index) = node.camera {
            match node::camera(&document, &doubles, placed, index.value(), &mut |w| warnings.push(w)) {
                Ok(camera) => {
                    scene.cameras.push(camera);
                    stage.cameras.push(Some(at));
                    stage.camera_numbers.push(index.value());
                }
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
        let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        if let Some(light) = light.filter(|_| stage.shows(at)) {
            let number = light.light.value();
            match node::light(&document, placed, number) {
                Ok(light) => {
                    scene.lights.push(light);
                    stage.lights.push(Some(at));
                    stage.light_numbers.push(number);
                }
                Err(e) => warnings.push(format!("{e}: ignored")),
            }
        }
    }
    stage.material_copies = meshes.with_sets.iter().map(|((of, _), copy)| (*copy, *of)).collect();
    stage.finish(&mut scene).map_err(input)?;
    scene.nodes = nodes.finish(&scene);
    scene.report.warnings.append(&mut warnings);
    Ok(scene)
}

/// Fails for unsupported required extensions, and warns about unsupported optional ones.
fn extensions(document: &Root, path: &Path, scene: &mut Scene) -> Result<()> {
    let is_read = |name: &str| KNOWN.contains(&(name, true));
    if let Some(name) = document.extensions_required.iter().find(|name| !is_read(name)) {
        let reason = if KNOWN.contains(&(name, false)) {
            "which this program was built without"
        } else {
            "which skylit does not support"
        };
        return Err(Error::input(path, format!("requires the extension {name}, {reason}: export the file without it")));
    }
    let required: HashSet<&String> = document.extensions_required.iter().collect();
    scene.report.extensions.extend(document.extensions_used.iter().map(|name| FileExtension {
        name: name.clone(),
        required: required.contains(name),
        ignored: !is_read(name),
    }));
    for name in document.extensions_used.iter().filter(|name| !is_read(name)) {
        scene.report.warnings.push(format!("the extension {name} is ignored"));
    }
    Ok(())
}

/// Reads each mesh that has an instance, once for each variant.
struct Meshes<'a> {
    reader: &'a Reader<'a>,
    path: &'a Path,
    /// The scene's meshes of each glTF mesh.
    primitives: BTreeMap<MeshVariant, Vec<LoadedMesh>>,
    /// The scene's material for primitives without one.
    default_material: Option<usize>,
    /// The scene's materials that depend on its variant.
    varied: Vec<usize>,
    /// Materials for other sets of texture coordinates than the first two.
    with_sets: BTreeMap<(usize, Vec<u32>), usize>,
}

/// A mesh of the scene.
#[derive(Clone, Copy)]
struct LoadedMesh {
    mesh: usize,
    /// Object-to-world transform of its instances if it has a skin.
    place: Option<DAffine3>,
}

impl Meshes<'_> {
    /// `at`: the placed node that carries it.
    fn read_mesh(
        &mut self,
        wanted: &MeshVariant,
        at: usize,
        stage: &mut RigBuilder,
        scene: &mut Scene,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<LoadedMesh>> {
        if let Some(known) = self.primitives.get(wanted) {
            return Ok(known.clone());
        }

        // a mesh that is read for another node again has said its warnings already
        let index = wanted.mesh;
        let meshes = &self.reader.document.meshes;
        let mesh = meshes.get(index).ok_or_else(|| Error::input(self.path, format!("mesh {index} does not exist")))?;
        let name = text(&mesh.name);
        let again = self.primitives.range(MeshVariant::first(index)..).next().is_some_and(|(k, _)| k.mesh == index);
        let mut made = Vec::new();
        for (nth, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {index} `{name}`, primitive {nth}");

            // once is enough
            let mut warn = |w: String| {
                if !again {
                    warnings.push(format!("{place} {w}"));
                }
            };
            let path = self.path;
            let input = |e: String| Error::input(path, format!("{place}: {e}"));
            let material = match primitive.material.map(|m| m.value()) {
                Some(m) if m < scene.materials.len() && m < self.reader.document.materials.len() => m,
                Some(m) => return Err(input(format!("material {m} does not exist"))),
                None => *self.default_material.get_or_insert_with(|| {
                    scene.materials.push(material::default_material());
                    scene.materials.len() - 1
                }),
            };

            // what it is in variants of the scene
            let known = self.reader.document.materials.len();
            let variants = variants::materials(primitive, material, scene.variants.len(), known).map_err(input)?;
            let mut variants = variants.unwrap_or(VariantMaterials { base: material, replacements: Vec::new() });
            let sets = texcoord_sets(variants.all().map(|i| &scene.materials[i]));
            variants.all_mut().for_each(|i| *i = self.with_sets(*i, &sets, scene));
            let material =
                if variants.replacements.is_empty() { variants.base } else { self.varied_material(variants, scene) };

            // the primitive, with what deforms it
            let tangents = all_variants(&scene.materials, material).iter().any(|m| m.needs_tangents());
            let Some(mut triangles) = mesh::read(self.reader, primitive, tangents, &sets, &mut warn).map_err(input)?
            else {
                continue;
            };
            let mut deformation = stage.deformation(wanted, primitive, &triangles, at, &mut warn).map_err(input)?;
            let kept = compact::compact(&mut triangles);
            if let (Some(deformation), Some(kept)) = (&mut deformation, kept) {
                deformation.reorder(&kept);
            }
            let place = deformation.and_then(|d| stage.deform(d, wanted, scene.meshes.len(), &mut triangles));
            let name = if mesh.primitives.len() == 1 { name.to_owned() } else { format!("{name}#{nth}") };
            made.push(LoadedMesh { mesh: scene.meshes.len(), place });
            let source = MeshSource {
                mesh: index,
                primitive: nth,
                material: primitive.material.map(|m| m.value()),
                texcoord_sets: sets,
            };
            let geometry = Geometry::Triangles(triangles);
            scene.meshes.push(Mesh { name, geometry, material, source: Some(source) });
        }
        self.primitives.insert(wanted.clone(), made.clone());
        Ok(made)
    }

    /// Index of a material whose slots count these sets of texture coordinates as the first ones.
    fn with_sets(&mut self, material: usize, sets: &[u32], scene: &mut Scene) -> usize {
        if sets == [0, 1] {
            return material;
        }
        *self.with_sets.entry((material, sets.to_vec())).or_insert_with(|| {
            let mut renumbered = scene.materials[material].clone();
            for slot in renumbered.texture_slots_mut().into_iter().flatten() {
                let place = sets.iter().position(|set| *set as usize == slot.texcoord);
                slot.texcoord = place.unwrap_or_default();
            }
            scene.materials.push(renumbered);
            scene.materials.len() - 1
        })
    }

    /// Index of the scene's material that is one of these at a time: one for all primitives that
    /// have the same.
    fn varied_material(&mut self, variants: VariantMaterials, scene: &mut Scene) -> usize {
        let same = |i: &&usize| scene.materials[**i].variants.as_ref() == Some(&variants);
        if let Some(known) = self.varied.iter().find(same) {
            return *known;
        }
        let base = scene.materials[variants.base].clone();
        self.varied.push(scene.materials.len());
        scene.materials.push(Material { variants: Some(variants), ..base });
        scene.materials.len() - 1
    }
}

/// The sets of texture coordinates that a primitive keeps: the first two, or those that its
/// materials use if there is another one among them.
fn texcoord_sets<'a>(materials: impl Iterator<Item = &'a Material>) -> Vec<u32> {
    let used: BTreeSet<u32> = materials.flat_map(Material::textures).map(|slot| slot.texcoord as u32).collect();
    if used.iter().all(|set| *set <= 1) { vec![0, 1] } else { used.into_iter().collect() }
}

#[cfg(test)]
mod tests {
    use super::KNOWN;

    #[test]
    fn the_page_of_formats_lists_what_is_used() {
        let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/formats.md")).unwrap();
        let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | used |"));
        let listed: Vec<&str> = rows.map(|(name, _)| name).collect();
        let known: Vec<&str> = KNOWN.iter().map(|(name, _)| *name).collect();
        assert_eq!(listed, known);
    }
}
