//! References that stay below a folder: what the scene of a stranger may read.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::folder_of;

/// Which files a scene may refer to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Confine<'a> {
    /// Any.
    #[default]
    Nowhere,
    /// Files below the folder of the scene's file.
    SceneFolder,
    /// Files below this folder.
    Folder(&'a Path),
}

impl Confine<'_> {
    /// The folder without links that references of this scene may not leave; `None`: they may be
    /// anywhere.
    ///
    /// # Errors
    /// [`Error::Input`] for a folder that does not exist, and for a scene's file that is a link
    /// which leads out of its folder.
    pub fn folder_for(self, scene: &Path) -> Result<Option<PathBuf>> {
        let folder = match self {
            Self::Nowhere => return Ok(None),
            Self::SceneFolder => folder_of(scene),
            Self::Folder(folder) => folder,
        };
        let folder = fs::canonicalize(folder).map_err(|e| Error::read(folder, &e))?;
        // a file that is missing is reported by whoever reads it
        if fs::canonicalize(scene).is_ok_and(|path| !path.starts_with(&folder)) {
            return Err(Error::input(scene, "is a link that leads out of its folder, which --confine does not allow"));
        }
        Ok(Some(folder))
    }
}

impl<'a> Confine<'a> {
    /// The folder, once it is known.
    pub(super) fn folder(self) -> Option<&'a Path> {
        if let Self::Folder(folder) = self { Some(folder) } else { None }
    }
}

/// The path without links of what lies below `folder`, which has none either; `None` for what does
/// not exist or lies elsewhere.
pub fn below(folder: &Path, path: &Path) -> Option<PathBuf> {
    fs::canonicalize(path).ok().filter(|path| path.starts_with(folder))
}

/// Whether a name that is used from the folder `from`, which lies below `folder`, leads out of it:
/// as it is written, whether there is such a file or not, or by a link.
pub(super) fn leaves(folder: &Path, from: &Path, name: &Path) -> bool {
    if name.is_absolute() {
        return true;
    }
    let mut path = from.to_owned();
    for component in name.components() {
        match component {
            Component::ParentDir => {
                path.pop();
            }
            Component::CurDir => {}
            other => path.push(other),
        }
        if !path.starts_with(folder) {
            return true;
        }
    }
    fs::canonicalize(from.join(name)).is_ok_and(|path| !path.starts_with(folder))
}

/// Says that a reference leads out of the folder, as the end of a sentence.
pub fn refusal(name: &str) -> String {
    let shown: String = name.chars().take(100).collect();
    format!("refers to {shown}, outside of its folder, which --confine does not allow")
}

/// Checks a file that settings beside a scene name, or the files in a folder that they name.
///
/// # Errors
/// [`Error::Input`] about `owner`, which names it.
pub fn check(folder: &Path, owner: &Path, path: &Path) -> Result<()> {
    let refuse = || Err(Error::input(owner, refusal(&path.to_string_lossy())));
    let Some(real) = below(folder, path) else {
        // what does not exist is an error of its own, unless asking for it tells what lies
        // elsewhere
        let from = fs::canonicalize(folder_of(owner)).unwrap_or_default();
        let name = path.strip_prefix(folder_of(owner)).unwrap_or(path);
        return if leaves(folder, &from, name) { refuse() } else { Ok(()) };
    };
    let mut inside = fs::read_dir(&real).into_iter().flatten().flatten();
    if inside.any(|file| fs::canonicalize(file.path()).is_ok_and(|real| !real.starts_with(folder))) {
        refuse()
    } else {
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_leads_out() {
        let dir = tempfile::tempdir().unwrap();
        let top = fs::canonicalize(dir.path()).unwrap();
        let folder = top.join("scene");
        fs::create_dir_all(folder.join("maps")).unwrap();
        for file in ["secret", "scene/a", "scene/maps/b"] {
            fs::write(top.join(file), "x").unwrap();
        }
        std::os::unix::fs::symlink("../secret", folder.join("link")).unwrap();
        std::os::unix::fs::symlink("..", folder.join("up")).unwrap();
        std::os::unix::fs::symlink("maps/b", folder.join("inner")).unwrap();
        let out = |from: &str, name: &str| leaves(&folder, &folder.join(from), Path::new(name));
        for name in
            ["../secret", "../none", "/etc/passwd", "/none", "link", "up/secret", "maps/../../secret", "../scene/a"]
        {
            assert!(out("", name), "{name}");
        }
        for name in ["a", "none", "maps/b", "maps/../a", "./a", "inner", "maps/none/../b"] {
            assert!(!out("", name), "{name}");
        }
        assert!(!out("maps", "../a") && out("maps", "../../secret"));
        assert_eq!(below(&folder, &folder.join("inner")), Some(folder.join("maps/b")));
        assert_eq!(below(&folder, &folder.join("link")), None);
        // settings name files, and folders with the faces of a cube
        let owner = folder.join("skylit.toml");
        check(&folder, &owner, &folder.join("maps")).unwrap();
        for path in [folder.join("../secret"), folder.join("link"), "/etc/passwd".into(), folder.clone()] {
            let error = check(&folder, &owner, &path).unwrap_err();
            assert!(error.exit_code() == 3 && error.to_string().contains("--confine"), "{error}");
        }
    }
}
