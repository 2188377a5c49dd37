//! Counts of what a scene is made of: for people and programs that look at it before they render
//! it.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;

use super::material::MaterialKind;
use super::open_edges::open_edges;
use super::{AlphaMode, Environment, Geometry, Material, Scene};

/// Counts of a scene.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Inventory {
    /// Corners of the bounds, scene units; absent in a scene without geometry.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Diagonal of the bounds, scene units.
    pub diagonal: f64,
    /// Instances of meshes.
    pub instances: usize,
    /// Names of instances, which `--hide` and `--only` take; each once, in the file's order.
    pub objects: Vec<String>,
    /// Names of the topmost nodes that tell parts of the scene apart, which `--hide` and `--only`
    /// take, too; each once.
    pub nodes: Vec<String>,
    /// Meshes, and those that deform.
    pub meshes: usize,
    /// Meshes with a skin or morph targets.
    pub deforming_meshes: usize,
    /// Triangles, each mesh counted once.
    pub unique_triangles: u64,
    /// Triangles, each instance counted.
    pub triangles: u64,
    /// Analytic spheres, each instance counted.
    pub spheres: u64,
    /// Triangles without an area, which the loader has dropped.
    pub degenerate_triangles: usize,
    /// Edges with a triangle on one side only: surfaces end there, and light gets to the other
    /// side. Vertices at the same place are one.
    pub open_edges: u64,
    /// Meshes without open edges.
    pub closed_meshes: usize,
    /// Materials that instances use, by model and what it is extended by.
    pub materials: BTreeMap<String, usize>,
    /// Names of these materials, which `--material` takes; each once, in the file's order.
    pub material_names: Vec<String>,
    /// Names of variants of the materials, of which `--variant` chooses one.
    pub variants: Vec<String>,
    /// Textures.
    pub textures: TextureInventory,
    /// Names of cameras; empty for one without.
    pub cameras: Vec<String>,
    /// Lights by kind, and instances that emit.
    pub lights: BTreeMap<&'static str, usize>,
    /// The environment in words.
    pub environment: String,
    /// Animations: name and seconds.
    pub animations: Vec<(String, f64)>,
    /// Skins, and their joints.
    pub skins: Vec<usize>,
    /// Morph targets of all meshes.
    pub morph_targets: usize,
}

/// Textures of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TextureInventory {
    /// Textures: images with a sampler.
    pub count: usize,
    /// Images, each counted once.
    pub images: usize,
    /// Width and height of the largest, texels.
    pub largest: [u32; 2],
    /// Bytes of all images, decoded and without mip levels.
    pub bytes: u64,
}

impl Inventory {
    /// Counts what a scene has.
    pub fn from_scene(scene: &Scene) -> Self {
        let bounds = scene.bounds();

        // geometry and materials
        let of_mesh: Vec<(u64, u64)> = scene
            .meshes
            .par_iter()
            .map(|mesh| match &mesh.geometry {
                Geometry::Triangles(t) => (t.indices.len() as u64, open_edges(t)),
                Geometry::Spheres(_) => (0, 0),
            })
            .collect();
        let mut materials = BTreeMap::new();
        let mut used: Vec<usize> = scene.instances.iter().map(|i| scene.meshes[i.mesh].material).collect();
        used.sort_unstable();
        used.dedup();
        used.iter().for_each(|k| *materials.entry(model(&scene.materials[*k])).or_default() += 1);

        let parts = scene.rig.as_ref().map(|r| r.parts());
        let deformations = parts.map_or(&[][..], |p| &p.deformations);
        Self {
            bounds: bounds.map(|(lo, hi)| [lo.to_array(), hi.to_array()]),
            diagonal: bounds.map_or(0.0, |(lo, hi)| (hi - lo).length()),
            instances: scene.instances.len(),
            objects: distinct(scene.instances.iter().map(|i| i.name.as_str())),
            nodes: distinct(scene.nodes.top(scene.instances.len()).iter().map(|k| &*scene.nodes[*k].name)),
            meshes: scene.meshes.len(),
            deforming_meshes: deformations.len(),
            unique_triangles: of_mesh.iter().map(|m| m.0).sum(),
            triangles: scene.triangle_count(),
            spheres: scene.sphere_count(),
            degenerate_triangles: scene.report.degenerate_triangles,
            open_edges: of_mesh.iter().map(|m| m.1).sum(),
            closed_meshes: of_mesh.iter().filter(|m| m.0 > 0 && m.1 == 0).count(),
            materials,
            material_names: distinct(used.iter().map(|k| scene.materials[*k].name.as_str())),
            variants: scene.variants.clone(),
            textures: textures(scene),
            cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
            lights: lights(scene),
            environment: match &scene.environment {
                Environment::Black => "none".into(),
                Environment::Uniform(c) => format!("radiance {}, {}, {}", c.x, c.y, c.z),
                Environment::Map(map) => format!("map {}, {}x{}", map.name, map.width, map.height),
            },
            animations: scene.rig.iter().flat_map(|r| r.animations()).map(|a| (a.name.clone(), a.duration)).collect(),
            skins: parts.map_or_else(Vec::new, |p| p.skins.iter().map(|s| s.joints.len()).collect()),
            morph_targets: deformations.iter().map(|d| d.targets.len()).sum(),
        }
    }
}

/// Names in their order, each once, without empty ones.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut seen = HashSet::new();
    names.filter(|name| !name.is_empty() && seen.insert(*name)).map(str::to_owned).collect()
}

/// The model of a material, and what extends it.
fn model(material: &Material) -> String {
    let model = match material.kind {
        _ if material.unlit => "unlit",
        MaterialKind::MetallicRoughness => "metallic-roughness",
        MaterialKind::Matte => "matte",
        MaterialKind::Mirror => "mirror",
        MaterialKind::Glass => "glass",
        MaterialKind::Copper => "copper",
        MaterialKind::Gold => "gold",
    };
    let extended = [
        ("clearcoat", material.clearcoat.factor > 0.0),
        ("sheen", material.sheen.color.max_element() > 0.0),
        ("transmission", material.transmission.factor > 0.0),
        ("volume", material.transmission.thickness > 0.0),
        ("anisotropy", material.anisotropy.strength != 0.0),
        ("iridescence", material.iridescence.factor > 0.0),
        ("diffuse transmission", material.diffuse_transmission.factor > 0.0),
        ("retroreflection", material.retroreflection.factor > 0.0),
        ("dispersion", material.dispersion > 0.0),
        ("volume scattering", material.volume_scatter.color.max_element() > 0.0),
        ("normal map", material.normal_texture.is_some()),
        ("emission", material.emissive.max_element() > 0.0),
        ("alpha mask", matches!(material.alpha_mode, AlphaMode::Mask { .. })),
        ("alpha blending", material.alpha_mode == AlphaMode::Blend),
    ];
    let extended = extended.into_iter().filter(|e| e.1).map(|e| e.0);
    [model].into_iter().chain(extended).collect::<Vec<_>>().join(" + ")
}

fn textures(scene: &Scene) -> TextureInventory {
    let mut images: Vec<&super::Texture> = Vec::new();
    for texture in &scene.textures {
        if !images.iter().any(|i| i.texels.is_shared_with(&texture.texels)) {
            images.push(texture);
        }
    }
    let largest = images.iter().map(|i| [i.width, i.height]).max_by_key(|[w, h]| u64::from(*w) * u64::from(*h));
    TextureInventory {
        count: scene.textures.len(),
        images: images.len(),
        largest: largest.unwrap_or_default(),
        bytes: images.iter().map(|i| i.texels.as_bytes().len() as u64).sum(),
    }
}

fn lights(scene: &Scene) -> BTreeMap<&'static str, usize> {
    let mut lights = BTreeMap::new();
    let mut add = |kind| *lights.entry(kind).or_default() += 1;
    for light in &scene.lights {
        add(light.kind.about().name);
    }
    for instance in &scene.instances {
        if scene.materials[scene.meshes[instance.mesh].material].emissive.max_element() > 0.0 {
            add("emitting instances");
        }
    }
    lights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn scenes_are_counted() {
        let inventory = |name: &str| Inventory::from_scene(&builtin::by_name(name).unwrap());
        let cornell = inventory("cornell-box");
        assert_eq!((cornell.lights.get("emitting instances"), cornell.environment.as_str()), (Some(&1), "none"));
        assert_eq!(cornell.triangles, cornell.unique_triangles);
        assert!(cornell.materials.keys().any(|m| m.contains("emission")), "{:?}", cornell.materials);
        let grid = inventory("grid:4");
        assert!(grid.triangles > 4 * grid.unique_triangles && grid.instances > 4, "{grid:?}");
        assert_eq!(distinct(["a", "", "b", "a", "c", "b"].into_iter()), ["a", "b", "c"]);
        let spheres = inventory("spheres:50");
        assert!(spheres.spheres > 0);
        let parade = inventory("parade");
        assert!(!parade.animations.is_empty());
    }
}
