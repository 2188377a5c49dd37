//! Which textures a model gets: one for each material or one for all of them, and where surfaces
//! lie in it.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use glam::{IVec2, Vec2};

use super::texels::Layout;
use super::unwrap::{self, UnwrappedMesh};
use super::{BakeSettings, TexcoordChoice, udim};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::scene::load::SourceFile;
use crate::scene::{Geometry, Mesh, Scene, TriangleMesh};

/// Share of the places of a texture that may show two surfaces in coordinates that count as unique.
const MAX_OVERLAP: f64 = 2e-3;
/// Share of a surface's area that may lie at no place of the texture.
const MAX_LOST: f64 = 1e-2;
/// Name of the texture of all materials.
const ATLAS: &str = "atlas";

/// A texture, and the surfaces that it shows.
pub struct PlannedTexture {
    /// Name of the material; `atlas` for the texture of all of them.
    pub name: String,
    /// The materials that show it: one, or all of an atlas.
    pub materials: Vec<PlannedMaterial>,
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Number of the set of texture coordinates.
    pub texcoord: u32,
    /// Where texture coordinates were made, new vertices of the primitives; else empty.
    pub unwrapped: Vec<UnwrappedMesh>,
    /// The surfaces.
    pub surfaces: Vec<Surface>,
    /// The tile of the texture's plane that it shows, where surfaces lie in several (UDIM): all
    /// else is in another texture.
    pub tile: Option<IVec2>,
    /// Where each instance has a texture of its own, the number of the instance among those of a
    /// mesh.
    pub placement: Option<usize>,
    /// Sentences for the user.
    pub remarks: Vec<String>,
}

impl PlannedTexture {
    /// Texture coordinates of the corners of each triangle of each surface, in the tile that it
    /// shows; triangles of other tiles have no extent.
    pub fn shown_corners(&self) -> Vec<Cow<'_, [[Vec2; 3]]>> {
        let corners = self.surfaces.iter().map(|surface| &surface.corners[..]);
        match self.tile {
            Some(tile) => corners.map(|corners| Cow::Owned(udim::corners_in(corners, tile))).collect(),
            None => corners.map(Cow::Borrowed).collect(),
        }
    }

    /// Returns true if a triangle reaches out of the unit square, where the texture repeats.
    pub fn repeats(&self) -> bool {
        let is_within = |c: &Vec2| c.cmpge(Vec2::ZERO).all() && c.cmple(Vec2::ONE).all();
        !self.shown_corners().iter().all(|corners| corners.as_flattened().iter().all(is_within))
    }
}

/// A material that shows a texture.
#[derive(Clone)]
pub struct PlannedMaterial {
    /// Name; the material's number where it has none.
    pub name: String,
    /// Index in the glTF file; `None` for primitives without a material, and for files of other
    /// formats.
    pub index: Option<usize>,
}

/// A mesh in a texture.
#[derive(Clone)]
pub struct Surface {
    /// Index of the scene's mesh.
    pub mesh: usize,
    /// Index of its material among those of the texture.
    pub material: usize,
    /// The scene's instances that show it.
    pub instances: Vec<usize>,
    /// Texture coordinates of the corners of each triangle.
    pub corners: Vec<[Vec2; 3]>,
}

/// The triangles of a mesh; `None` for spheres.
pub fn triangles_of(mesh: &Mesh) -> Option<&TriangleMesh> {
    match &mesh.geometry {
        Geometry::Triangles(triangles) => Some(triangles),
        Geometry::Spheres(_) => None,
    }
}

/// The meshes that are baked, by material: of those that are the same primitive of a file the first
/// with an instance.
pub fn meshes_by_material(scene: &Scene) -> Vec<(Option<usize>, Vec<usize>)> {
    let mut groups: BTreeMap<(usize, Option<usize>), Vec<usize>> = BTreeMap::new();
    let mut known = BTreeSet::new();
    for (index, mesh) in scene.meshes.iter().enumerate() {
        if triangles_of(mesh).is_none() || instances_of(scene, index).is_empty() {
            continue;
        }
        match &mesh.source {
            Some(source) => {
                if known.insert((source.mesh, source.primitive)) {
                    let key = (source.material.unwrap_or(usize::MAX), source.material);
                    groups.entry(key).or_default().push(index);
                }
            }
            None => groups.entry((mesh.material, None)).or_default().push(index),
        }
    }
    groups.into_iter().map(|((_, material), meshes)| (material, meshes)).collect()
}

/// The instances of a mesh that are there.
pub fn instances_of(scene: &Scene, mesh: usize) -> Vec<usize> {
    let shown =
        scene.instances.iter().enumerate().filter(|(i, instance)| instance.mesh == mesh && !scene.hidden.contains(i));
    shown.map(|(i, _)| i).collect()
}

/// Plans the textures of a scene. `file`: the glTF file that it was read from, which gets texture
/// coordinates where it has no unique ones; `control` hears of making them.
///
/// # Errors
/// [`Error::Interrupted`], and [`Error::Usage`] where there are no unique coordinates, and none can
/// be made.
pub fn plan(
    scene: &Scene,
    file: Option<&SourceFile>,
    settings: &BakeSettings,
    control: &mut dyn Control,
) -> Result<Vec<PlannedTexture>> {
    // the materials that are baked, and those that share a texture
    let mut groups: Vec<TextureGroup> = Vec::new();
    for (number, (index, meshes)) in meshes_by_material(scene).into_iter().enumerate() {
        let first = &scene.materials[scene.meshes[meshes[0]].material];
        let name = if first.name.is_empty() { format!("material{number}") } else { first.name.clone() };
        if settings.materials.iter().any(|wanted| !wanted.is_empty()) && !settings.materials.contains(&name) {
            continue;
        }
        let material = PlannedMaterial { name, index };
        match groups.last_mut().filter(|_| settings.is_atlas) {
            Some(atlas) => atlas.add(material, meshes),
            None => groups.push(TextureGroup::new(settings.is_atlas, material, meshes)),
        }
    }
    let known: BTreeSet<&String> = groups.iter().flat_map(|group| &group.materials).map(|m| &m.name).collect();
    if let Some(missing) = settings.materials.iter().find(|wanted| !known.contains(wanted)) {
        return Err(Error::Usage(format!("--only-material {missing}: no surface has a material of that name")));
    }

    // their textures
    let mut textures = Vec::new();
    for group in groups {
        let planned = plan_group(scene, file, settings, &group, control)?;
        let own = |texture| if settings.has_unique_instances { placements(scene, texture) } else { vec![texture] };
        textures.extend(planned.into_iter().flat_map(own));
    }
    if file.is_some() && settings.has_unique_instances {
        check_nodes(scene, &textures)?;
    }
    if textures.is_empty() {
        return Err(Error::Scene(format!("{}: has no triangles, and nothing else has texels", scene.name)));
    }
    Ok(textures)
}

/// Materials that share a texture, and their meshes.
struct TextureGroup {
    /// Name of the texture.
    name: String,
    /// The name in sentences.
    label: String,
    materials: Vec<PlannedMaterial>,
    /// Each mesh, and the index of its material in the list.
    meshes: Vec<(usize, usize)>,
}

impl TextureGroup {
    /// Makes the group of a material, the first one of an atlas.
    fn new(is_atlas: bool, material: PlannedMaterial, meshes: Vec<usize>) -> Self {
        let name = if is_atlas { ATLAS.to_owned() } else { material.name.clone() };
        let label = if is_atlas { ATLAS.to_owned() } else { format!("material `{name}`") };
        let mut group = Self { name, label, materials: Vec::new(), meshes: Vec::new() };
        group.add(material, meshes);
        group
    }

    /// Adds a material.
    fn add(&mut self, material: PlannedMaterial, meshes: Vec<usize>) {
        self.meshes.extend(meshes.into_iter().map(|mesh| (mesh, self.materials.len())));
        self.materials.push(material);
    }

    /// The sets of texture coordinates that may be those of the texture, in the order of trial.
    fn candidates(&self, scene: &Scene, settings: &BakeSettings) -> Vec<u32> {
        match settings.texcoords {
            // an atlas was written into the last of its sets
            TexcoordChoice::Auto if settings.is_atlas => {
                let sources = self.meshes.iter().filter_map(|(mesh, _)| scene.meshes[*mesh].source.as_ref());
                let sets: BTreeSet<u32> = sources.flat_map(|s| s.texcoord_sets.iter().copied()).chain([0, 1]).collect();
                sets.into_iter().rev().collect()
            }
            TexcoordChoice::Auto => vec![1, 0],
            TexcoordChoice::Set(set) => vec![set],
            TexcoordChoice::Unwrap => Vec::new(),
        }
    }
}

/// Plans the texture of a group, or of each tile that it has.
fn plan_group(
    scene: &Scene,
    file: Option<&SourceFile>,
    settings: &BakeSettings,
    group: &TextureGroup,
    control: &mut dyn Control,
) -> Result<Vec<PlannedTexture>> {
    // a set that the file has, if its coordinates are unique
    let mut remarks = Vec::new();
    let TextureGroup { name, label, materials, meshes } = group;
    for set in group.candidates(scene, settings) {
        let Some(surfaces) = surfaces_by_set(scene, meshes, set) else { continue };
        let texture = |tile, remarks| PlannedTexture {
            name: name.clone(),
            materials: materials.clone(),
            size: settings.size,
            texcoord: set,
            unwrapped: Vec::new(),
            surfaces: surfaces.clone(),
            tile,
            placement: None,
            remarks,
        };
        let Some(fault) = fault(scene, settings.size, &surfaces) else { return Ok(vec![texture(None, remarks)]) };
        let corners: Vec<&[[Vec2; 3]]> = surfaces.iter().map(|s| &s.corners[..]).collect();
        let tiles = fault.is_overlap.then(|| udim::tiles(settings.size, &corners, MAX_OVERLAP)).flatten();
        match tiles {
            // what was remarked on other sets is said once
            Some(tiles) if file.is_none() && !settings.is_atlas => {
                let texture = |tile| texture(Some(tile), std::mem::take(&mut remarks));
                return Ok(tiles.into_iter().map(texture).collect());
            }
            Some(tiles) if settings.is_atlas => remarks
                .push(format!("{label}: texture coordinates {set} lie in {} tiles (UDIM), not in one", tiles.len())),
            Some(tiles) => remarks.push(format!(
                "{label}: texture coordinates {set} lie in {} tiles (UDIM), which glTF does not have; images have one \
                 each",
                tiles.len()
            )),
            None => remarks.push(format!("{label}: texture coordinates {set} {}", fault.text)),
        }
    }
    if let TexcoordChoice::Set(set) = settings.texcoords {
        let reason = remarks.pop().unwrap_or_else(|| format!("{label}: not all meshes have texture coordinates {set}"));
        return Err(Error::Usage(format!("{reason}: --texcoord unwrap makes some that are unique")));
    }

    // else coordinates of its own, which only a file can hold
    let Some(file) = file else {
        let reason = remarks.pop().unwrap_or_else(|| format!("{label}: has no texture coordinates"));
        return Err(Error::Usage(format!(
            "{reason}: bake into a model, -o NAME.glb, which gets texture coordinates that are unique"
        )));
    };
    let numbers: Vec<usize> = meshes.iter().map(|(mesh, _)| *mesh).collect();
    let unwrapped = unwrap::unwrap(scene, file, &numbers, settings, label, control)?;
    remarks.push(format!(
        "{label}: {} charts in TEXCOORD_{}, {:.0} % of the texture",
        unwrapped.charts,
        unwrapped.texcoord,
        100.0 * unwrapped.utilization
    ));
    let surface = |(&(mesh, material), made): (&(usize, usize), &UnwrappedMesh)| Surface {
        mesh,
        material,
        instances: instances_of(scene, mesh),
        corners: made.scene_corners.clone(),
    };
    Ok(vec![PlannedTexture {
        name: name.clone(),
        materials: materials.clone(),
        size: unwrapped.size,
        texcoord: unwrapped.texcoord,
        surfaces: meshes.iter().zip(&unwrapped.meshes).map(surface).collect(),
        unwrapped: unwrapped.meshes,
        tile: None,
        placement: None,
        remarks,
    }])
}

/// Splits a texture into those of single instances: the first has the first instance of each mesh,
/// the second the second of those that have one.
fn placements(scene: &Scene, texture: PlannedTexture) -> Vec<PlannedTexture> {
    // a primitive of a file may be several meshes of the scene, as deformed ones are
    let is_same = |a: usize, b: usize| {
        let (first, second) = (&scene.meshes[a], &scene.meshes[b]);
        let count = |mesh: &Mesh| triangles_of(mesh).map(|t| t.indices.len());
        let key = |mesh: &Mesh| mesh.source.as_ref().map(|s| (s.mesh, s.primitive));
        a == b || (key(first).is_some() && key(first) == key(second) && count(first) == count(second))
    };
    let placed = |surface: &Surface| -> Vec<usize> {
        let instances = scene.instances.iter().enumerate();
        let own = instances.filter(|(k, i)| is_same(i.mesh, surface.mesh) && !scene.hidden.contains(k));
        own.map(|(k, _)| k).collect()
    };
    let placed: Vec<Vec<usize>> = texture.surfaces.iter().map(placed).collect();
    let most = placed.iter().map(Vec::len).max().unwrap_or_default();
    if most < 2 {
        return vec![texture];
    }

    // the first one brings new vertices, which all instances share
    let (mut remarks, mut unwrapped) = (texture.remarks, texture.unwrapped);
    let nth = |k: usize| PlannedTexture {
        name: texture.name.clone(),
        materials: texture.materials.clone(),
        unwrapped: std::mem::take(&mut unwrapped),
        surfaces: (texture.surfaces.iter().zip(&placed))
            .filter_map(|(surface, placed)| {
                let instance = *placed.get(k)?;
                let mesh = scene.instances[instance].mesh;
                Some(Surface { mesh, instances: vec![instance], ..surface.clone() })
            })
            .collect(),
        placement: Some(k),
        remarks: std::mem::take(&mut remarks),
        ..texture
    };
    (0..most).map(nth).collect()
}

/// Checks that each instance with a texture of its own has a node of its own in the file.
///
/// # Errors
/// [`Error::Usage`] for a node that places its mesh several times.
fn check_nodes(scene: &Scene, textures: &[PlannedTexture]) -> Result<()> {
    let mut known = BTreeSet::new();
    let placed = textures.iter().filter(|texture| texture.placement.is_some()).flat_map(|texture| &texture.surfaces);
    for surface in placed {
        let primitive = scene.meshes[surface.mesh].source.as_ref().map(|source| source.primitive);
        for &instance in &surface.instances {
            let node = scene.report.instance_nodes.get(instance).copied();
            if node.is_none() || !known.insert((node, primitive)) {
                return Err(Error::Usage(format!(
                    "--unique-instances: node `{}` places its mesh several times (EXT_mesh_gpu_instancing), and a glTF \
                     file has one material for all of them: bake images, .png or .exr, or leave the option out",
                    scene.instances[instance].name
                )));
            }
        }
    }
    Ok(())
}

/// The meshes by a set of texture coordinates, which all of them must have.
fn surfaces_by_set(scene: &Scene, meshes: &[(usize, usize)], set: u32) -> Option<Vec<Surface>> {
    let surface = |&(mesh, material): &(usize, usize)| {
        let triangles = triangles_of(&scene.meshes[mesh])?;
        let place = match &scene.meshes[mesh].source {
            Some(source) => source.texcoord_sets.iter().position(|s| *s == set)?,
            None => set as usize,
        };
        let texcoords = triangles.texcoord_set(place);
        if texcoords.is_empty() {
            return None;
        }
        let corners = triangles.indices.iter().map(|t| t.map(|v| texcoords[v as usize])).collect();
        Some(Surface { mesh, material, instances: instances_of(scene, mesh), corners })
    };
    meshes.iter().map(surface).collect()
}

/// Why texture coordinates are not unique.
struct Fault {
    /// The reason in words.
    text: String,
    /// Surfaces share texels, and nothing else is wrong.
    is_overlap: bool,
}

/// Why texture coordinates are not unique; `None` if they are.
fn fault(scene: &Scene, size: [u32; 2], surfaces: &[Surface]) -> Option<Fault> {
    let other = |text| Some(Fault { text, is_overlap: false });
    // surfaces of no extent in the texture, or that repeat it
    let (mut area, mut lost, mut repeated) = (0.0, 0.0, 0.0);
    for surface in surfaces {
        let triangles = triangles_of(&scene.meshes[surface.mesh])?;
        for (t, corners) in triangles.indices.iter().zip(&surface.corners) {
            let [a, b, c] = t.map(|v| triangles.positions[v as usize].as_dvec3());
            let own = (b - a).cross(c - a).length();
            let [least, greatest] = [Vec2::min as fn(Vec2, Vec2) -> Vec2, Vec2::max]
                .map(|pick| corners.iter().copied().reduce(pick).unwrap_or_default());
            area += own;
            lost += if (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]) == 0.0 { own } else { 0.0 };
            repeated += if (greatest - least).max_element() > 1.0 + 1e-4 { own } else { 0.0 };
        }
    }
    if lost > MAX_LOST * area {
        return other(format!("show no texels on {:.0} % of the surface", 100.0 * lost / area));
    }
    if repeated > 0.0 {
        return other(format!("repeat the texture on {:.0} % of the surface", 100.0 * repeated / area));
    }
    let corners: Vec<&[[Vec2; 3]]> = surfaces.iter().map(|s| &s.corners[..]).collect();
    let overlap = Layout::new(size, &corners).overlap();
    let text = || format!("overlap: {:.1} % of the texels show several places", 100.0 * overlap);
    (overlap > MAX_OVERLAP).then(|| Fault { text: text(), is_overlap: true })
}
