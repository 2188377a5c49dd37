//! From files to the JSON document and its buffers.

use std::borrow::Cow;
use std::path::Path;

use super::schema::{Asset, Document};
use super::uri::{self, Uri};
use crate::error::{Error, Result};

/// A file's JSON and, in a `.glb`, the binary chunk.
pub(super) struct Chunks<'a> {
    pub json: &'a [u8],
    pub bin: Option<&'a [u8]>,
}

/// Splits a `.glb`; anything that does not start with its magic is taken for JSON.
pub(super) fn split<'a>(file: &'a [u8], path: &Path) -> Result<Chunks<'a>> {
    let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    if !file.starts_with(b"glTF") {
        return match is_glb {
            true => Err(Error::input(path, "is no .glb file (it does not begin with `glTF`)")),
            false => Ok(Chunks { json: file, bin: None }),
        };
    }
    let word = |at: usize| file.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let truncated = || Error::input(path, "is truncated: the .glb ends before its header says so");
    let (Some(version), Some(length)) = (word(4), word(8)) else { return Err(truncated()) };
    if version != 2 {
        return Err(Error::input(path, format!("is a .glb of version {version}; skylit reads version 2 (glTF 2.0)")));
    }
    let file = file.get(..length as usize).ok_or_else(truncated)?;
    let mut chunks = Chunks { json: &[], bin: None };
    let (mut at, mut nth) = (12, 0);
    while at < file.len() {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else { return Err(truncated()) };
        let body = (at + 8).checked_add(size as usize).and_then(|end| file.get(at + 8..end)).ok_or_else(truncated)?;
        match (nth, &kind.to_le_bytes()) {
            (0, b"JSON") => chunks.json = body,
            (0, _) => return Err(Error::input(path, "is broken: the first chunk of the .glb is not JSON")),
            (1, b"BIN\0") => chunks.bin = Some(body),
            // chunks of other kinds must be skipped, says the specification
            _ => {}
        }
        // chunks are padded to four bytes; some writers forget it on the last one
        at += 8 + (size as usize).next_multiple_of(4);
        nth += 1;
    }
    Ok(chunks)
}

/// Parses the JSON and refuses other versions of glTF.
pub(super) fn document(json: &[u8], path: &Path) -> Result<Document> {
    #[derive(serde::Deserialize, Default)]
    struct AssetOnly {
        #[serde(default)]
        asset: Asset,
    }
    let text = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let parsed = serde_json::from_slice::<Document>(text);
    // glTF 1.0 has another structure: it does not parse, but deserves a better answer than a type error
    let asset = match &parsed {
        Ok(document) => Asset { version: document.asset.version.clone(), min_version: document.asset.min_version.clone() },
        Err(_) => serde_json::from_slice::<AssetOnly>(text).unwrap_or_default().asset,
    };
    if asset.version.starts_with("1.") {
        return Err(Error::input(path, format!("is glTF {}; skylit reads glTF 2.0: convert it", asset.version)));
    }
    let document = parsed.map_err(|e| Error::input(path, format!("is no valid glTF JSON: {e}")))?;
    let needed = asset.min_version.as_deref().unwrap_or(&asset.version);
    if needed != "2.0" && (asset.min_version.is_some() || !needed.starts_with("2.")) {
        let found = if needed.is_empty() { "no version".to_owned() } else { format!("version {needed}") };
        return Err(Error::input(path, format!("asks for glTF of {found}; skylit reads 2.0")));
    }
    Ok(document)
}

/// Reads the file that `uri` names.
///
/// # Errors
/// The reason in words, with the path that was tried.
pub(super) fn read_uri(uri: &str, gltf: &Path) -> Result<Vec<u8>, String> {
    match uri::parse(uri)? {
        Uri::Data(bytes) => Ok(bytes),
        Uri::Path(relative) => {
            let file = gltf.parent().unwrap_or(Path::new("")).join(relative);
            std::fs::read(&file).map_err(|e| match Error::read(&file, &e) {
                Error::Input { path, message } => format!("{}: {message}", path.display()),
                other => other.to_string(),
            })
        }
    }
}

/// The bytes of every buffer, each as long as it declares.
pub(super) fn buffers<'a>(document: &Document, bin: Option<&'a [u8]>, path: &Path) -> Result<Vec<Cow<'a, [u8]>>> {
    let buffer = |(i, buffer): (usize, &super::schema::Buffer)| -> Result<Cow<'a, [u8]>> {
        let bytes: Cow<'a, [u8]> = match (&buffer.uri, bin) {
            (Some(uri), _) => {
                read_uri(uri, path).map(Cow::Owned).map_err(|e| Error::input(path, format!("buffer {i}: {e}")))?
            }
            (None, Some(bin)) if i == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(Error::input(path, format!("buffer {i} has neither a URI nor a binary chunk"))),
        };
        if (bytes.len() as u64) < buffer.byte_length {
            let (have, want) = (bytes.len(), buffer.byte_length);
            return Err(Error::input(path, format!("buffer {i} is truncated: {have} bytes of {want}")));
        }
        Ok(bytes)
    };
    document.buffers.iter().enumerate().map(buffer).collect()
}
