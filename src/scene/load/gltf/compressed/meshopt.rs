//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views that meshoptimizer packed.
//!
//! The second adds a filter for colours and the newer version of vertex data, which the decoder
//! tells by itself. A buffer that has no bytes of its own, or those of the uncompressed views, is
//! what such a view names for programs without a decoder: it is not read.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression>

use ::gltf::json::Root;
use serde::Deserialize;
use serde_json::Value;

#[cfg(feature = "meshopt")]
use super::elements;
use crate::scene::load::gltf::accessor::Reader;

/// The extensions, the more capable one first.
pub(in super::super) const EXTENSIONS: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// Content of the extension of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct CompressedView {
    /// Index of the buffer with the compressed bytes.
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    /// Bytes of an element.
    pub byte_stride: usize,
    /// Number of elements.
    pub count: u64,
    pub mode: Mode,
    #[serde(default)]
    pub filter: Filter,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// The step that turns decoded elements into those of accessors.
#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Returns true if a buffer view is compressed and this program can decode it.
pub(super) fn is_compressed(document: &Root, view: usize) -> bool {
    cfg!(feature = "meshopt") && extension(document, view).is_some()
}

/// Index of the buffer that a view's bytes are read from.
pub(in super::super) fn buffer_of_view(document: &Root, view: usize) -> Option<usize> {
    let buffer = document.buffer_views.get(view)?.buffer.value();
    if !is_compressed(document, view) {
        return Some(buffer);
    }
    // one that is broken has no bytes, and says so when it is decoded
    extension(document, view)?.1.get("buffer")?.as_u64()?.try_into().ok()
}

/// Name and content of the extension that compresses a buffer view.
fn extension(document: &Root, view: usize) -> Option<(&'static str, &Value)> {
    let extensions = document.buffer_views.get(view)?.extensions.as_ref()?;
    EXTENSIONS.into_iter().find_map(|name| extensions.others.get(name).map(|value| (name, value)))
}

/// Decodes a compressed buffer view.
pub(super) fn decode(reader: &Reader, view: usize) -> Result<Vec<u8>, String> {
    let (name, value) = extension(reader.document, view).ok_or("is not compressed")?;
    let fail = |e: String| format!("buffer view {view} ({name}) {e}");
    let compressed: CompressedView =
        serde_json::from_value(value.clone()).map_err(|e| fail(format!("is not valid: {e}")))?;
    let (offset, length) = (compressed.byte_offset, compressed.byte_length);
    let bytes = reader.buffer_range(compressed.buffer, offset, length).map_err(fail)?;

    // decoded bytes can be a thousand times as many
    let size = compressed.count.saturating_mul(compressed.byte_stride as u64);
    reader.budget.take(size, || format!("a compressed buffer view of {} elements", compressed.count)).map_err(fail)?;
    let declared = reader.document.buffer_views[view].byte_length.0;
    if size < declared {
        return Err(fail(format!("has {size} bytes where {declared} are declared")));
    }
    elements::decode(bytes, &compressed).map_err(fail)
}
