//! Loading of a [`Scene`]: a reader for each format, then `finish`, which establishes the
//! guarantees of every scene.

mod brhan;
mod camera_path;
mod compact;
pub mod confine;
#[cfg(feature = "dds")]
mod dds;
mod environment;
mod find;
mod finish;
mod gltf;
#[cfg(feature = "ktx2")]
mod ktx2;
mod model;
mod nodes;
mod normals;
mod obj;
mod options;
mod orientation;
mod picture;
mod projection;
mod ranges;
mod smoothing;
mod split;
mod tangents;
#[cfg(any(feature = "dds", feature = "ktx2"))]
mod texels;
mod text;
mod vertices;
mod warnings;

use std::path::{Path, PathBuf};

pub use camera_path::load_camera_path;
pub use confine::Confine;
pub use environment::{load_environment, load_environment_with};
pub use finish::is_degenerate;
pub use gltf::source::{SourceFile, SourcePrimitive, StoredAttribute};
pub use options::{
    GeometryOptions, LoadOptions, LoadPart, LoadProgress, NormalSource, Projection, UpAxis, is_in_progress,
};

pub use picture::load_texture;
pub use tangents::tangents_of_corners;

use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::{Scene, builtin};
use model::{check_start, extension, read_model};
use options::{InProgress, Loading};

/// Extensions of scene files.
const FORMATS: [&str; 4] = ["gltf", "glb", "obj", "brhan"];

/// Loads a scene: a built-in one by name (`builtin:NAME`, or `NAME` alone where no such file
/// exists), or a file by its extension, in either case of letters: `.gltf`, `.glb`, `.obj`,
/// `.brhan`.
///
/// A loaded scene has these guarantees: at least one instance has a triangle or sphere; at least
/// one material exists; all indices are in range; positions, normals, texture coordinates and
/// transforms are finite; transforms can be inverted; no triangle is degenerate, except in
/// deforming meshes if it has an area in another pose; normals have unit length; tangents exist
/// where a material needs them. Repairs that this took are in [`Scene::report`].
///
/// # Errors
/// [`Error::Input`] for a file that is missing, broken or needs what skylit does not have;
/// [`Error::Scene`] when nothing is left to render; [`Error::Usage`] for a built-in scene that does
/// not exist.
pub fn load(source: &str) -> Result<Scene> {
    load_with(source, &LoadOptions::default())
}

/// As [`load`], with options.
///
/// # Errors
/// As [`load`].
pub fn load_with(source: &str, options: &LoadOptions) -> Result<Scene> {
    let mut scene = load_any(source, options)?;
    scene.report.options = options.flags();
    Ok(scene)
}

/// Loads a file or a built-in scene.
fn load_any(source: &str, options: &LoadOptions) -> Result<Scene> {
    let is_gltf = matches!(extension(Path::new(source)).as_str(), "gltf" | "glb");
    if let Some(scene) = options.scene.filter(|_| !is_gltf) {
        return Err(Error::Usage(format!("--gltf-scene {scene}: {source} is no glTF file, which may have several")));
    }
    if let Some(name) = source.strip_prefix("builtin:") {
        return match builtin::by_name(name) {
            Some(scene) => with_options(scene, options),
            None => Err(Error::Usage(format!("no built-in scene is called `{name}`; `skylit scenes` lists them"))),
        };
    }
    let path = Path::new(source);
    let extension = extension(path);
    if !FORMATS.contains(&extension.as_str()) && !path.is_file() {
        if let Some(scene) = builtin::by_name(source) {
            return with_options(scene, options);
        }
        if extension.is_empty() && !path.exists() {
            return Err(Error::input(
                path,
                "no such file, and no built-in scene of that name (`skylit scenes` lists them)",
            ));
        }
    }
    load_file_with(path, options)
}

/// A built-in scene with the normals and texture coordinates of the options.
fn with_options(mut scene: Scene, options: &LoadOptions) -> Result<Scene> {
    if options.geometry != GeometryOptions::default() {
        let name = scene.name.clone();
        finish::finish(&mut scene, Path::new(&name), options.geometry, &Budget::default())?;
    }
    Ok(scene)
}

/// The files that a scene is read from: models, materials, buffers and images, also those that
/// cannot be read. None of a built-in one.
///
/// # Errors
/// As [`load`].
pub fn files_of(source: &str) -> Result<Vec<PathBuf>> {
    Ok(load_with(source, &LoadOptions { textures: false, ..Default::default() })?.report.files)
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
    load_file_with(path, &LoadOptions::default())
}

fn load_file_with(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let _in_progress = InProgress::begin();
    let folder = options.confine.folder_for(path)?;
    let confine = folder.as_deref().map_or(Confine::Nowhere, Confine::Folder);
    let budget = Budget::default();
    let outcome = read(path, Loading { options: LoadOptions { confine, ..*options }, budget: &budget });
    // for which readers have other errors, or warnings
    budget.check().map_err(|e| e.in_file(path))?;
    let mut scene = outcome?;
    scene.report.files.insert(0, path.to_owned());
    scene.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if let Some(chosen) = options.scene {
        scene.name = format!("{}, scene {chosen}", scene.name);
    }
    finish::finish(&mut scene, path, options.geometry, &budget)?;
    scene.report.warnings = warnings::bounded(std::mem::take(&mut scene.report.warnings));
    Ok(scene)
}

/// Reads any format, without [`finish`].
fn read(path: &Path, loading: Loading) -> Result<Scene> {
    match extension(path).as_str() {
        "brhan" => check_start(path).and_then(|()| brhan::read(path, loading)),
        _ => read_model(path, loading),
    }
}
