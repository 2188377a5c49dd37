//! Reads files into the JSON document and its buffers.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use ::gltf::json::{Buffer, Root};
use serde_json::{Value, json};

use super::accessor::BufferBytes;
use super::compressed;
use super::node::Doubles;
use super::uri::{self, Uri};
use crate::error::{Error, Result};
use crate::scene::load::confine;
use crate::scene::load::options::Loading;

/// A file's JSON and, in a `.glb`, the binary chunk.
pub(super) struct Chunks<'a> {
    pub json: Cow<'a, [u8]>,
    pub bin: Option<&'a [u8]>,
}

/// Splits a `.glb`; anything else that may be JSON is taken for it, whatever the file's name.
pub(super) fn split<'a>(file: &'a [u8], path: &Path) -> Result<Chunks<'a>> {
    if !file.starts_with(b"glTF") {
        let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        let json = utf8(file);
        let is_json = json.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
        return if is_glb && !is_json {
            Err(Error::input(path, "is not a .glb file (it does not begin with `glTF`)"))
        } else {
            Ok(Chunks { json, bin: None })
        };
    }
    let truncated = || Error::input(path, "is truncated: the .glb ends before its header says so");
    if let Some(version) = word(file, 4).filter(|&v| v != 2) {
        return Err(Error::input(path, format!("is a .glb of version {version}; skylit reads version 2 (glTF 2.0)")));
    }
    // what follows the length is no chunk
    let whole = word(file, 8).and_then(|length| file.get(..length)).ok_or_else(truncated)?;
    if whole.len() < 20 {
        return Err(truncated());
    }
    if &whole[16..20] != b"JSON" {
        return Err(Error::input(path, "is broken: the first chunk of the .glb is not JSON"));
    }
    let body = |at: usize| word(whole, at).and_then(|size| whole[at + 8..].get(..size));
    let json = body(12).ok_or_else(truncated)?;
    let bin = match binary_chunk(whole, 20 + json.len()) {
        None => None,
        Some(at) => {
            let size = word(whole, at).unwrap_or_default();
            let rest = &whole[at + 8..];
            // some writers count padding that they leave out
            if size > rest.len() + 3 {
                return Err(truncated());
            }
            Some(&rest[..size.min(rest.len())])
        }
    };
    Ok(Chunks { json: utf8(json), bin })
}

/// Where the binary chunk begins; `at`: the end of the chunk before. Chunks of other kinds are
/// skipped, as the specification wants, and padding that no chunk counts.
fn binary_chunk(whole: &[u8], mut at: usize) -> Option<usize> {
    loop {
        let is_binary = |at: &usize| whole.get(at + 4..at + 8) == Some(b"BIN\0");
        if let Some(found) = [at, at.next_multiple_of(4)].into_iter().find(is_binary) {
            return Some(found);
        }
        at = at.checked_add(8)?.checked_add(word(whole, at)?)?;
    }
}

/// The little-endian number in four bytes.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
}

/// JSON as UTF-8 without what some writers put around it: a byte order mark, the zeros of padding,
/// the two bytes a character of other encodings.
fn utf8(text: &[u8]) -> Cow<'_, [u8]> {
    let wide = |pair: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = text[2..].as_chunks().0.iter().map(|&b| pair(b)).collect();
        Cow::Owned(String::from_utf16_lossy(&units).trim_end_matches('\0').to_owned().into_bytes())
    };
    match text {
        [0xff, 0xfe, ..] => return wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let end = text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    Cow::Borrowed(&text[..end])
}

/// Keys of indices. The crate would take the lower 32 bits of a larger number.
const INDICES: [&str; 24] = [
    "animation",
    "buffer",
    "bufferView",
    "camera",
    "children",
    "index",
    "indices",
    "input",
    "inverseBindMatrices",
    "joints",
    "light",
    "material",
    "mesh",
    "node",
    "nodes",
    "output",
    "sampler",
    "scene",
    "skeleton",
    "skin",
    "source",
    "texCoord",
    "variants",
    "mapping",
];
/// Digits of the smallest number that does not fit into 32 bits.
const LARGE: usize = 10;

/// Finds an index that does not fit into 32 bits: its key and value.
fn large_index(text: &[u8]) -> Option<String> {
    // almost no file has such a number at all
    if !has_large_integer(text) {
        return None;
    }
    let root: Value = serde_json::from_slice(text).ok()?;
    large_index_in(&root, "")
}

/// Returns true if there may be an integer of more than nine digits.
fn has_large_integer(text: &[u8]) -> bool {
    let is_number = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'e' | b'E' | b'+' | b'-');
    let mut words = text.split(|&b| !is_number(b)).filter(|word| word.len() >= LARGE);
    words.any(|word| word.iter().all(u8::is_ascii_digit))
}

/// Finds an index that does not fit into 32 bits in a value of this key.
fn large_index_in(value: &Value, key: &str) -> Option<String> {
    match value {
        Value::Number(number) if INDICES.contains(&key) => {
            let is_large = number.as_u64().is_some_and(|n| u32::try_from(n).is_err());
            is_large.then(|| format!("`{key}` is {number}"))
        }
        Value::Array(all) => all.iter().find_map(|v| large_index_in(v, key)),
        // names of attributes are of the file
        Value::Object(map) if key == "attributes" || key == "targets" => {
            map.iter().find_map(|(_, v)| large_index_in(v, "indices").map(|_| format!("an attribute is {v}")))
        }
        Value::Object(map) => map.iter().filter(|(k, _)| *k != "extras").find_map(|(k, v)| large_index_in(v, k)),
        _ => None,
    }
}

/// Parses the JSON and refuses other versions of glTF.
pub(super) fn document(text: &[u8], path: &Path) -> Result<(Root, Doubles)> {
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
    if let Some(index) = large_index(text) {
        return Err(Error::input(path, format!("is not valid glTF JSON: {index}, and no file has so many")));
    }
    let document = Root::from_slice(text).or_else(|e| lenient(text).ok_or(e));
    let document = match document.and_then(|document| Ok((document, serde_json::from_slice(text)?))) {
        Ok(document) => document,
        // glTF 1.0 has another structure: it does not parse, but deserves a better answer than a
        // type error
        Err(e) => match serde_json::from_slice::<AssetOnly>(text).map(|a| a.asset.version) {
            Ok(serde_json::Value::Number(version)) => return Err(other_version(&version.to_string(), path)),
            Ok(version) if version.as_str().is_none_or(str::is_empty) => {
                return Err(Error::input(path, "is not glTF: it has no version"));
            }
            Ok(serde_json::Value::String(version)) if !version.starts_with("2.") => {
                return Err(other_version(&version, path));
            }
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

/// The document without what a still image does not need and the crate is too strict about: it
/// wants `nodes` in a scene and `node` in the target of an animation, both optional by the
/// specification (for scenes without content, and for KHR_animation_pointer), and clipping planes
/// of cameras, which some files lack; and it refuses numbers beyond the range of single precision.
/// `None` if that does not help.
fn lenient(text: &[u8]) -> Option<Root> {
    let mut root: Value = serde_json::from_slice(text).ok()?;
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        scene.as_object_mut()?.entry("nodes").or_insert_with(|| json!([]));
    }
    for animation in root.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        *animation = json!({ "channels": [], "samplers": [] });
    }
    for camera in root.get_mut("cameras").and_then(Value::as_array_mut).into_iter().flatten() {
        for (lens, planes) in [("perspective", &["znear"][..]), ("orthographic", &["znear", "zfar"][..])] {
            let Some(lens) = camera.get_mut(lens).and_then(Value::as_object_mut) else { continue };
            for plane in planes {
                lens.entry(*plane).or_insert_with(|| json!(0.0));
            }
        }
    }
    root.as_object_mut()?.remove("skins");
    serde_json::from_value(root).ok()
}

/// Reads the file that `uri` names.
///
/// # Errors
/// The reason in words, with the path that was tried.
pub(super) fn read_uri(uri: &str, gltf: &Path, loading: Loading) -> Result<Vec<u8>, String> {
    match uri::parse(uri)? {
        Uri::Data(bytes) => Ok(bytes),
        Uri::Paths(paths) => {
            let confine = loading.options.confine.folder();
            let file = uri::resolve(&paths, folder(gltf), confine).ok_or_else(|| confine::refusal(uri))?;
            let bytes = crate::files::read_regular(&file).map_err(|e| match Error::read(&file, &e) {
                Error::Input { path, message } => format!("{}: {message}", path.display()),
                other => other.to_string(),
            })?;
            loading.budget.read(bytes.len());
            Ok(bytes)
        }
    }
}

fn folder(gltf: &Path) -> &Path {
    gltf.parent().unwrap_or(Path::new(""))
}

/// The files beside the glTF file that its buffers and images are in.
///
/// # Errors
/// [`Error::Input`] for one that does not lie below `confine`.
pub(super) fn files(document: &Root, gltf: &Path, confine: Option<&Path>) -> Result<Vec<PathBuf>> {
    let uris = document.buffers.iter().map(|b| &b.uri).chain(document.images.iter().map(|i| &i.uri)).flatten();
    let mut files = Vec::new();
    for uri in uris.filter(|uri| !uri::is_data(uri)) {
        if let Ok(Uri::Paths(paths)) = uri::parse(uri) {
            let file = uri::resolve(&paths, folder(gltf), confine);
            files.push(file.ok_or_else(|| Error::input(gltf, confine::refusal(uri)))?);
        }
    }
    files.dedup();
    Ok(files)
}

/// The bytes of every buffer that a buffer view refers to; others are not read.
pub(super) fn buffers<'a>(
    document: &Root,
    bin: Option<&'a [u8]>,
    path: &Path,
    loading: Loading,
) -> Vec<BufferBytes<'a>> {
    let used = compressed::used_buffers(document);
    let read = |(i, buffer): (usize, &Buffer)| {
        if used.contains(&i) {
            read_buffer(i, buffer, bin, path, loading).map_err(|e| format!("buffer {i} {e}"))
        } else {
            Err(format!("buffer {i} is not used by a buffer view"))
        }
    };
    document.buffers.iter().enumerate().map(read).collect()
}

fn read_buffer<'a>(
    index: usize,
    buffer: &Buffer,
    bin: Option<&'a [u8]>,
    path: &Path,
    loading: Loading,
) -> std::result::Result<Cow<'a, [u8]>, String> {
    let bytes: Cow<'a, [u8]> = match (&buffer.uri, bin) {
        (Some(uri), _) => read_uri(uri, path, loading).map(Cow::Owned).map_err(|e| format!("cannot be read: {e}"))?,
        (None, Some(bin)) if index == 0 => bin.into(),
        (None, _) => {
            let others = buffer.extensions.as_ref().map(|e| &e.others);
            return Err(match compressed::MESHOPT.iter().find(|name| others.is_some_and(|o| o.contains_key(**name))) {
                Some(name) => format!(
                    "has no bytes of its own: the extension {name} fills it, for views that it compressed{}",
                    if cfg!(feature = "meshopt") { "" } else { ", and this program was built without it" }
                ),
                None => "has neither a URI nor a binary chunk".to_owned(),
            });
        }
    };
    if let (Some(uri), Some(message)) = (&buffer.uri, crate::files::placeholder(&bytes)) {
        let name: String = uri.chars().take(100).collect();
        return Err(format!("in {name} {message}"));
    }
    match (bytes.len() as u64, buffer.byte_length.0) {
        (have, want) if have < want => Err(format!("is truncated: {have} bytes of {want}")),
        _ => Ok(bytes),
    }
}
