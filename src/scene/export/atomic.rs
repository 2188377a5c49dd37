//! Files that exist whole or not at all.

use std::io::{BufWriter, Write};
use std::path::Path;

use crate::error::{Error, Result};

/// Writes a file through a temporary one beside it, which takes its name when it is complete.
///
/// # Errors
/// [`Error::Output`]; nothing is left behind.
pub(super) fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let write = || -> std::io::Result<()> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".skylit-").suffix(".part");
        #[cfg(unix)]
        {
            // temporary files are private by default; this one stays, so the umask shall decide
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder)?;
        let mut out = BufWriter::with_capacity(1 << 20, file);
        fill(&mut out)?;
        out.into_inner().map_err(|e| e.into_error())?.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    write().map_err(|e| Error::write(path, &e))
}
