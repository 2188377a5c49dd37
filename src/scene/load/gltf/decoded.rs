//! Decoded parts of a file, as the reader of accessors takes them.

use std::collections::BTreeMap;

use ::gltf::json::accessor::ComponentType;

/// Decoded parts of a file. Errors are in words, for whoever needs the part.
#[derive(Default)]
pub(super) struct Decoded {
    /// Bytes of buffer views, by the index of the view.
    pub views: BTreeMap<usize, Result<DecodedBytes, String>>,
    /// Elements of accessors, by the index of the accessor.
    pub accessors: BTreeMap<usize, Result<DecodedElements, String>>,
}

/// Bytes in the memory that their decoder has filled: a copy of them would be as large again.
#[cfg_attr(
    not(any(feature = "draco", feature = "meshopt")),
    expect(dead_code, reason = "without a decoder nothing makes any")
)]
pub(super) enum DecodedBytes {
    Bytes(Vec<u8>),
    #[cfg(feature = "meshopt")]
    Halfwords(Vec<u16>),
    Words(Vec<u32>),
}

impl std::ops::Deref for DecodedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Bytes(bytes) => bytes,
            #[cfg(feature = "meshopt")]
            Self::Halfwords(halfwords) => bytemuck::cast_slice(halfwords),
            Self::Words(words) => bytemuck::cast_slice(words),
        }
    }
}

/// Elements of an accessor, one after the other.
pub(super) struct DecodedElements {
    pub bytes: DecodedBytes,
    pub component: ComponentType,
    /// Number of elements, which may differ from what the accessor declares.
    pub count: u64,
}

impl Decoded {
    /// Bytes of a buffer view, if it was compressed.
    pub(super) fn view(&self, index: usize) -> Option<Result<&[u8], String>> {
        self.views.get(&index).map(|v| v.as_deref().map_err(Clone::clone))
    }

    /// Elements of an accessor, if a compressed primitive has them.
    pub(super) fn accessor(&self, index: usize) -> Option<Result<&DecodedElements, String>> {
        self.accessors.get(&index).map(|e| e.as_ref().map_err(Clone::clone))
    }
}
