//! Frame numbers in file names: `out.####.exr` is one file per frame.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A path with a placeholder for the frame number in its file name: one `#` per digit at least.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePattern {
    path: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl FramePattern {
    /// The pattern of a path; `None` for a path without a placeholder.
    ///
    /// # Errors
    /// [`Error::Usage`] for more than one run of `#`, or one in a name that is no Unicode.
    pub fn from_path(path: &Path) -> Result<Option<Self>> {
        let wrong = |what: &str| Err(Error::Usage(format!("{}: {what}", path.display())));
        let Some(name) = path.file_name() else { return Ok(None) };
        let Some(start) = name.as_encoded_bytes().iter().position(|b| *b == b'#') else { return Ok(None) };
        let Some(name) = name.to_str() else {
            return wrong("a name with a frame number (#) must be Unicode; rename it");
        };
        let (before, rest) = name.split_at(start);
        let after = rest.trim_start_matches('#');
        if after.contains('#') {
            return wrong("more than one placeholder for the frame number; use one run of #, like out.####.exr");
        }
        let digits = rest.len() - after.len();
        Ok(Some(Self { path: path.to_owned(), before: before.to_owned(), digits, after: after.to_owned() }))
    }

    /// The path of a frame: its number with leading zeros, and more digits where it needs them.
    pub fn path(&self, frame: u64) -> PathBuf {
        self.path.with_file_name(format!("{}{frame:0width$}{}", self.before, self.after, width = self.digits))
    }
}

/// Does a path contain a frame number placeholder? Errors are those of [`FramePattern::from_path`].
pub fn is_pattern(path: &Path) -> Result<bool> {
    Ok(FramePattern::from_path(path)?.is_some())
}

/// The path of a frame, or the path itself. Errors are those of [`FramePattern::from_path`].
pub fn numbered(path: &Path, frame: u64) -> Result<PathBuf> {
    Ok(FramePattern::from_path(path)?.map_or_else(|| path.to_owned(), |p| p.path(frame)))
}
