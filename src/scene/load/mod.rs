//! Loading of a [`Scene`]: a reader for each format, then `finish`, which establishes the guarantees of every scene.

mod brhan;
mod camera_path;
mod compact;
mod environment;
mod find;
mod finish;
mod gltf;
mod normals;
mod obj;
mod picture;
mod tangents;

use std::path::Path;

pub use camera_path::load_camera_path;
pub use environment::load_environment;

use crate::error::{Error, Result};
use crate::scene::{Scene, builtin};

/// Extensions of scene files.
const FORMATS: [&str; 4] = ["gltf", "glb", "obj", "brhan"];

/// Loads a scene: a built-in one by name (`builtin:NAME`, or `NAME` alone where no such file exists), or a file by its
/// extension, in either case of letters: `.gltf`, `.glb`, `.obj`, `.brhan`.
///
/// A loaded scene has these guarantees: at least one instance has a triangle or sphere; at least one material exists; all
/// indices are in range; positions, normals, texture coordinates and transforms are finite; transforms can be inverted;
/// no triangle is degenerate, except in deforming meshes if it has an area in another pose; normals have unit length; tangents exist where a material needs them. Repairs that
/// this took are in [`Scene::report`].
///
/// # Errors
/// [`Error::Input`] for a file that is missing, broken or needs what skylit does not have; [`Error::Scene`] when nothing
/// is left to render; [`Error::Usage`] for a built-in scene that does not exist.
pub fn load(source: &str) -> Result<Scene> {
    if let Some(name) = source.strip_prefix("builtin:") {
        return builtin::by_name(name)
            .ok_or_else(|| Error::Usage(format!("no built-in scene is called `{name}`; `skylit scenes` lists them")));
    }
    let path = Path::new(source);
    let extension = extension(path);
    if !FORMATS.contains(&extension.as_str()) && !path.is_file() {
        if let Some(scene) = builtin::by_name(source) {
            return Ok(scene);
        }
        if extension.is_empty() && !path.exists() {
            return Err(Error::input(path, "no such file, and no built-in scene of that name (`skylit scenes` lists them)"));
        }
    }
    load_file(path)
}

/// Whether a path has the extension of a scene file; it need not exist.
pub fn is_scene_file(path: impl AsRef<Path>) -> bool {
    FORMATS.contains(&extension(path.as_ref()).as_str())
}

/// Loads a scene file by its extension; see [`load`].
///
/// # Errors
/// As [`load`].
pub fn load_file(path: &Path) -> Result<Scene> {
    let mut scene = read(path)?;
    scene.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    finish::finish(&mut scene, path)?;
    Ok(scene)
}

/// Reads any format, without [`finish`].
fn read(path: &Path) -> Result<Scene> {
    match extension(path).as_str() {
        "brhan" => brhan::read(path),
        _ => read_model(path),
    }
}

/// Reads the formats that hold models and may be named by another file, without [`finish`].
fn read_model(path: &Path) -> Result<Scene> {
    match extension(path).as_str() {
        "gltf" | "glb" => gltf::read(path),
        "obj" => obj::read(path),
        "brhan" => Err(Error::input(path, "is a whole scene, not a model")),
        "" => Err(Error::input(path, "has no extension; skylit reads .gltf, .glb, .obj and .brhan")),
        other => Err(Error::input(path, format!("cannot read .{other} files; skylit reads .gltf, .glb, .obj and .brhan"))),
    }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
