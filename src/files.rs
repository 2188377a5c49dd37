//! Atomic file output, and the cache folder.
//!
//! A file is written next to its target and renamed, so that an interrupted run leaves no incomplete file.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, Seek};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// What a path refers to, and how to write it.
enum Target {
    /// A regular file, existing or new: write next to it, then rename.
    File { path: PathBuf, permissions: Option<Permissions> },
    /// A device, FIFO or socket: renaming would replace it by a file, so copy into it.
    Stream,
}

fn target(path: &Path) -> io::Result<Target> {
    match fs::metadata(path) {
        Ok(m) if m.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(m) if !m.is_file() => Ok(Target::Stream),
        Ok(m) => {
            // renaming would succeed on a write-protected file in a folder of ours: ask the file itself
            OpenOptions::new().write(true).open(path)?;
            // a symbolic link stays; what it points to is replaced
            Ok(Target::File { path: fs::canonicalize(path)?, permissions: Some(m.permissions()) })
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            if path.file_name().is_none() {
                return Err(io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file"));
            }
            Ok(Target::File { path: path.to_owned(), permissions: None })
        }
        Err(e) => Err(e),
    }
}

/// Creates an empty temporary file in the folder of `path`, removed on drop unless it is renamed.
fn temporary_beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".skylit-").suffix(".tmp");
    // subject to the umask: the mode of any newly created file
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|e| match e.kind() {
        // the folder is a file
        io::ErrorKind::NotADirectory => io::ErrorKind::NotFound.into(),
        kind => kind.into(), // without the name of the temporary file, which says nothing to the user
    })
}

/// Checks, before long work starts, that `path` can be written: its folder must exist and accept new files, and an existing
/// file must be writable (or a device). Leaves no files behind.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || match target(path)? {
        Target::File { path, .. } => temporary_beside(&path).map(drop),
        Target::Stream => Ok(()),
    };
    check().map_err(|e| Error::write(path, &e))
}

/// A file that replaces its target once it is complete. An existing file stays until then; dropped without [`AtomicFile::commit`],
/// it leaves nothing behind. An existing file keeps its permissions, a symbolic link stays a link; a device or FIFO
/// receives the bytes on commit.
#[derive(Debug)]
pub struct AtomicFile {
    /// The path as the user gave it.
    path: PathBuf,
    destination: Destination,
}

#[derive(Debug)]
enum Destination {
    Beside { file: tempfile::NamedTempFile, path: PathBuf, permissions: Option<Permissions> },
    Stream(File),
}

impl AtomicFile {
    /// Creates an empty file that will become `path`.
    pub fn create(path: &Path) -> Result<Self> {
        let destination = || match target(path)? {
            Target::File { path, permissions } => Ok(Destination::Beside { file: temporary_beside(&path)?, path, permissions }),
            Target::Stream => Ok(Destination::Stream(tempfile::tempfile()?)),
        };
        let destination = destination().map_err(|e| Error::write(path, &e))?;
        Ok(Self { path: path.to_owned(), destination })
    }

    /// The temporary file to write to.
    pub fn file(&mut self) -> &mut File {
        match &mut self.destination {
            Destination::Beside { file, .. } => file.as_file_mut(),
            Destination::Stream(file) => file,
        }
    }

    /// Another handle to [`AtomicFile::file`], for writers that own theirs. It has to be flushed before [`AtomicFile::commit`].
    pub fn handle(&mut self) -> Result<File> {
        self.file().try_clone().map_err(|e| self.failed(&e))
    }

    /// Replaces the target by what was written.
    pub fn commit(self) -> Result<()> {
        let Self { path: named, destination } = self;
        let run = || match destination {
            Destination::Beside { file, path, permissions } => {
                if let Some(permissions) = permissions {
                    file.as_file().set_permissions(permissions)?;
                }
                file.persist(&path).map(drop).map_err(|e| e.error)
            }
            Destination::Stream(mut file) => {
                file.rewind()?;
                io::copy(&mut file, &mut OpenOptions::new().write(true).open(&named)?).map(drop)
            }
        };
        run().map_err(|e| Error::write(&named, &e))
    }

    /// The error of a failed write to this file.
    pub fn failed(&self, error: &io::Error) -> Error {
        Error::write(&self.path, error)
    }
}

/// Lets `write` fill an [`AtomicFile`]: on failure nothing is left behind, and an existing file is unchanged.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write(file.file()).map_err(|e| file.failed(&e))?;
    file.commit()
}

/// The name of a file as metadata of images have it, which may leave this machine: relative to the working directory if it is below it, else without its folders if it is an
/// absolute path. Other names, such as `builtin:NAME`, stay.
pub fn portable_name(name: &str) -> String {
    let path = Path::new(name);
    if !path.is_absolute() {
        return name.to_owned();
    }
    let folder = std::env::current_dir().unwrap_or_default();
    let below = |path: &Path, folder: &Path| path.strip_prefix(folder).ok().map(Path::to_owned);
    let real = || below(&fs::canonicalize(path).ok()?, &fs::canonicalize(&folder).ok()?);
    let relative = below(path, &folder).or_else(real).or_else(|| path.file_name().map(PathBuf::from));
    relative.map_or_else(String::new, |p| p.to_string_lossy().into_owned())
}

/// The cache folder: `$XDG_CACHE_HOME/skylit`, or `~/.cache/skylit`; `None` without either variable.
pub fn cache_folder() -> Option<PathBuf> {
    let base = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
    base.or_else(|| std::env::var_os("HOME").map(|h| PathBuf::from(h).join(".cache"))).map(|p| p.join("skylit"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_the_folders_of_a_machine() {
        let here = std::env::current_dir().unwrap();
        let absolute = |path: &Path| portable_name(path.to_str().unwrap());
        assert_eq!(absolute(&here.join("scenes/a b.glb")), Path::new("scenes").join("a b.glb").to_string_lossy());
        let elsewhere = tempfile::tempdir().unwrap();
        assert_eq!(absolute(&elsewhere.path().join("x.glb")), "x.glb");
        for stays in ["builtin:plane", "../x.glb", "a/x.glb", ""] {
            assert_eq!(portable_name(stays), stays);
        }
    }
}
