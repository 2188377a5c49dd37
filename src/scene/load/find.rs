//! Search for files that are referenced by other files, possibly with paths of another machine.

use std::path::{Path, PathBuf};

/// Number of parent folders to search above the referencing file's folder.
const ANCESTORS: usize = 3;

/// Looks for `name` beside the files in `beside` and in up to three folders above each, with and without a leading
/// `models/`. Backslashes count as slashes. The first that exists wins.
///
/// # Errors
/// The folders that were searched, each once, for the message.
pub(super) fn find(name: &str, beside: &[&Path]) -> Result<PathBuf, Vec<PathBuf>> {
    let name = name.replace('\\', "/");
    let mut names = vec![name.clone()];
    match name.strip_prefix("models/") {
        Some(short) => names.push(short.to_owned()),
        None => names.push(format!("models/{name}")),
    }
    let mut searched: Vec<PathBuf> = Vec::new();
    for file in beside {
        // absolute, because "scene.obj" has no ancestors to climb to
        let file = std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf());
        for folder in file.ancestors().skip(1).take(1 + ANCESTORS) {
            if searched.iter().any(|s| s == folder) {
                continue;
            }
            if let Some(found) = names.iter().map(|n| folder.join(n)).find(|p| p.is_file()) {
                return Ok(found);
            }
            searched.push(folder.to_owned());
        }
    }
    Err(searched)
}

/// The folders of a failed [`find`] as words.
pub(super) fn list(searched: &[PathBuf]) -> String {
    searched.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}
