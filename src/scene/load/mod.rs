//! Files to [`Scene`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::Scene;

/// Loads a scene: a built-in one by name (`builtin:NAME`), or a file by its extension (.gltf, .glb, .obj, .brhan).
pub fn load(source: &str) -> Result<Scene> {
    let path = Path::new(source);
    Err(Error::input(path, "unknown kind of scene file"))
}
