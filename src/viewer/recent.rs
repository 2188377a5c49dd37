//! Scenes that were opened before, in a file of the cache folder.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::files;

/// Number of scenes that are remembered.
const MOST: usize = 10;

fn path() -> Option<PathBuf> {
    files::cache_folder().map(|folder| folder.join("recent.json"))
}

/// The scenes, the last one first; none if the file cannot be read.
pub fn load() -> Vec<String> {
    let bytes = path().and_then(|path| std::fs::read(path).ok());
    bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// Puts a scene first and saves the list. A failure only forgets.
pub fn add(recent: &mut Vec<String>, source: &str) {
    // the folder that a relative path refers to is another one next time
    let source = if source.starts_with("builtin:") {
        source.to_owned()
    } else {
        std::fs::canonicalize(source).map_or_else(|_| source.to_owned(), |p| p.to_string_lossy().into_owned())
    };
    recent.retain(|r| *r != source);
    recent.insert(0, source);
    recent.truncate(MOST);
    path().into_iter().for_each(|path| remember(&path, recent));
}

/// Writes something that the next time reads, as JSON. A failure only forgets.
pub(super) fn remember(path: &Path, value: &impl Serialize) {
    if let Some(folder) = path.parent() {
        let _ = std::fs::create_dir_all(folder);
    }
    let _ = files::write_atomically(path, |file| file.write_all(&serde_json::to_vec(value)?));
}
