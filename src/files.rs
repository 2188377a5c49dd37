//! Reading of whole files, atomic file output, and the cache folder.
//!
//! Readers say what lies in a file's place where it is not the file itself: a pointer of Git LFS or
//! git-annex, a web page, nothing.
//!
//! A file is written without a name in the folder of its target, where the system has such files
//! (Linux: `O_TMPFILE`), and gets its name once it is complete: whatever ends the process, no
//! incomplete file and no temporary file stays. Elsewhere it is written under a name of its own
//! next to its target, and renamed.

pub mod plan;

use std::borrow::Cow;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::memory;

/// Most bytes of a text that people write: settings, manifests, scripts.
const MAX_TEXT: u64 = 64 << 20;

/// Number of first bytes by which a file is told from what others put in its place.
const START: u64 = 1024;

/// Whether the name of a file has this extension, in either case of letters.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Reads a file whole.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read, is empty, or holds something else in its place
/// ([`placeholder`]).
pub fn read(path: impl AsRef<Path>) -> Result<Vec<u8>> {
    let path = path.as_ref();
    let bytes = read_regular(path).map_err(|e| Error::read(path, &e))?;
    match placeholder(&bytes) {
        Some(message) => Err(Error::input(path, message)),
        None => Ok(bytes),
    }
}

/// Reads a file of UTF-8 text whole; an empty one is empty text.
///
/// # Errors
/// [`Error::Input`] as [`read`] has it, and for bytes that are no UTF-8.
pub fn read_text(path: impl AsRef<Path>) -> Result<String> {
    let path = path.as_ref();
    let text = read_regular_text(path).map_err(|e| Error::read(path, &e))?;
    match placeholder(text.as_bytes()).filter(|_| !text.is_empty()) {
        Some(message) => Err(Error::input(path, message)),
        None => Ok(text),
    }
}

/// The first bytes of a file, for readers that do not take it whole: enough to tell formats by
/// their signatures.
///
/// # Errors
/// Those of [`read`].
pub fn read_start(path: impl AsRef<Path>) -> Result<Vec<u8>> {
    let path = path.as_ref();
    let mut start = Vec::new();
    let read = open_regular(path).and_then(|file| file.take(START).read_to_end(&mut start));
    read.map_err(|e| Error::read(path, &e))?;
    match placeholder(&start) {
        Some(message) => Err(Error::input(path, message)),
        None => Ok(start),
    }
}

/// Says which placeholder begins with these bytes, and the remedy, as the end of a sentence; `None`
/// if it may be the file itself.
pub fn placeholder(bytes: &[u8]) -> Option<&'static str> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |word: &str| text.get(..word.len()).is_some_and(|t| t.eq_ignore_ascii_case(word.as_bytes()));
    if bytes.is_empty() {
        Some("is empty: it has no bytes (a copy or download that failed?)")
    } else if begins("version https://git-lfs.github.com/spec/") || begins("version https://hawser.github.com/spec/") {
        Some("is a Git LFS pointer in place of the file itself: fetch that with `git lfs pull`")
    } else if bytes.len() < 512 && begins("/annex/objects/") {
        Some("is a git-annex pointer in place of the file itself: fetch that with `git annex get`")
    } else if begins("<!doctype html") || begins("<html") {
        Some("is an HTML page in place of the file itself (a download that needs a login, or a page about the file?)")
    } else {
        None
    }
}

/// A path's target, which decides how it is written.
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
            // renaming would succeed on a write-protected file in a folder of ours: ask the file
            // itself
            OpenOptions::new().write(true).open(path)?;
            // a symbolic link stays; what it points to is replaced
            Ok(Target::File { path: fs::canonicalize(path)?, permissions: Some(m.permissions()) })
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            if path.file_name().is_none() {
                return Err(io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file"));
            }
            // a link to a file that does not exist stays, too: that file is made
            Ok(Target::File { path: link_target(path)?, permissions: None })
        }
        Err(e) => Err(e),
    }
}

/// Most links that are followed one after another, as Linux has it.
const MAX_LINKS: usize = 40;

/// The path that a name stands for once its own symbolic links are followed, whether there is a
/// file or not.
///
/// # Errors
/// More links than a system follows.
pub fn link_target(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many symbolic links"))
}

/// Opens a regular file to read. A device, FIFO or socket, which may never end or never answer, is
/// an error at once, and so is a folder.
///
/// # Errors
/// Those of the system, and [`io::ErrorKind::InvalidInput`] for what is no regular file.
pub fn open_regular(path: &Path) -> io::Result<File> {
    #[cfg(feature = "probes")]
    probes::wait(path);
    let mut options = OpenOptions::new();
    options.read(true);
    // a FIFO without a writer does not block
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(i32::try_from(rustix::fs::OFlags::NONBLOCK.bits()).unwrap_or_default());
    }
    let file = options.open(path)?;
    let kind = file.metadata()?;
    match (kind.is_file(), kind.is_dir()) {
        (true, _) => Ok(file),
        (_, true) => Err(io::ErrorKind::IsADirectory.into()),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")),
    }
}

/// A file that does not open yet, as on a slow disk, for tests.
#[cfg(feature = "probes")]
pub mod probes {
    use std::path::{Path, PathBuf};
    use std::sync::{Condvar, Mutex, PoisonError};

    static HELD: Mutex<Option<PathBuf>> = Mutex::new(None);
    static CHANGED: Condvar = Condvar::new();

    /// Who opens this path waits until another one is held, or none.
    pub fn hold(path: Option<&Path>) {
        *HELD.lock().unwrap_or_else(PoisonError::into_inner) = path.map(Path::to_owned);
        CHANGED.notify_all();
    }

    pub(super) fn wait(path: &Path) {
        let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        drop(CHANGED.wait_while(held, |held| held.as_deref() == Some(path)));
    }
}

/// The bytes of a regular file.
///
/// # Errors
/// Those of [`open_regular`], and [`io::ErrorKind::OutOfMemory`] for a file that is larger than
/// what files may take ([`memory::limit`]).
pub fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    read_up_to(open_regular(path)?, memory::limit(), io::ErrorKind::OutOfMemory)
}

/// The bytes of a file of at most this size, also where it grows meanwhile; `kind`: the error of a
/// larger one.
fn read_up_to(file: File, max: u64, kind: io::ErrorKind) -> io::Result<Vec<u8>> {
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    if length <= max {
        // what cannot be had is an error of memory, and no panic
        bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
        file.take(max.saturating_add(1)).read_to_end(&mut bytes)?;
    }
    if length > max || bytes.len() as u64 > max {
        let size = length.max(bytes.len() as u64);
        return Err(io::Error::new(kind, format!("{size} bytes are more than the {max} that may be read")));
    }
    Ok(bytes)
}

/// The text of a regular file.
///
/// # Errors
/// Those of [`open_regular`], and [`io::ErrorKind::InvalidData`] for bytes that are no UTF-8.
pub fn read_regular_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_up_to(open_regular(path)?, MAX_TEXT, io::ErrorKind::FileTooLarge)?)
        .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e.utf8_error()))
}

/// Whether a file belongs to this process's user or to root; true where files have no owners.
pub fn is_own(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|m| is_owned(&m))
}

/// Whether what this describes belongs to this process's user or to root; true where files have no
/// owners.
pub fn is_owned(metadata: &fs::Metadata) -> bool {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::MetadataExt;
        metadata.uid() == 0 || metadata.uid() == rustix::process::geteuid().as_raw()
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = metadata;
        true
    }
}

/// The folder of a file; `.` for a name alone.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Names of temporary files.
fn temporary_name() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".skylit-").suffix(".tmp");
    // subject to the umask: the mode of any newly created file
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

/// A file that is not yet at its place.
#[derive(Debug)]
enum Temporary {
    /// It has no name, and is gone when it is closed.
    #[cfg(target_os = "linux")]
    Unnamed(File),
    /// It has one, and is removed on drop.
    Named(tempfile::NamedTempFile),
}

impl Temporary {
    /// Creates an empty file in the folder of `path`.
    fn beside(path: &Path) -> io::Result<Self> {
        #[cfg(target_os = "linux")]
        {
            use std::os::unix::fs::OpenOptionsExt;
            let unnamed = i32::try_from(rustix::fs::OFlags::TMPFILE.bits()).unwrap_or_default();
            let opened =
                OpenOptions::new().read(true).write(true).custom_flags(unnamed).mode(0o666).open(folder_of(path));
            // whatever keeps it from being created, a file with a name fails for the same reason,
            // or the file system has only those
            match opened {
                Ok(file) => return Ok(Self::Unnamed(file)),
                // what makes the file with a name has no error that says so
                Err(e) if crate::error::is_out_of_descriptors(&e) => return Err(e),
                Err(_) => {}
            }
        }
        named_beside(path).map(Self::Named)
    }

    fn file(&self) -> &File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => file,
            Self::Named(file) => file.as_file(),
        }
    }

    fn file_mut(&mut self) -> &mut File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => file,
            Self::Named(file) => file.as_file_mut(),
        }
    }

    /// Puts it in the place of `path`, which lies in the folder that it was created for.
    fn persist(self, path: &Path) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed(mut file) => match link(&file, path) {
                Ok(()) => Ok(()),
                // without /proc a file gets no name later
                Err(_) => {
                    let mut named = named_beside(path)?;
                    file.rewind()?;
                    io::copy(&mut file, named.as_file_mut())?;
                    named.as_file().set_permissions(file.metadata()?.permissions())?;
                    Self::Named(named).persist(path)
                }
            },
            Self::Named(file) => file.persist(path).map(drop).map_err(|e| e.error),
        }
    }
}

/// Gives a file without a name the name `path`, in place of a file that has it.
#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> io::Result<()> {
    use std::os::fd::AsRawFd;
    let source = format!("/proc/self/fd/{}", file.as_raw_fd());
    let link = |name: &Path| {
        rustix::fs::linkat(rustix::fs::CWD, &source, rustix::fs::CWD, name, rustix::fs::AtFlags::SYMLINK_FOLLOW)
            .map_err(io::Error::from)
    };
    match link(path) {
        // a link replaces nothing: under a name of its own first, then renamed
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {
            let named = temporary_name().make_in(folder_of(path), link)?;
            named.into_temp_path().persist(path).map_err(|e| e.error)
        }
        done => done,
    }
}

/// Creates an empty temporary file in the folder of `path`, removed on drop unless it is renamed.
fn named_beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    temporary_name().tempfile_in(folder_of(path)).map_err(|e| match e.kind() {
        // the folder is a file
        io::ErrorKind::NotADirectory => io::ErrorKind::NotFound.into(),
        kind => kind.into(), // without the name of the temporary file, which says nothing to the user
    })
}

/// Checks, before long work starts, that `path` can be written: its folder must exist and accept
/// new files, and an existing file must be writable (or a device). Leaves no files behind.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || match target(path)? {
        Target::File { path, .. } => Temporary::beside(&path).map(drop),
        Target::Stream => Ok(()),
    };
    check().map_err(|e| Error::write(path, &e))
}

/// A file that replaces its target once it is complete. An existing file stays until then; dropped
/// without [`AtomicFile::commit`], it leaves nothing behind. An existing file keeps its
/// permissions, a symbolic link stays a link; a device or FIFO receives the bytes on commit.
#[derive(Debug)]
pub struct AtomicFile {
    /// The path as the user gave it.
    path: PathBuf,
    destination: Destination,
}

#[derive(Debug)]
enum Destination {
    Beside { file: Temporary, path: PathBuf, permissions: Option<Permissions> },
    Stream(File),
}

impl AtomicFile {
    /// Creates an empty file that will become `path`.
    pub fn create(path: &Path) -> Result<Self> {
        let destination = || match target(path)? {
            Target::File { path, permissions } => {
                Ok(Destination::Beside { file: Temporary::beside(&path)?, path, permissions })
            }
            Target::Stream => Ok(Destination::Stream(tempfile::tempfile()?)),
        };
        let destination = destination().map_err(|e| Error::write(path, &e))?;
        Ok(Self { path: path.to_owned(), destination })
    }

    /// The temporary file to write to.
    pub fn file(&mut self) -> &mut File {
        match &mut self.destination {
            Destination::Beside { file, .. } => file.file_mut(),
            Destination::Stream(file) => file,
        }
    }

    /// Another handle to [`AtomicFile::file`], for writers that own theirs. It has to be flushed
    /// before [`AtomicFile::commit`].
    pub fn handle(&mut self) -> Result<File> {
        self.file().try_clone().map_err(|e| self.failed(&e))
    }

    /// Replaces the target by what was written.
    pub fn commit(self) -> Result<()> {
        let Self { path: named, destination } = self;
        let run = || match destination {
            Destination::Beside { file, path, permissions } => {
                if let Some(permissions) = permissions {
                    file.file().set_permissions(permissions)?;
                }
                file.persist(&path)
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

/// Lets `write` fill an [`AtomicFile`]: on failure nothing is left behind, and an existing file is
/// unchanged.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write(file.file()).map_err(|e| file.failed(&e))?;
    file.commit()
}

/// Names of files for records in JSON, which is Unicode: bytes of a name that are none are replaced
/// (U+FFFD).
pub fn lossy(paths: &[PathBuf]) -> Vec<Cow<'_, str>> {
    paths.iter().map(|path| path.to_string_lossy()).collect()
}

/// Serializes a path as [`lossy`] shows it.
///
/// # Errors
/// Those of the serializer.
pub fn serialize_lossy<S: serde::Serializer>(path: &Path, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// The name of a file as metadata of images have it, which may leave this machine: relative to the
/// working directory if it is below it, else without its folders if it is an absolute path. Other
/// names, such as `builtin:NAME`, stay.
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

/// Variables that name folders of the user.
const FOLDER_VARIABLES: [&str; 5] = ["HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "LOCALAPPDATA", "APPDATA"];

/// The folder that a variable names; `None` for one that is not set, empty or relative. The XDG
/// Base Directory Specification says to ignore relative paths, which would put files into whatever
/// folder the program is started in.
fn user_folder(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}

/// Variables that name a folder of the user by a relative path, and are ignored for it, with that
/// path.
pub fn ignored_user_folders() -> Vec<(&'static str, PathBuf)> {
    let value = |name| std::env::var_os(name).map(|value| (name, PathBuf::from(value)));
    FOLDER_VARIABLES
        .into_iter()
        .filter_map(value)
        .filter(|(_, path)| path.is_relative() && !path.as_os_str().is_empty())
        .collect()
}

/// The folder of this program below that of a variable, or else below the system's: on Windows that
/// of the variable `windows`, elsewhere `below` the user's home. `None` where no variable is set.
fn own_folder(variable: &str, windows: &str, below: &str) -> Option<PathBuf> {
    let of_system = || if cfg!(windows) { user_folder(windows) } else { Some(user_folder("HOME")?.join(below)) };
    user_folder(variable).or_else(of_system).map(|folder| folder.join("skylit"))
}

/// The cache folder: `$XDG_CACHE_HOME/skylit`, else `~/.cache/skylit` or, on Windows,
/// `%LOCALAPPDATA%\skylit`; `None` without these variables.
pub fn cache_folder() -> Option<PathBuf> {
    own_folder("XDG_CACHE_HOME", "LOCALAPPDATA", ".cache")
}

/// The folder of settings: `$XDG_CONFIG_HOME/skylit`, else `~/.config/skylit` or, on Windows,
/// `%APPDATA%\skylit`; `None` without these variables.
pub fn config_folder() -> Option<PathBuf> {
    own_folder("XDG_CONFIG_HOME", "APPDATA", ".config")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_in_the_place_of_a_file() {
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935\nsize 12345\n";
        let says = [
            (&b""[..], "is empty"),
            (pointer, "is a Git LFS pointer"),
            (b"version https://hawser.github.com/spec/v1\noid sha256:4d\nsize 1\n", "is a Git LFS pointer"),
            (b"/annex/objects/SHA256E-s31--4d.png\n", "is a git-annex pointer"),
            (b"\xef\xbb\xbf \r\n<!DOCTYPE html>\n<html>", "is an HTML page"),
            (b"<HTML><HEAD>", "is an HTML page"),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        for (bytes, words) in says {
            fs::write(&path, bytes).unwrap();
            assert!(read(&path).unwrap_err().to_string().contains(words), "{words}");
            assert!(read_start(&path).unwrap_err().to_string().contains(words), "{words}");
            assert!(bytes.is_empty() || read_text(&path).unwrap_err().to_string().contains(words), "{words}");
        }
        for bytes in [&b"glTF"[..], b"{}", b"# version https://git-lfs", b"\n\n", b"<htm"] {
            assert_eq!(placeholder(bytes), None);
        }
        // what never ends, or never answers, is no file to read
        #[cfg(unix)]
        for path in ["/dev/zero", "/dev/null"] {
            assert!(read(path).unwrap_err().to_string().ends_with("not a regular file"), "{path}");
        }
    }

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
