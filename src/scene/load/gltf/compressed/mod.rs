//! Compressed geometry: buffer views that meshoptimizer packed, and primitives that Draco packed.
//!
//! Both are decoded before anything else is read, on all cores. The reader of accessors takes
//! decoded bytes where there are any, and knows nothing of how they were stored.

#[cfg(feature = "draco")]
mod draco;
#[cfg(feature = "meshopt")]
mod elements;
mod meshopt;

use std::collections::{BTreeMap, BTreeSet};
#[cfg(any(feature = "draco", feature = "meshopt"))]
use std::sync::atomic::{AtomicUsize, Ordering};

use ::gltf::json::Root;
use ::gltf::json::mesh::Primitive;
#[cfg(any(feature = "draco", feature = "meshopt"))]
use rayon::prelude::*;
use serde_json::Value;

pub(super) use meshopt::{EXTENSIONS as MESHOPT, buffer_of_view};

use super::accessor::Reader;
use super::decoded::{Decoded, DecodedBytes, DecodedElements};
#[cfg(any(feature = "draco", feature = "meshopt"))]
use crate::scene::load::options::LoadPart;
use crate::scene::load::options::LoadProgress;

/// The extension of primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Hears of parts that were decoded.
type Listener<'a> = &'a (dyn Fn(LoadProgress) + Sync);

/// Decodes what is compressed in a file. `reader` has nothing decoded yet.
pub(super) fn decode(reader: &Reader, progress: Listener) -> Decoded {
    let views = decode_views(reader, progress);
    let mut decoded = Decoded { views, accessors: BTreeMap::new() };

    // Draco's streams may lie in views that were compressed again
    decoded.accessors = decode_primitives(&Reader { decoded: &decoded, ..*reader }, progress);
    decoded
}

/// Decodes all of these on all cores, and says so after each.
#[cfg(any(feature = "draco", feature = "meshopt"))]
fn decode_all<T: Sync, R: Send>(all: &[T], decode: impl Fn(&T) -> R + Sync, progress: Listener) -> Vec<R> {
    let done = AtomicUsize::new(0);
    let counted = |part: &T| {
        let decoded = decode(part);
        let done = 1 + done.fetch_add(1, Ordering::Relaxed);
        progress(LoadProgress { part: LoadPart::Geometry, done, of: Some(all.len()) });
        decoded
    };
    all.par_iter().map(counted).collect()
}

#[cfg(not(feature = "meshopt"))]
fn decode_views(_: &Reader, _: Listener) -> BTreeMap<usize, Result<DecodedBytes, String>> {
    BTreeMap::new()
}

/// Decodes buffer views that meshoptimizer packed.
#[cfg(feature = "meshopt")]
fn decode_views(reader: &Reader, progress: Listener) -> BTreeMap<usize, Result<DecodedBytes, String>> {
    let is_compressed = |&i: &usize| meshopt::is_compressed(reader.document, i);
    let compressed: Vec<usize> = (0..reader.document.buffer_views.len()).filter(is_compressed).collect();
    decode_all(&compressed, |&i| (i, elements::decode(reader, i)), progress).into_iter().collect()
}

#[cfg(not(feature = "draco"))]
fn decode_primitives(_: &Reader, _: Listener) -> BTreeMap<usize, Result<DecodedElements, String>> {
    BTreeMap::new()
}

/// Decodes primitives that Draco packed: elements of the accessors that they fill. Primitives that
/// share a stream and its accessors are decoded once.
#[cfg(feature = "draco")]
fn decode_primitives(reader: &Reader, progress: Listener) -> BTreeMap<usize, Result<DecodedElements, String>> {
    let primitives = reader.document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let streams: BTreeSet<draco::Stream> = primitives.filter_map(draco::Stream::from_primitive).collect();
    let streams: Vec<draco::Stream> = streams.into_iter().collect();
    let decoded = decode_all(&streams, |stream| draco::decode(reader, stream), progress);

    // an error of a stream is one of all of its accessors but those with data of their own
    let accessor = |index: usize| reader.document.accessors.get(index);
    let lacks_data = |index| accessor(index).is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none());
    let mut accessors = BTreeMap::new();
    for (stream, decoded) in streams.iter().zip(decoded) {
        match decoded {
            Ok(arrays) => accessors.extend(arrays.into_iter().map(|(accessor, elements)| (accessor, Ok(elements)))),
            Err(e) => accessors.extend(stream.accessors().filter(|&a| lacks_data(a)).map(|a| (a, Err(e.clone())))),
        }
    }
    accessors
}

/// The extension of a primitive that Draco packed.
pub(super) fn draco_extension(primitive: &Primitive) -> Option<&Value> {
    primitive.extensions.as_ref().and_then(|e| e.others.get(DRACO))
}

/// The buffers that a file's views are read from: what compressed ones are filled into is not.
pub(super) fn used_buffers(document: &Root) -> BTreeSet<usize> {
    (0..document.buffer_views.len()).filter_map(|i| buffer_of_view(document, i)).collect()
}
