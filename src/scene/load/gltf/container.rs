//! From files to the JSON document and its buffers.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use ::gltf::binary::{self, Glb};
use ::gltf::json::{Buffer, Root};
use serde_json::{Value, json};

use super::node::Doubles;
use super::uri::{self, Uri};
use crate::error::{Error, Result};

/// A file's JSON and, in a `.glb`, the binary chunk.
pub(super) struct Chunks<'a> {
    pub json: Cow<'a, [u8]>,
    pub bin: Option<Cow<'a, [u8]>>,
}

/// Splits a `.glb`; anything that does not start with its magic is taken for JSON.
pub(super) fn split<'a>(file: &'a [u8], path: &Path) -> Result<Chunks<'a>> {
    let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    if !file.starts_with(b"glTF") {
        return match is_glb {
            true => Err(Error::input(path, "is not a .glb file (it does not begin with `glTF`)")),
            false => Ok(Chunks { json: file.into(), bin: None }),
        };
    }
    let word = |at: usize| file.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let truncated = || Error::input(path, "is truncated: the .glb ends before its header says so");
    if let Some(version) = word(4).filter(|&v| v != 2) {
        return Err(Error::input(path, format!("is a .glb of version {version}; skylit reads version 2 (glTF 2.0)")));
    }
    // the crate subtracts the header's size from the length without a look, which panics below 12; and it takes what
    // follows the length for a chunk
    let whole = word(8).filter(|&length| length >= 12).and_then(|length| file.get(..length)).ok_or_else(truncated)?;
    let broken = |what: &str| Error::input(path, format!("is broken: {what}"));
    match Glb::from_slice(whole) {
        Ok(glb) => Ok(Chunks { json: glb.json, bin: glb.bin }),
        Err(::gltf::Error::Binary(e)) => match e {
            binary::Error::Io(_) | binary::Error::Length { .. } | binary::Error::ChunkLength { .. } => Err(truncated()),
            // chunks of other kinds must be skipped, says the specification; the crate refuses one in the place of the
            // binary chunk, though it has found the JSON
            binary::Error::UnknownChunkType(_) if whole.get(16..20) == Some(b"JSON") => {
                let json = word(12).and_then(|size| whole[20..].get(..size)).ok_or_else(truncated)?;
                Ok(Chunks { json: json.into(), bin: None })
            }
            binary::Error::UnknownChunkType(_) => Err(broken("the first chunk of the .glb is not JSON")),
            e => Err(broken(&e.to_string())),
        },
        Err(e) => Err(broken(&e.to_string())),
    }
}

/// Parses the JSON and refuses other versions of glTF.
pub(super) fn document(json: &[u8], path: &Path) -> Result<(Root, Doubles)> {
    #[derive(serde::Deserialize)]
    struct AssetOnly {
        #[serde(default)]
        asset: Version,
    }
    #[derive(serde::Deserialize, Default)]
    struct Version {
        // glTF 1.0 of some exporters has a number
        #[serde(default)]
        version: serde_json::Value,
    }
    // the crate leaves a byte order mark to us
    let text = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let document = Root::from_slice(text).or_else(|e| lenient(text).ok_or(e));
    let document = match document.and_then(|document| Ok((document, serde_json::from_slice(text)?))) {
        Ok(document) => document,
        // glTF 1.0 has another structure: it does not parse, but deserves a better answer than a type error
        Err(e) => match serde_json::from_slice::<AssetOnly>(text).map(|a| a.asset.version) {
            Ok(serde_json::Value::Number(version)) => return Err(other_version(&version.to_string(), path)),
            Ok(version) if version.as_str().is_none_or(str::is_empty) => {
                return Err(Error::input(path, "is not glTF: it has no version"));
            }
            Ok(serde_json::Value::String(version)) if !version.starts_with("2.") => return Err(other_version(&version, path)),
            _ => return Err(Error::input(path, format!("is not valid glTF JSON: {e}"))),
        },
    };
    match (&document.0.asset.version, &document.0.asset.min_version) {
        (_, Some(needed)) if needed != "2.0" => Err(other_version(needed, path)),
        (found, None) if !found.starts_with("2.") => Err(other_version(found, path)),
        _ => Ok(document),
    }
}

fn other_version(version: &str, path: &Path) -> Error {
    let remedy = if version.starts_with('1') { ": convert it" } else { "" };
    Error::input(path, format!("is glTF {version}; skylit reads glTF 2.0{remedy}"))
}

/// The document without what a still image does not need and the crate is too strict about: it wants `nodes` in a scene
/// and `node` in the target of an animation, both optional by the specification (for scenes without content, and for
/// KHR_animation_pointer), and it refuses numbers beyond the range of single precision. `None` if that does not help.
fn lenient(text: &[u8]) -> Option<Root> {
    let mut root: Value = serde_json::from_slice(text).ok()?;
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        scene.as_object_mut()?.entry("nodes").or_insert_with(|| json!([]));
    }
    for animation in root.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        *animation = json!({ "channels": [], "samplers": [] });
    }
    root.as_object_mut()?.remove("skins");
    serde_json::from_value(root).ok()
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

/// The files beside the glTF file that its buffers and images are in.
pub(super) fn files(document: &Root, gltf: &Path) -> Vec<PathBuf> {
    let uris = document.buffers.iter().map(|b| &b.uri).chain(document.images.iter().map(|i| &i.uri)).flatten();
    let mut files: Vec<_> = uris
        .filter_map(|uri| match uri::parse(uri) {
            Ok(Uri::Path(relative)) => Some(gltf.parent().unwrap_or(Path::new("")).join(relative)),
            _ => None,
        })
        .collect();
    files.dedup();
    files
}

/// The bytes of every buffer, each as long as it declares.
pub(super) fn buffers<'a>(document: &Root, bin: Option<&'a [u8]>, path: &Path) -> Result<Vec<Cow<'a, [u8]>>> {
    let buffer = |(i, buffer): (usize, &Buffer)| -> Result<Cow<'a, [u8]>> {
        let bytes: Cow<'a, [u8]> = match (&buffer.uri, bin) {
            (Some(uri), _) => {
                read_uri(uri, path).map(Cow::Owned).map_err(|e| Error::input(path, format!("buffer {i}: {e}")))?
            }
            (None, Some(bin)) if i == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(Error::input(path, format!("buffer {i} has neither a URI nor a binary chunk"))),
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let (have, want) = (bytes.len(), buffer.byte_length.0);
            return Err(Error::input(path, format!("buffer {i} is truncated: {have} bytes of {want}")));
        }
        Ok(bytes)
    };
    document.buffers.iter().enumerate().map(buffer).collect()
}
