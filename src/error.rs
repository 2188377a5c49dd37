//! The errors of the whole program, in words a user can act on. Every error is one line that names
//! the thing and the remedy, and has a documented exit code (`skylit --help` and the README list
//! them).

use std::path::{Path, PathBuf};

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything skylit reports to its user.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A value on the command line, or a combination of values, that makes no sense.
    #[error("{0}")]
    Usage(String),

    /// No Vulkan loader, no device, or a device below the floor; no library that was asked for. The
    /// text names what is missing.
    #[error("{0}")]
    Device(String),

    /// A file that is missing, unreadable or broken, or that needs something skylit does not have.
    #[error("{}: {message}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// The fault and the remedy.
        message: String,
    },

    /// A scene that cannot be rendered (no triangles, NaN in the vertices), whichever file it came
    /// from.
    #[error("{0}")]
    Scene(String),

    /// A file that could not be written. Nothing half-written is left behind.
    #[error("{}: cannot write: {message}", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// The system's reason and what helps.
        message: String,
    },

    /// Host or device memory ran out.
    #[error("out of memory: {0}")]
    OutOfMemory(String),

    /// The driver gave up on the device (`VK_ERROR_DEVICE_LOST`).
    #[error("the Vulkan device was lost: {0}")]
    DeviceLost(String),

    /// A check that skylit was asked to make could not be made (`skylit verify` without a manifest,
    /// a frame that could not be rendered).
    #[error("{0}")]
    NotVerified(String),

    /// Any other Vulkan call that failed; `validation` messages end here too.
    #[error("Vulkan: {0}")]
    Vulkan(String),

    /// The user pressed Ctrl-C (or sent SIGTERM).
    #[error("interrupted")]
    Interrupted,

    /// The user did so, and finished parts of the work are kept; the text says how it goes on.
    #[error("interrupted: {0}")]
    Paused(String),

    /// A check that skylit was asked to make did not hold (tracers disagree, images differ).
    #[error("{0}")]
    CheckFailed(String),
}

/// The text of an error where this process, or the whole system, has as many files open as it may.
const NO_DESCRIPTORS: &str = "too many files are open: raise the limit (`ulimit -n`), or end other programs";

/// Returns true for the error of a system that opens no further file: the standard library has no
/// kind for `EMFILE` and `ENFILE`, which have the same numbers on all Unix systems.
pub(crate) fn is_out_of_descriptors(error: &std::io::Error) -> bool {
    cfg!(unix) && matches!(error.raw_os_error(), Some(23 | 24))
}

impl Error {
    /// The exit code of the process for this error.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::CheckFailed(_) | Error::Vulkan(_) => 1,
            Error::Device(_) | Error::NotVerified(_) => 2,
            Error::Input { .. } | Error::Scene(_) => 3,
            Error::Output { .. } => 4,
            Error::OutOfMemory(_) => 5,
            Error::DeviceLost(_) => 6,
            Error::Usage(_) => 64,
            Error::Interrupted | Error::Paused(_) => 130,
        }
    }

    /// An input file that is wrong in the way `message` says. Control characters, which names in a
    /// file may have, become spaces: the error is one line, and tells a terminal nothing.
    pub fn input(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        let mut message = message.into();
        if message.contains(char::is_control) {
            message = message.replace(char::is_control, " ");
        }
        Error::Input { path: path.as_ref().to_owned(), message }
    }

    /// The same error, named after a file where memory ran out while that was read.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> Self {
        match self {
            Error::OutOfMemory(message) => Error::OutOfMemory(format!("{}: {message}", path.as_ref().display())),
            other => other,
        }
    }

    /// A file that could not be read, with the system's reason in plain words.
    pub fn read(path: impl AsRef<Path>, error: &std::io::Error) -> Self {
        let message = match error.kind() {
            std::io::ErrorKind::NotFound => "no such file".to_owned(),
            std::io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
            std::io::ErrorKind::IsADirectory => "is a folder, not a file".to_owned(),
            std::io::ErrorKind::UnexpectedEof => "ends early: it was cut off".to_owned(),
            std::io::ErrorKind::OutOfMemory => {
                return Error::OutOfMemory(format!("{}: {error}; --memory-limit allows more", path.as_ref().display()));
            }
            _ if is_out_of_descriptors(error) => NO_DESCRIPTORS.to_owned(),
            _ => format!("cannot read: {error}"),
        };
        Self::input(path, message)
    }

    /// A file that could not be written.
    pub fn write(path: impl AsRef<Path>, error: &std::io::Error) -> Self {
        let message = match error.kind() {
            std::io::ErrorKind::StorageFull => "the disk is full".to_owned(),
            std::io::ErrorKind::QuotaExceeded => "the disk quota is used up".to_owned(),
            std::io::ErrorKind::FileTooLarge => {
                "it would be larger than files may be here: raise the limit (`ulimit -f unlimited`), or write less"
                    .to_owned()
            }
            std::io::ErrorKind::NotFound => "its folder does not exist (create it first)".to_owned(),
            std::io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
            std::io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only".to_owned(),
            std::io::ErrorKind::IsADirectory => "is a folder".to_owned(),
            _ if is_out_of_descriptors(error) => NO_DESCRIPTORS.to_owned(),
            _ => error.to_string(),
        };
        Error::Output { path: path.as_ref().to_owned(), message }
    }
}
