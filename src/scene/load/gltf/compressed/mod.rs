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

use ::gltf::json::Root;
use ::gltf::json::mesh::Primitive;
#[cfg(any(feature = "draco", feature = "meshopt"))]
use rayon::prelude::*;
use serde_json::Value;

pub(super) use meshopt::{EXTENSIONS as MESHOPT, buffer_of_view};

use super::accessor::Reader;
use super::decoded::{Decoded, DecodedElements};

/// The extension of primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Decodes what is compressed in a file. `reader` has nothing decoded yet.
pub(super) fn decode(reader: &Reader) -> Decoded {
    let views = decode_views(reader);
    let mut decoded = Decoded { views, accessors: BTreeMap::new() };

    // Draco's streams may lie in views that were compressed again
    decoded.accessors = decode_primitives(&Reader { decoded: &decoded, ..*reader });
    decoded
}

#[cfg(not(feature = "meshopt"))]
fn decode_views(_: &Reader) -> BTreeMap<usize, Result<Vec<u8>, String>> {
    BTreeMap::new()
}

/// Decodes buffer views that meshoptimizer packed.
#[cfg(feature = "meshopt")]
fn decode_views(reader: &Reader) -> BTreeMap<usize, Result<Vec<u8>, String>> {
    let is_compressed = |&i: &usize| meshopt::is_compressed(reader.document, i);
    let compressed: Vec<usize> = (0..reader.document.buffer_views.len()).filter(is_compressed).collect();
    compressed.into_par_iter().map(|i| (i, elements::decode(reader, i))).collect()
}

#[cfg(not(feature = "draco"))]
fn decode_primitives(_: &Reader) -> BTreeMap<usize, Result<DecodedElements, String>> {
    BTreeMap::new()
}

/// Decodes primitives that Draco packed: elements of the accessors that they fill. Primitives that
/// share a stream and its accessors are decoded once.
#[cfg(feature = "draco")]
fn decode_primitives(reader: &Reader) -> BTreeMap<usize, Result<DecodedElements, String>> {
    let primitives = reader.document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let streams: BTreeSet<draco::Stream> = primitives.filter_map(draco::Stream::from_primitive).collect();
    let streams: Vec<draco::Stream> = streams.into_iter().collect();
    let decoded: Vec<_> = streams.par_iter().map(|stream| draco::decode(reader, stream)).collect();

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
