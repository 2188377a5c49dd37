//! Loading of a [`Scene`]: a reader for each format, then `finish`, which establishes the guarantees of every scene.

mod brhan;
mod camera_path;
mod compact;
pub mod confine;
mod environment;
mod find;
mod finish;
mod gltf;
mod normals;
mod obj;
mod picture;
mod ranges;
mod tangents;
mod text;
mod warnings;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

pub use camera_path::load_camera_path;
pub use confine::Confine;
pub use environment::{load_environment, load_environment_with};

use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::{Scene, builtin};

/// How a scene is loaded.
#[derive(Clone, Copy)]
pub struct LoadOptions<'a> {
    /// Whether images are decoded. Without them materials have no textures, and [`crate::scene::LoadReport::skipped_images`] says what was left out.
    pub textures: bool,
    /// Called after each image that was decoded, from several threads.
    pub progress: &'a (dyn Fn(ImagesDecoded) + Sync),
    /// Where the files that a scene refers to have to lie. Those elsewhere are an error, and are not opened.
    pub confine: Confine<'a>,
}

/// Images decoded so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImagesDecoded {
    /// How many.
    pub done: usize,
    /// Of how many; of an .obj that is not known before.
    pub of: Option<usize>,
}

impl Default for LoadOptions<'_> {
    fn default() -> Self {
        Self { textures: true, progress: &|_| (), confine: Confine::Nowhere }
    }
}

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
    load_with(source, &LoadOptions::default())
}

/// As [`load`], with options.
///
/// # Errors
/// As [`load`].
pub fn load_with(source: &str, options: &LoadOptions) -> Result<Scene> {
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
    load_file_with(path, options)
}

/// The files that a scene is read from: models, materials, buffers and images, also those that cannot be read. None of a built-in one.
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

/// What all readers of a scene and its files have in common.
#[derive(Clone, Copy)]
struct Loading<'a> {
    options: LoadOptions<'a>,
    budget: &'a Budget,
}

/// Number of files that are being loaded.
static IN_PROGRESS: AtomicUsize = AtomicUsize::new(0);

/// Whether a scene or an environment is being loaded, in any thread. A load does not ask whether it is to stop: it writes nothing, and whoever wants to stop may end the process.
pub fn is_in_progress() -> bool {
    IN_PROGRESS.load(Ordering::Relaxed) > 0
}

/// A load, while it lasts.
struct InProgress;

impl InProgress {
    fn begin() -> Self {
        IN_PROGRESS.fetch_add(1, Ordering::Relaxed);
        Self
    }
}

impl Drop for InProgress {
    fn drop(&mut self) {
        IN_PROGRESS.fetch_sub(1, Ordering::Relaxed);
    }
}

fn load_file_with(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let _in_progress = InProgress::begin();
    let folder = options.confine.folder_for(path)?;
    let confine = folder.as_deref().map_or(Confine::Nowhere, Confine::Folder);
    let budget = Budget::default();
    let outcome = read(path, Loading { options: LoadOptions { confine, ..*options }, budget: &budget });
    // for which readers have other errors, or warnings
    budget.check().map_err(|e| e.of(path))?;
    let mut scene = outcome?;
    scene.report.files.insert(0, path.to_owned());
    scene.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    finish::finish(&mut scene, path, &budget)?;
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

/// Refuses a file whose first bytes are those of something else that is often found under the name of a scene.
fn check_start(path: &Path) -> Result<()> {
    let start = crate::files::read_start(path)?;
    let archive = [(&b"PK\x03\x04"[..], "a ZIP archive"), (&[0x1f, 0x8b, 0x08], "compressed with gzip")];
    match archive.iter().find(|(signature, _)| start.starts_with(signature)) {
        Some((_, what)) => Err(Error::input(path, format!("is {what}: unpack it first"))),
        None => Ok(()),
    }
}

/// Reads the formats that hold models and may be named by another file, without [`finish`].
fn read_model(path: &Path, loading: Loading) -> Result<Scene> {
    match extension(path).as_str() {
        "gltf" | "glb" => check_start(path).and_then(|()| gltf::read(path, loading)),
        "obj" => check_start(path).and_then(|()| obj::read(path, loading)),
        "brhan" => Err(Error::input(path, "is a whole scene, not a model")),
        "" => Err(Error::input(path, "has no extension; skylit reads .gltf, .glb, .obj and .brhan")),
        other => Err(Error::input(path, format!("cannot read .{other} files; skylit reads .gltf, .glb, .obj and .brhan"))),
    }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
