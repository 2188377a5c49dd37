//! Typed arrays in buffers. Every range is checked against the buffer view and the buffer before a
//! byte is read.

use std::borrow::Cow;

use ::gltf::json::accessor::{Accessor, ComponentType, Type};
use ::gltf::json::{Index, Root, buffer};
use rayon::prelude::*;

use super::decoded::Decoded;
use super::values::valid;
use crate::memory::Budget;

/// The bytes of a buffer as long as it declares, or what is wrong with it, in words: an error for
/// whoever needs it.
pub(super) type BufferBytes<'a> = std::result::Result<Cow<'a, [u8]>, String>;

/// Reads accessors. Errors are in words and name the accessor; the caller adds the file.
pub(super) struct Reader<'a> {
    pub document: &'a Root,
    pub buffers: &'a [BufferBytes<'a>],
    /// Decoded parts of the file.
    pub decoded: &'a Decoded,
    /// Budget that the memory of arrays is taken from.
    pub budget: &'a Budget,
}

/// Reads one component of an element.
trait Decode {
    /// The float at the start of `b`; normalised integers map to [0, 1] or [-1, 1] as the
    /// specification says.
    fn float(self, b: &[u8], normalized: bool) -> f32;
    /// The unsigned integer at the start of `b`.
    fn index(self, b: &[u8]) -> u32;
    fn is_index(&self) -> bool;
}

impl Decode for ComponentType {
    #[inline(always)]
    fn float(self, b: &[u8], normalized: bool) -> f32 {
        match (self, normalized) {
            (Self::F32, _) => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            (Self::I8, false) => f32::from(b[0] as i8),
            (Self::U8, false) => f32::from(b[0]),
            (Self::I16, false) => f32::from(i16::from_le_bytes([b[0], b[1]])),
            (Self::U16, false) => f32::from(u16::from_le_bytes([b[0], b[1]])),
            (Self::I8, true) => (f32::from(b[0] as i8) / 127.0).max(-1.0),
            (Self::U8, true) => f32::from(b[0]) / 255.0,
            (Self::I16, true) => (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
            (Self::U16, true) => f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            (Self::U32, false) => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            (Self::U32, true) => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])) / f64::from(u32::MAX)) as f32,
        }
    }

    #[inline(always)]
    fn index(self, b: &[u8]) -> u32 {
        match self {
            Self::U8 => u32::from(b[0]),
            Self::U16 => u32::from(u16::from_le_bytes([b[0], b[1]])),
            _ => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    fn is_index(&self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }
}

/// Equally spaced elements, in range by construction.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Elements of an accessor without what a sparse part replaces.
struct Base<'a> {
    /// `None`: zeros.
    elements: Option<Elements<'a>>,
    component: ComponentType,
    count: u64,
}

/// The numbers of a scalar accessor of unsigned integers, read where they lie.
pub(super) enum Indices<'a> {
    /// No copy.
    InPlace { bytes: &'a [u8], count: usize, stride: usize, size: usize },
    /// A sparse accessor's, put together.
    Owned(Vec<u32>),
}

impl Indices<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Indices::InPlace { count, .. } => *count,
            Indices::Owned(v) => v.len(),
        }
    }

    /// The index at `i`, which must be below `len`.
    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> u32 {
        match self {
            Indices::InPlace { bytes, stride, size, .. } => {
                let b = &bytes[i * stride..];
                match size {
                    1 => ComponentType::U8.index(b),
                    2 => ComponentType::U16.index(b),
                    _ => ComponentType::U32.index(b),
                }
            }
            Indices::Owned(v) => v[i],
        }
    }
}

/// Elements as a file stores them, without gaps.
pub(super) struct StoredElements {
    pub bytes: Vec<u8>,
    pub count: usize,
    pub shape: Type,
    pub component: ComponentType,
    pub normalized: bool,
}

impl<'a> Reader<'a> {
    fn accessor(&self, index: Index<Accessor>) -> Result<&'a Accessor, String> {
        let all = &self.document.accessors;
        all.get(index.value()).ok_or_else(|| format!("accessor {index} does not exist (the file has {})", all.len()))
    }

    /// Number of elements.
    pub(super) fn count(&self, index: Index<Accessor>) -> Result<usize, String> {
        let declared = self.accessor(index)?.count.0;
        let count = self.decoded.accessor(index.value()).transpose()?.map_or(declared, |e| e.count);
        usize::try_from(count).map_err(|_| format!("accessor {index} has too many elements"))
    }

    /// Returns the type of an accessor's elements.
    pub(super) fn shape(&self, index: Index<Accessor>) -> Result<Option<Type>, String> {
        Ok(valid(self.accessor(index)?.type_))
    }

    /// Whether the file has values for it: without, they are zeros.
    pub(super) fn has_data(&self, index: Index<Accessor>) -> Result<bool, String> {
        let accessor = self.accessor(index)?;
        Ok(accessor.buffer_view.is_some() || accessor.sparse.is_some() || self.is_decoded(index))
    }

    /// Returns true if a compressed primitive has the elements of an accessor.
    pub(super) fn is_decoded(&self, index: Index<Accessor>) -> bool {
        self.decoded.accessor(index.value()).is_some()
    }

    /// The bytes and stride of a buffer view.
    pub(super) fn view(&self, index: Index<buffer::View>) -> Result<(&'a [u8], Option<usize>), String> {
        let views = &self.document.buffer_views;
        let view = views
            .get(index.value())
            .ok_or_else(|| format!("buffer view {index} does not exist (the file has {})", views.len()))?;
        let stride = view.byte_stride.map(|s| s.0).filter(|&s| s > 0);
        if let Some(bytes) = self.decoded.view(index.value()) {
            return Ok((bytes?, stride));
        }
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let bytes = self.buffer_range(view.buffer.value(), offset, length);
        Ok((bytes.map_err(|e| format!("buffer view {index} {e}"))?, stride))
    }

    /// `length` bytes from `offset` on in a buffer.
    ///
    /// # Errors
    /// What is wrong with whatever refers to them, without its name.
    pub(super) fn buffer_range(&self, buffer: usize, offset: u64, length: u64) -> Result<&'a [u8], String> {
        let bytes =
            self.buffers.get(buffer).ok_or_else(|| format!("refers to buffer {buffer}, which does not exist"))?;
        let bytes = bytes.as_ref().map_err(|e| format!("has no bytes: {e}"))?;
        // the declared length counts, not the padding that may follow
        let declared = self.document.buffers[buffer].byte_length.0.min(bytes.len() as u64);
        match offset.checked_add(length) {
            Some(end) if end <= declared => Ok(&bytes[offset as usize..end as usize]),
            _ => Err(format!("lies outside of its buffer (bytes {offset} + {length} of {declared})")),
        }
    }

    /// The elements of an accessor, their component type and number, before a sparse part replaces
    /// some; none if they are zeros. `components`: of an element.
    fn base(&self, index: Index<Accessor>, components: usize) -> Result<Base<'a>, String> {
        let accessor = self.accessor(index)?;
        if let Some(decoded) = self.decoded.accessor(index.value()) {
            let decoded = decoded?;
            let elements = Elements { bytes: &decoded.bytes, stride: components * decoded.component.size() };
            return Ok(Base { elements: Some(elements), component: decoded.component, count: decoded.count });
        }
        let (component, count) = (self.component(accessor)?, accessor.count.0);
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let elements = accessor.buffer_view.map(|v| self.elements(v, offset, count, components * component.size()));
        Ok(Base { elements: elements.transpose()?, component, count })
    }

    /// `count` elements of `size` bytes from `offset` on in a buffer view.
    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: u64,
        size: usize,
    ) -> Result<Elements<'a>, String> {
        let (bytes, stride) = self.view(view)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(format!("buffer view {view} has a stride of {stride} bytes for elements of {size}"));
        }
        if count == 0 {
            return Ok(Elements { bytes: &[], stride });
        }
        let end = (count - 1).checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64)?.checked_add(offset));
        match end {
            Some(end) if end <= bytes.len() as u64 => {
                Ok(Elements { bytes: &bytes[offset as usize..end as usize], stride })
            }
            _ => Err(format!("{count} elements lie outside of buffer view {view} ({} bytes)", bytes.len())),
        }
    }

    /// Reads an accessor of floats or (normalised) integers with the `N` components of `shape`.
    pub(super) fn floats<const N: usize, T: Send>(
        &self,
        index: Index<Accessor>,
        shape: Type,
        make: impl Fn([f32; N]) -> T + Sync,
    ) -> Result<Vec<T>, String> {
        let accessor = self.accessor(index)?;
        match valid(accessor.type_) {
            Some(found) if found == shape => {}
            Some(found) => {
                return Err(format!("accessor {index} is of type {} where {} is needed", name(found), name(shape)));
            }
            None => return Err(format!("accessor {index} is of an unknown type where {} is needed", name(shape))),
        }
        self.try_floats(index, accessor, make).map_err(|e| format!("accessor {index}: {e}"))
    }

    fn try_floats<const N: usize, T: Send>(
        &self,
        index: Index<Accessor>,
        accessor: &Accessor,
        make: impl Fn([f32; N]) -> T + Sync,
    ) -> Result<Vec<T>, String> {
        let base = self.base(index, N)?;
        self.take(base.count.saturating_mul(size_of::<T>() as u64), base.count)?;
        let count = base.count as usize;
        let mut out = match base.elements {
            Some(elements) => gather(&elements, count, base.component, accessor.normalized, &make),
            None => (0..count).map(|_| make([0.0; N])).collect(),
        };
        let component = self.component(accessor)?;
        if let Some((at, values)) = self.sparse(accessor, N * component.size())? {
            let values = gather(&values, at.len(), component, accessor.normalized, &make);
            for (i, value) in at.into_iter().zip(values) {
                out[i] = value;
            }
        }
        Ok(out)
    }

    /// Reads an accessor's elements as they are stored, one after the other.
    pub(super) fn stored(&self, index: Index<Accessor>) -> Result<StoredElements, String> {
        let accessor = self.accessor(index)?;
        let shape = valid(accessor.type_).ok_or_else(|| format!("accessor {index} is of an unknown type"))?;
        let named = |e: String| format!("accessor {index}: {e}");
        let base = self.base(index, shape.multiplicity()).map_err(named)?;
        let (count, size) = (base.count as usize, shape.multiplicity() * base.component.size());
        self.take(base.count.saturating_mul(size as u64), base.count)?;
        let mut bytes = match base.elements {
            Some(Elements { bytes, stride }) => {
                (0..count).flat_map(|i| &bytes[i * stride..][..size]).copied().collect()
            }
            None => vec![0; count * size],
        };
        if let Some((at, values)) = self.sparse(accessor, size).map_err(named)? {
            for (k, i) in at.into_iter().enumerate() {
                bytes[i * size..][..size].copy_from_slice(&values.bytes[k * values.stride..][..size]);
            }
        }
        Ok(StoredElements { bytes, count, shape, component: base.component, normalized: accessor.normalized })
    }

    /// Reads a scalar accessor of unsigned integers.
    pub(super) fn indices(&self, index: Index<Accessor>) -> Result<Indices<'a>, String> {
        let accessor = self.accessor(index)?;
        self.try_indices(index, accessor).map_err(|e| format!("accessor {index}: {e}"))
    }

    fn try_indices(&self, index: Index<Accessor>, accessor: &Accessor) -> Result<Indices<'a>, String> {
        let component = self.component(accessor)?;
        if valid(accessor.type_) != Some(Type::Scalar) || !component.is_index() {
            return Err("does not hold indices (unsigned scalars)".to_owned());
        }
        let Base { elements, component: stored, count } = self.base(index, 1)?;
        let base = match elements {
            Some(Elements { bytes, stride }) => {
                Indices::InPlace { bytes, count: count as usize, stride, size: stored.size() }
            }
            None => {
                self.take(count.saturating_mul(4), count)?;
                Indices::Owned(vec![0; count as usize])
            }
        };
        let Some((at, values)) = self.sparse(accessor, component.size())? else { return Ok(base) };
        self.take(accessor.count.0.saturating_mul(4), accessor.count.0)?;
        let mut all: Vec<u32> = (0..base.len()).map(|i| base.get(i)).collect();
        for (k, i) in at.into_iter().enumerate() {
            all[i] = component.index(&values.bytes[k * values.stride..]);
        }
        Ok(Indices::Owned(all))
    }

    /// Makes room for what is read of an accessor. Nothing in the file bounds those without data,
    /// which are all zeros, and several uses of one have a copy each.
    fn take(&self, bytes: u64, count: u64) -> Result<(), String> {
        self.budget.take(bytes, || format!("an accessor of {count} elements"))
    }

    fn component(&self, accessor: &Accessor) -> Result<ComponentType, String> {
        valid(accessor.component_type).map(|c| c.0).ok_or_else(|| "has an unknown component type".to_owned())
    }

    /// Which elements a sparse accessor replaces, and by what.
    fn sparse(&self, accessor: &Accessor, size: usize) -> Result<Option<(Vec<usize>, Elements<'a>)>, String> {
        let Some(sparse) = &accessor.sparse else { return Ok(None) };
        let (indices, values, count) = (&sparse.indices, &sparse.values, sparse.count.0);
        let component = valid(indices.component_type).ok_or("has sparse indices of an unknown component type")?.0;
        let at = self.elements(indices.buffer_view, indices.byte_offset.0, count, component.size())?;
        let values = self.elements(values.buffer_view, values.byte_offset.0, count, size)?;
        let at: Vec<usize> =
            (0..count as usize).map(|i| component.index(&at.bytes[i * at.stride..]) as usize).collect();
        match at.iter().find(|&&i| i as u64 >= accessor.count.0) {
            Some(i) => Err(format!("replaces element {i} of only {} (sparse)", accessor.count.0)),
            None => Ok(Some((at, values))),
        }
    }
}

/// The type as glTF writes it.
fn name(shape: Type) -> String {
    format!("{shape:?}").to_uppercase()
}

/// Elements of an accessor that a thread reads at least.
const MIN_ELEMENTS: usize = 1 << 16;

fn gather<const N: usize, T: Send>(
    elements: &Elements,
    count: usize,
    component: ComponentType,
    normalized: bool,
    make: impl Fn([f32; N]) -> T + Sync,
) -> Vec<T> {
    let size = component.size();
    let element = |i: usize| {
        let b = &elements.bytes[i * elements.stride..][..N * size];
        make(std::array::from_fn(|k| component.float(&b[k * size..], normalized)))
    };
    // the common case apart, so that the compiler sees its constants
    if component == ComponentType::F32 {
        let element = |i: usize| {
            let b = &elements.bytes[i * elements.stride..][..N * 4];
            make(std::array::from_fn(|k| ComponentType::F32.float(&b[k * 4..k * 4 + 4], false)))
        };
        return (0..count).into_par_iter().with_min_len(MIN_ELEMENTS).map(element).collect();
    }
    (0..count).into_par_iter().with_min_len(MIN_ELEMENTS).map(element).collect()
}
