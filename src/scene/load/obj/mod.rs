//! Wavefront OBJ with MTL.
//!
//! Read by a parser of our own, because no crate is fit for what users have: tobj and obj-rs name no line of an error, and
//! tobj panics on `Kd 1 2` and refuses continued lines, wavefront_obj refuses vertex colours and relative indices, and
//! nobject-rs and wavefront take broken numbers without a word.
//!
//! Each run of faces with one object or group name and one material becomes a mesh. Polygons are cut into fans, or by ear
//! clipping where a fan would reach outside of them. A mesh without `vn` is shaded flat.

mod material;
mod mtl;
mod parse;
mod polygon;

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, Vec2, Vec3, Vec4};

use parse::{Corner, Group, NONE, ObjFile};

use super::{LoadOptions, find};
use crate::error::Result;
use crate::scene::{Geometry, Instance, Material, Mesh, Scene, TriangleMesh};

/// Reads an `.obj` file and the material libraries that it names.
pub(super) fn read(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let mut file = parse::parse(path)?;
    let mut scene = Scene::default();
    if file.open_faces > 0 {
        scene.report.warnings.push(format!("{} faces with fewer than three corners: left out", file.open_faces));
    }
    let mut materials = material::MaterialLibrary::new(*options);
    let mut complete = true;
    for name in std::mem::take(&mut file.libraries) {
        match find::find(&name, &[path]) {
            Ok(mtl) => {
                materials.read(&mtl, path, &mut scene)?;
                scene.report.files.push(mtl);
            }
            Err(searched) => {
                complete = false;
                let searched = find::list(&searched);
                scene.report.warnings.push(format!(
                    "the material library {name} was not found in {searched}: its materials are replaced by grey"
                ));
            }
        }
    }
    let mut grey = None;
    let mut unknown: HashMap<String, usize> = HashMap::new();
    let mut welder = Welder::new(file.positions.len());
    for group in std::mem::take(&mut file.groups) {
        let material = match &group.material {
            None => *grey.get_or_insert_with(|| push(&mut scene, material::grey(String::new()))),
            Some(name) => match materials.index.get(name) {
                Some(&index) => index,
                None => *unknown.entry(name.clone()).or_insert_with(|| {
                    // a missing library says it all
                    if complete {
                        scene.report.warnings.push(format!("the material `{name}` is not defined: replaced by grey"));
                    }
                    push(&mut scene, material::grey(name.clone()))
                }),
            },
        };
        let triangles = welder.weld(&file, &group);
        let name = group.name;
        let mesh = scene.meshes.len();
        scene.instances.push(Instance { name: name.clone(), mesh, object_to_world: DAffine3::IDENTITY });
        scene.meshes.push(Mesh { name, geometry: Geometry::Triangles(triangles), material });
    }
    Ok(scene)
}

fn push(scene: &mut Scene, material: Material) -> usize {
    scene.materials.push(material);
    scene.materials.len() - 1
}

/// Makes one vertex of each combination of position, texture coordinate and normal in a mesh. The vertices of each
/// position form a chain, whose heads are kept from mesh to mesh: a file of many small meshes must not clear them all.
struct Welder {
    /// Of each position of the file: the mesh that used it last, and its first vertex there.
    heads: Vec<(u32, u32)>,
    mesh: u32,
}

impl Welder {
    fn new(positions: usize) -> Self {
        Self { heads: vec![(0, 0); positions], mesh: 0 }
    }

    fn weld(&mut self, file: &ObjFile, group: &Group) -> TriangleMesh {
        self.mesh += 1;
        let corners = || group.triangles.iter().flatten();
        let with_normals = corners().any(|c| c.normal != NONE);
        let with_texcoords = corners().any(|c| c.texcoord != NONE);
        let mut mesh = TriangleMesh::default();
        let mut chain: Vec<(Corner, u32)> = Vec::new();
        for triangle in &group.triangles {
            let indices = triangle.map(|corner| {
                let head = &mut self.heads[corner.position as usize];
                let mut at = if head.0 == self.mesh { head.1 } else { NONE };
                while at != NONE && chain[at as usize].0 != corner {
                    at = chain[at as usize].1;
                }
                if at != NONE {
                    return at;
                }
                let new = chain.len() as u32;
                chain.push((corner, if head.0 == self.mesh { head.1 } else { NONE }));
                *head = (self.mesh, new);
                mesh.positions.push(file.positions[corner.position as usize]);
                if with_normals {
                    // corners without one get it from the triangles around them, later
                    mesh.normals.push(file.normals.get(corner.normal as usize).copied().unwrap_or(Vec3::ZERO));
                }
                if with_texcoords {
                    mesh.texcoords[0].push(file.texcoords.get(corner.texcoord as usize).copied().unwrap_or(Vec2::ZERO));
                }
                if !file.colors.is_empty() {
                    mesh.colors.push(file.colors.get(corner.position as usize).copied().unwrap_or(Vec4::ONE));
                }
                new
            });
            mesh.indices.push(indices);
        }
        mesh
    }
}
