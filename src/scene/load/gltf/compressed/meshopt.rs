//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views that meshoptimizer packed.
//!
//! The second adds a filter for colours and the newer version of vertex data, which the decoder
//! tells by itself. A buffer that has no bytes of its own, or those of the uncompressed views, is
//! what such a view names for programs without a decoder: it is not read.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression>

use ::gltf::json::Root;
use serde_json::Value;

/// The extensions, the more capable one first.
pub(in super::super) const EXTENSIONS: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

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
pub(super) fn extension(document: &Root, view: usize) -> Option<(&'static str, &Value)> {
    let extensions = document.buffer_views.get(view)?.extensions.as_ref()?;
    EXTENSIONS.into_iter().find_map(|name| extensions.others.get(name).map(|value| (name, value)))
}
