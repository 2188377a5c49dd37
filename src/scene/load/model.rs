//! Reads files that hold models, by their extensions.

use std::path::Path;

use super::options::Loading;
use super::{gltf, obj};
use crate::error::{Error, Result};
use crate::scene::Scene;

/// Refuses a file whose first bytes are those of something else that is often found under the name
/// of a scene.
pub(super) fn check_start(path: &Path) -> Result<()> {
    let start = crate::files::read_start(path)?;
    let archive = [(&b"PK\x03\x04"[..], "a ZIP archive"), (&[0x1f, 0x8b, 0x08], "compressed with gzip")];
    match archive.iter().find(|(signature, _)| start.starts_with(signature)) {
        Some((_, what)) => Err(Error::input(path, format!("is {what}: unpack it first"))),
        None => Ok(()),
    }
}

/// Reads the formats that hold models and may be named by another file, without [`super::finish`].
pub(super) fn read_model(path: &Path, loading: Loading) -> Result<Scene> {
    match extension(path).as_str() {
        "gltf" | "glb" => check_start(path).and_then(|()| gltf::read(path, loading)),
        "obj" => check_start(path).and_then(|()| obj::read(path, loading)),
        "brhan" => Err(Error::input(path, "is a whole scene, not a model")),
        "" => Err(Error::input(path, "has no extension; skylit reads .gltf, .glb, .obj and .brhan")),
        other => {
            Err(Error::input(path, format!("cannot read .{other} files; skylit reads .gltf, .glb, .obj and .brhan")))
        }
    }
}

/// The extension of a file, in small letters; empty if it has none.
pub(super) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
