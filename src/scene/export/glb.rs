//! The container of a `.glb` file.

use std::path::Path;

use super::write_buffered;
use crate::error::{Error, Result};

/// Writes a `.glb` of this JSON and of a binary chunk that these parts make up, one after the
/// other; without any bytes it has none.
///
/// # Errors
/// [`Error::Output`], also for more than 4 GiB.
pub(super) fn write(path: &Path, json: &[u8], parts: &[&[u8]]) -> Result<()> {
    let bin: usize = parts.iter().map(|part| part.len()).sum();
    let too_large = || Error::Output {
        path: path.to_owned(),
        message: "the scene is larger than 4 GiB, the limit of .glb".to_owned(),
    };
    u32::try_from(bin + json.len() + 64).map_err(|_| too_large())?;
    write_buffered(path, |out| {
        // chunks are padded to words: JSON by spaces, bytes by zeros
        let json_size = json.len().next_multiple_of(4);
        let bin_size = bin.next_multiple_of(4);
        let bin_chunk = if bin == 0 { 0 } else { 8 + bin_size };
        let words = [2, 12 + 8 + json_size + bin_chunk, json_size].map(|n| (n as u32).to_le_bytes());
        out.write_all(b"glTF")?;
        out.write_all(&words.concat())?;
        out.write_all(b"JSON")?;
        out.write_all(json)?;
        out.write_all(&b"    "[..json_size - json.len()])?;
        if bin == 0 {
            return Ok(());
        }
        out.write_all(&(bin_size as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        parts.iter().try_for_each(|part| out.write_all(part))?;
        out.write_all(&[0; 4][..bin_size - bin])
    })
}
