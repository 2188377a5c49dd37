//! Wavefront OBJ with MTL.
//!
//! Read by a parser of our own, because no crate is fit for what users have;
//! docs/notebook/2026-11-28-obj-parser.md has what tobj, the one that is kept best, reads of it.
//! obj-rs names no line of an error, wavefront_obj refuses vertex colours and relative indices, and
//! nobject-rs and wavefront take broken numbers without a word.
//!
//! Each run of faces with one object, one group and one material becomes a mesh, with the name of
//! its group or, before the first `g` of an object, that of the object. Polygons are
//! cut into fans, or by ear clipping where a fan would reach outside of them. Corners without `vn`
//! are shaded smoothly in a smoothing group, and flat outside of one.

mod keys;
mod material;
mod mtl;
mod parse;
mod plain;
mod polygon;
mod smooth;
mod texture;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use keys::PositionKeys;
use material::MaterialLibrary;
use parse::{Corner, Group, NONE, ObjFile};

use super::find;
use super::nodes::NodeTreeBuilder;
use super::options::{Loading, NormalSource};
use super::text::{self, unquoted, without_comment};
use crate::error::Result;
use crate::scene::{Geometry, Instance, Material, Mesh, Scene, TriangleMesh, distant_centre};

/// Triangles that a thread looks at at least.
const MIN_TRIANGLES: usize = 1 << 14;

/// Reads an `.obj` file and the material libraries that it names.
pub(super) fn read(path: &Path, loading: Loading) -> Result<Scene> {
    // the file, and what is odd about it
    let mut file = parse::parse(path, loading.budget)?;
    let mut scene = Scene::default();
    if file.open_faces > 0 {
        scene.report.warnings.push(format!("{} faces with fewer than three corners: left out", file.open_faces));
    }
    if file.large_polygons > 0 {
        let (count, most) = (file.large_polygons, polygon::MAX_CORNERS);
        scene.report.warnings.push(format!(
            "{count} polygons have more than {most} corners: filled from their first corner as if they were convex; triangulate them in the modelling program"
        ));
    }
    if file.decimal_commas > 0 {
        scene.report.warnings.push(format!("{} numbers have a decimal comma: read as a point", file.decimal_commas));
    }

    scene.report.warnings.extend(unused_statements(&file));

    // materials
    let mut materials = MaterialLibrary::new(loading);
    let is_complete = read_libraries(&file, path, &mut materials, &mut scene)?;
    materials.check(path)?;
    let mut grey = None;
    let mut unknown: HashMap<String, usize> = HashMap::new();

    // meshes
    let origin = origin(&file);
    if loading.options.geometry.normals == NormalSource::File {
        scene.report.normals_computed += smooth::smooth(&mut file);
    } else {
        // the file's would only split vertices
        file.groups.iter_mut().flat_map(|g| g.triangles.iter_mut().flatten()).for_each(|c| c.normal = NONE);
    }
    let mut keys = PositionKeys::new(file.positions.len());
    let mut nodes = Nodes::default();
    for group in std::mem::take(&mut file.groups) {
        nodes.begin(&group, &scene);
        let material = match &group.material {
            None => *grey.get_or_insert_with(|| push(&mut scene, material::grey(String::new()))),
            Some(name) => match materials.get(name) {
                Some(index) => index,
                None => *unknown.entry(name.clone()).or_insert_with(|| {
                    let shown = text::shown(without_comment(name));
                    // a missing library says it all
                    if is_complete {
                        scene.report.warnings.push(format!("the material `{shown}` is not defined: replaced by grey"));
                    }
                    push(&mut scene, material::grey(shown))
                }),
            },
        };
        let triangles = weld(&file, &group, origin, &mut keys);
        let name = text::shown(&group.name);
        let mesh = scene.meshes.len();
        let object_to_world = DAffine3::from_translation(origin);
        scene.instances.push(Instance { name: name.clone(), mesh, object_to_world });
        scene.meshes.push(Mesh { name, geometry: Geometry::Triangles(triangles), material, source: None });
    }
    scene.nodes = nodes.builder.finish(&scene);
    Ok(scene)
}

/// The nodes of a file: an object is above its groups, and a group above its runs of one material.
#[derive(Default)]
struct Nodes {
    builder: NodeTreeBuilder,
    /// Names of the object and the group that are open; empty for none.
    open: [String; 2],
}

impl Nodes {
    /// Begins what a run of faces is in, unless the one before was in the same.
    fn begin(&mut self, run: &Group, scene: &Scene) {
        // faces after `o` alone have its name
        let group = if run.name == run.object { "" } else { &*run.name };
        let names = [&*run.object, group];
        let Some(first) = (0..2).find(|k| self.open[*k] != names[*k]) else { return };

        // from the first that differs on
        let mut level = names[..first].iter().filter(|name| !name.is_empty()).count();
        self.builder.end(level, scene);
        for (open, name) in self.open.iter_mut().zip(names).skip(first) {
            name.clone_into(open);
            if !name.is_empty() {
                self.builder.begin(level, &text::shown(name), scene);
                level += 1;
            }
        }
    }
}

/// Warnings that name statements which are not used.
fn unused_statements(file: &ObjFile) -> Vec<String> {
    let list: Vec<String> = file.unused.iter().map(|(key, count)| format!("{key} ({count})")).collect();
    let unused = (!list.is_empty()).then(|| {
        let list = list.join(", ");
        format!("statements of the .obj about points, lines, curves or their display are not used: {list}")
    });
    let (words, count) = &file.unknown;
    let shown = words.iter().map(|(word, line)| format!("`{}` (line {line})", text::shown(word)));
    let unknown = (*count > 0).then(|| {
        let list = shown.collect::<Vec<_>>().join(", ");
        format!(
            "{count} lines of the .obj begin with a word that is no statement of the format, and are not used: {list}"
        )
    });
    unused.into_iter().chain(unknown).collect()
}

fn push(scene: &mut Scene, material: Material) -> usize {
    scene.materials.push(material);
    scene.materials.len() - 1
}

/// Reads the material libraries that a file names, or the one that is called as it is. Returns
/// false if one is missing.
fn read_libraries(file: &ObjFile, path: &Path, materials: &mut MaterialLibrary, scene: &mut Scene) -> Result<bool> {
    // each once, however often it is named
    let (mut said, mut read) = (HashSet::new(), HashSet::new());
    let mut missing: Vec<(String, Vec<PathBuf>)> = Vec::new();
    for statement in file.libraries.iter().filter(|statement| said.insert(statement.as_str())) {
        for (name, found) in libraries(statement, path, materials) {
            match found {
                Ok(mtl) if read.contains(&mtl) => {}
                Ok(mtl) => {
                    materials.read(&mtl, path, scene)?;
                    scene.report.files.push(mtl.clone());
                    read.insert(mtl);
                }
                Err(searched) => missing.push((text::shown(name), searched)),
            }
        }
    }
    let is_complete = missing.is_empty();
    let mut instead = "its materials are replaced by grey".to_owned();
    if read.is_empty() && file.groups.iter().any(|g| g.material.is_some()) {
        let same = path.with_extension("mtl");
        let name = same.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // beside the model alone: in the folders above, it would be another's
        if let Some(mtl) = materials.find(&[&name], path).ok().filter(|mtl| mtl.parent() == absolute(&same).parent()) {
            materials.read(&mtl, path, scene)?;
            scene.report.files.push(mtl);
            instead = format!("{name} is read in its place");
        }
    }
    for (name, searched) in missing {
        let searched = find::list(&searched);
        scene.report.warnings.push(format!("the material library `{name}` was not found in {searched}: {instead}"));
    }
    Ok(is_complete)
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// A library's name, and its file or where that was searched for.
type FoundLibrary<'a> = (&'a str, Result<PathBuf, Vec<PathBuf>>);

/// The libraries of a statement: one whose name may hold spaces, if there is such a file, or a list
/// of names, of which some may hold spaces or be in quotation marks.
fn libraries<'a>(statement: &'a str, path: &Path, materials: &mut MaterialLibrary) -> Vec<FoundLibrary<'a>> {
    let list = without_comment(statement);
    let whole = materials.find(&[statement, list, unquoted(list)], path);
    let words = word_ranges(list);
    if whole.is_ok() || words.len() < 2 {
        return vec![(unquoted(list), whole)];
    }
    let mut found = Vec::new();
    let mut next = 0;
    while let Some(&(start, end)) = words.get(next) {
        // the longest run of words that is a file; longer ones are nobody's name
        let runs = words[next..].iter().take(MAX_WORDS).enumerate().rev();
        let run = runs
            .map(|(more, &(_, end))| (more, unquoted(&list[start..end])))
            .find_map(|(more, name)| Some((more, name, materials.find(&[name], path).ok()?)));
        match run {
            Some((more, name, mtl)) => {
                found.push((name, Ok(mtl)));
                next += more + 1;
            }
            None => {
                let name = unquoted(&list[start..end]);
                found.push((name, materials.find(&[name], path)));
                next += 1;
            }
        }
    }
    found
}

/// Most words of a library's name in a list.
const MAX_WORDS: usize = 6;

/// Where the words of a text are; what stands in quotation marks is one.
fn word_ranges(text: &str) -> Vec<(usize, usize)> {
    let (mut ranges, mut start, mut is_quoted) = (Vec::new(), None, false);
    for (i, c) in text.char_indices() {
        if c == '"' {
            is_quoted = !is_quoted;
        }
        match start {
            None if !c.is_ascii_whitespace() => start = Some(i),
            Some(from) if c.is_ascii_whitespace() && !is_quoted => {
                ranges.push((from, i));
                start = None;
            }
            _ => {}
        }
    }
    ranges.extend(start.map(|from| (from, text.len())));
    ranges
}

/// The point that meshes are relative to: zero, or the centre of a model that is far from its
/// origin for its size, so that single precision is spent on the model. It is the same for all
/// meshes: those that share a vertex still do.
fn origin(file: &ObjFile) -> DVec3 {
    let none = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let add = |(lo, hi): (DVec3, DVec3), triangle: &[Corner; 3]| {
        let [a, b, c] = triangle.map(|corner| file.positions[corner.position as usize]);
        (lo.min(a).min(b).min(c), hi.max(a).max(b).max(c))
    };
    let union = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
    let of_group = |g: &Group| g.triangles.par_iter().with_min_len(MIN_TRIANGLES).fold(none, add).reduce(none, union);
    let bounds = file.groups.iter().map(of_group).fold(none(), union);
    if bounds.0.x <= bounds.1.x { distant_centre(bounds.0, bounds.1) } else { DVec3::ZERO }
}

/// Makes one vertex of each combination of position, texture coordinate and normal in a mesh.
fn weld(file: &ObjFile, group: &Group, origin: DVec3, keys: &mut PositionKeys) -> TriangleMesh {
    keys.clear();
    let any = |has: fn(&Corner) -> bool| {
        group.triangles.par_iter().with_min_len(MIN_TRIANGLES).any(|triangle| triangle.iter().any(has))
    };
    let (with_normals, with_texcoords) = (any(|c| c.normal != NONE), any(|c| c.texcoord != NONE));
    let mut mesh = TriangleMesh { indices: Vec::with_capacity(group.triangles.len()), ..TriangleMesh::default() };
    for triangle in &group.triangles {
        let indices = triangle.map(|corner| {
            let index = keys.index(corner.position, [corner.texcoord, corner.normal]);
            if index as usize == mesh.positions.len() {
                mesh.positions.push((file.positions[corner.position as usize] - origin).as_vec3());
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
            }
            index
        });
        mesh.indices.push(indices);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_quotation_marks() {
        let words = |text: &'static str| word_ranges(text).into_iter().map(|(a, b)| &text[a..b]).collect::<Vec<_>>();
        assert_eq!(words("a.mtl \t\"b c.mtl\" d"), ["a.mtl", "\"b c.mtl\"", "d"]);
        assert_eq!(words(" \"open b"), ["\"open b"]);
        assert!(words(" ").is_empty());
    }
}
