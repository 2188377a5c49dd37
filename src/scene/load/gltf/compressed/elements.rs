//! Elements that meshoptimizer packed, by the crate `meshopt`, whose decoders are safe with any
//! bytes.

use serde::Deserialize;

use super::meshopt::extension;
use crate::scene::load::gltf::accessor::Reader;
use crate::scene::load::gltf::decoded::DecodedBytes;

/// Content of the extension of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CompressedView {
    /// Index of the buffer with the compressed bytes.
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    /// Bytes of an element.
    byte_stride: usize,
    /// Number of elements.
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// The step that turns decoded elements into those of accessors.
#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Decodes a compressed buffer view.
pub(super) fn decode(reader: &Reader, view: usize) -> Result<DecodedBytes, String> {
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
    elements(bytes, &compressed).map_err(fail)
}

/// Decoded and filtered elements of a view.
fn elements(bytes: &[u8], view: &CompressedView) -> Result<DecodedBytes, String> {
    let count = usize::try_from(view.count).map_err(|_| "has too many elements".to_owned())?;
    let stride = view.byte_stride;
    let broken = |_| "holds broken data".to_owned();
    match view.mode {
        Mode::Attributes => {
            let decoder = stride.is_multiple_of(4).then(|| ATTRIBUTES.get((stride / 4).wrapping_sub(1))).flatten();
            let decoder = decoder.ok_or_else(|| format!("has a stride of {stride} bytes, no multiple of 4 to 256"))?;
            let mut words = decoder(bytes, count).map_err(broken)?;
            apply_filter(&mut words, view)?;
            Ok(DecodedBytes::Words(words))
        }
        _ if view.filter != Filter::None => Err("has a filter for what is not an attribute".to_owned()),
        Mode::Triangles if !count.is_multiple_of(3) => Err(format!("has {count} corners, no multiple of three")),
        Mode::Triangles if stride == 2 => {
            meshopt::decode_index_buffer::<u16>(bytes, count).map(DecodedBytes::Halfwords).map_err(broken)
        }
        Mode::Triangles if stride == 4 => {
            meshopt::decode_index_buffer::<u32>(bytes, count).map(DecodedBytes::Words).map_err(broken)
        }
        Mode::Indices if stride == 2 => {
            meshopt::decode_index_sequence::<u16>(bytes, count).map(DecodedBytes::Halfwords).map_err(broken)
        }
        Mode::Indices if stride == 4 => {
            meshopt::decode_index_sequence::<u32>(bytes, count).map(DecodedBytes::Words).map_err(broken)
        }
        _ => Err(format!("has indices of {stride} bytes, neither 2 nor 4")),
    }
}

/// Turns decoded attributes into what the accessors describe.
fn apply_filter(words: &mut [u32], view: &CompressedView) -> Result<(), String> {
    let unfit = || format!("has a filter that does not fit its stride of {} bytes", view.byte_stride);
    match (view.filter, view.byte_stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => meshopt::decode_filter_oct::<i8>(bytemuck::cast_slice_mut(words)),
        (Filter::Octahedral, 8) => meshopt::decode_filter_oct::<i16>(bytemuck::cast_slice_mut(words)),
        (Filter::Quaternion, 8) => meshopt::decode_filter_quat(bytemuck::cast_slice_mut(words)),
        (Filter::Exponential, _) => meshopt::decode_filter_exp::<1>(bytemuck::cast_slice_mut(words)),
        (Filter::Color, 4) => meshopt::decode_filter_color::<u8>(bytemuck::cast_slice_mut(words)),
        (Filter::Color, 8) => meshopt::decode_filter_color::<u16>(bytemuck::cast_slice_mut(words)),
        _ => return Err(unfit()),
    }
    Ok(())
}

/// An element of `N` words. The crate's decoder takes the size of elements from their type.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

type AttributeDecoder = fn(&[u8], usize) -> meshopt::Result<Vec<u32>>;

fn decode_attributes<const N: usize>(bytes: &[u8], count: usize) -> meshopt::Result<Vec<u32>> {
    meshopt::decode_vertex_buffer::<Words<N>>(bytes, count).map(bytemuck::cast_vec)
}

/// Decoders of elements of 1 to 64 words.
#[rustfmt::skip]
const ATTRIBUTES: [AttributeDecoder; 64] = [
    decode_attributes::<1>, decode_attributes::<2>, decode_attributes::<3>, decode_attributes::<4>,
    decode_attributes::<5>, decode_attributes::<6>, decode_attributes::<7>, decode_attributes::<8>,
    decode_attributes::<9>, decode_attributes::<10>, decode_attributes::<11>, decode_attributes::<12>,
    decode_attributes::<13>, decode_attributes::<14>, decode_attributes::<15>, decode_attributes::<16>,
    decode_attributes::<17>, decode_attributes::<18>, decode_attributes::<19>, decode_attributes::<20>,
    decode_attributes::<21>, decode_attributes::<22>, decode_attributes::<23>, decode_attributes::<24>,
    decode_attributes::<25>, decode_attributes::<26>, decode_attributes::<27>, decode_attributes::<28>,
    decode_attributes::<29>, decode_attributes::<30>, decode_attributes::<31>, decode_attributes::<32>,
    decode_attributes::<33>, decode_attributes::<34>, decode_attributes::<35>, decode_attributes::<36>,
    decode_attributes::<37>, decode_attributes::<38>, decode_attributes::<39>, decode_attributes::<40>,
    decode_attributes::<41>, decode_attributes::<42>, decode_attributes::<43>, decode_attributes::<44>,
    decode_attributes::<45>, decode_attributes::<46>, decode_attributes::<47>, decode_attributes::<48>,
    decode_attributes::<49>, decode_attributes::<50>, decode_attributes::<51>, decode_attributes::<52>,
    decode_attributes::<53>, decode_attributes::<54>, decode_attributes::<55>, decode_attributes::<56>,
    decode_attributes::<57>, decode_attributes::<58>, decode_attributes::<59>, decode_attributes::<60>,
    decode_attributes::<61>, decode_attributes::<62>, decode_attributes::<63>, decode_attributes::<64>,
];
