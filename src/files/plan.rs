//! Which files a command reads and which it will write: no output takes the place of an input, or
//! of another output. Folders that it makes for them go again if nothing comes.
//!
//! Files are compared by what they are, not by how they are spelled: `a.png` and `./a.png`, a link
//! and what it points to, and two hard links to one file are the same.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{folder_of, link_target};
use crate::error::{Error, Result};

/// The files of a command.
///
/// ```
/// use skylit::files::plan::FilePlan;
///
/// let mut plan = FilePlan::default();
/// plan.reads("the scene", "scene.glb");
/// plan.writes("-o", "image.png");
/// plan.check()?;
/// plan.writes("--depth-image", "./image.png");
/// assert!(plan.check().is_err());
/// # Ok::<(), skylit::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct FilePlan {
    outputs: Vec<(String, PathBuf)>,
    inputs: Vec<(String, PathBuf)>,
    folders: Vec<Arc<NewFolder>>,
}

/// The folders of a path that were made for results, innermost first. Those that are still empty
/// when it is dropped are removed.
#[derive(Debug)]
struct NewFolder(Vec<PathBuf>);

impl NewFolder {
    fn create(folder: &Path) -> Result<Self> {
        let is_missing = |path: &&Path| !path.as_os_str().is_empty() && fs::symlink_metadata(path).is_err();
        let made = Self(folder.ancestors().take_while(is_missing).map(Path::to_owned).collect());
        fs::create_dir_all(folder).map_err(|e| Error::write(folder, &e))?;
        Ok(made)
    }
}

impl Drop for NewFolder {
    fn drop(&mut self) {
        // a folder that is not empty stays, and all around it
        let _ = self.0.iter().try_for_each(fs::remove_dir);
    }
}

/// Identity of a file, however its path is spelled.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// Device and number of a file that exists.
    #[cfg(unix)]
    Inode(u64, u64),
    /// The path without links of a file that exists, where files have no numbers.
    #[cfg(not(unix))]
    Existing(PathBuf),
    /// The path without links that a new file will have, in lower case: file systems that ignore
    /// case have one such file.
    New(String),
}

impl Identity {
    /// `None` for a device, FIFO or socket, which is written to and not replaced.
    fn from_path(path: &Path) -> Option<Self> {
        match fs::metadata(path) {
            Ok(found) if !found.is_file() && !found.is_dir() => None,
            #[cfg(unix)]
            Ok(found) => {
                use std::os::unix::fs::MetadataExt;
                Some(Self::Inode(found.dev(), found.ino()))
            }
            #[cfg(not(unix))]
            Ok(_) => Some(Self::Existing(fs::canonicalize(path).ok()?)),
            Err(_) => {
                let path = link_target(path).unwrap_or_else(|_| path.to_owned());
                let folder = folder_of(&path);
                let folder = fs::canonicalize(folder).or_else(|_| std::path::absolute(folder)).ok()?;
                Some(Self::New(folder.join(path.file_name()?).to_string_lossy().to_lowercase()))
            }
        }
    }

    fn of_existing(path: &Path) -> Option<Self> {
        Self::from_path(path).filter(|identity| !matches!(identity, Self::New(_)))
    }
}

impl FilePlan {
    /// Adds a file that is read; `role` says in a message what it is: `the scene`, `--baseline`.
    /// What does not exist does not count.
    pub fn reads(&mut self, role: &str, path: impl AsRef<Path>) {
        self.inputs.push((role.to_owned(), path.as_ref().to_owned()));
    }

    /// Adds an image that is read, or all files of a folder of images.
    pub fn reads_images(&mut self, role: &str, path: impl AsRef<Path>) {
        let path = path.as_ref();
        if path.is_dir() {
            fs::read_dir(path).into_iter().flatten().flatten().for_each(|file| self.reads(role, file.path()))
        } else {
            self.reads(role, path)
        }
    }

    /// Adds a file that will be written, by the option that names it.
    pub fn writes(&mut self, option: &str, path: impl AsRef<Path>) {
        self.outputs.push((option.to_owned(), path.as_ref().to_owned()));
    }

    /// Adds the page of a report that will be written into a folder.
    pub fn writes_report(&mut self, option: &str, folder: impl AsRef<Path>) {
        self.writes(option, folder.as_ref().join("index.html"));
    }

    /// Makes a folder that results will be written into, where it is missing. It is taken away
    /// again with the plan's last copy, if nothing was written.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be made.
    pub fn make_folder(&mut self, folder: &Path) -> Result<()> {
        self.folders.push(Arc::new(NewFolder::create(folder)?));
        Ok(())
    }

    /// Whether a file that will be written exists already. None that does not can replace an input.
    pub fn replaces_files(&self) -> bool {
        self.outputs.iter().any(|(_, path)| path.is_file())
    }

    /// Fails if an output would replace an input, or another output.
    ///
    /// # Errors
    /// [`Error::Usage`], naming both.
    pub fn check(&self) -> Result<()> {
        let mut outputs: HashMap<Identity, (&str, &Path)> = HashMap::new();
        for (option, path) in &self.outputs {
            let Some(identity) = Identity::from_path(path) else { continue };
            if let Some((other, same)) = outputs.insert(identity, (option, path)) {
                let spelled = spelled(path, same);
                let who =
                    if other == option { format!("{option} is given twice") } else { format!("{other} and {option}") };
                let message = format!(
                    "{}: two outputs would be one file{spelled} ({who}): give each a name of its own",
                    path.display()
                );
                return Err(Error::Usage(message));
            }
        }
        self.inputs.iter().try_for_each(|(role, path)| check_input(&outputs, role, path))
    }

    /// Fails if an output would replace a file of a scene, which are known once it is loaded.
    ///
    /// # Errors
    /// [`Error::Usage`], naming both.
    pub fn check_scene(&self, files: &[PathBuf]) -> Result<()> {
        let mut outputs = HashMap::new();
        for (option, path) in &self.outputs {
            if let Some(identity) = Identity::of_existing(path) {
                outputs.insert(identity, (&**option, &**path));
            }
        }
        files.iter().try_for_each(|path| check_input(&outputs, "a file of the scene", path))
    }
}

fn check_input(outputs: &HashMap<Identity, (&str, &Path)>, role: &str, path: &Path) -> Result<()> {
    match Identity::of_existing(path).and_then(|identity| outputs.get(&identity)) {
        None => Ok(()),
        Some((option, output)) => Err(Error::Usage(format!(
            "{}: {option} would replace {role}{}, which is read: choose another name",
            output.display(),
            spelled(output, path)
        ))),
    }
}

/// The other spelling of a file, in parentheses, if there is one.
fn spelled(path: &Path, other: &Path) -> String {
    if path == other { String::new() } else { format!(" ({})", other.display()) }
}
