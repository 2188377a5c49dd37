//! `KHR_draco_mesh_compression`: primitives that Draco packed, by the crate `draco-core`, which is
//! Rust without `unsafe` and limits what a stream may make it allocate.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos>

use std::collections::BTreeMap;

use ::gltf::json::Index;
use ::gltf::json::accessor::{Accessor, ComponentType, Type};
use ::gltf::json::mesh::Primitive;
use ::gltf::json::validation::Checked;
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use serde::Deserialize;

use super::{DRACO, draco_extension};
use crate::scene::load::gltf::accessor::Reader;
use crate::scene::load::gltf::decoded::{DecodedBytes, DecodedElements};
use crate::scene::load::gltf::values::valid;

/// Content of the extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CompressedPrimitive {
    buffer_view: usize,
    /// Ids that attributes have in the stream, by their names in glTF.
    attributes: BTreeMap<String, u32>,
}

/// A stream, and the accessors that it fills.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Stream {
    /// Index of the buffer view that holds it, or what is wrong with the extension.
    view: Result<usize, String>,
    indices: Option<usize>,
    /// Accessors of attributes, and the ids of these in the stream.
    attributes: Vec<(usize, u32)>,
}

impl Stream {
    /// Reads the extension of a primitive, if it has one.
    pub(super) fn from_primitive(primitive: &Primitive) -> Option<Self> {
        let value = draco_extension(primitive)?;
        let accessors = primitive
            .attributes
            .iter()
            .filter_map(|(semantic, accessor)| Some((valid(semantic.clone())?.to_string(), accessor.value())));
        let indices = primitive.indices.map(|i| i.value());
        Some(match serde_json::from_value::<CompressedPrimitive>(value.clone()) {
            Ok(compressed) => {
                let attributes =
                    accessors.filter_map(|(name, accessor)| Some((accessor, *compressed.attributes.get(&name)?)));
                Self { view: Ok(compressed.buffer_view), indices, attributes: attributes.collect() }
            }
            Err(e) => {
                let attributes = accessors.map(|(_, accessor)| (accessor, 0)).collect();
                Self { view: Err(format!("the extension {DRACO} is not valid: {e}")), indices, attributes }
            }
        })
    }

    /// Indices of the accessors that it fills.
    pub(super) fn accessors(&self) -> impl Iterator<Item = usize> + '_ {
        self.attributes.iter().map(|&(accessor, _)| accessor).chain(self.indices)
    }
}

/// Decodes a stream: elements of each accessor.
pub(super) fn decode(reader: &Reader, stream: &Stream) -> Result<Vec<(usize, DecodedElements)>, String> {
    let view = stream.view.clone()?;
    let (bytes, _) = reader.view(Index::new(view as u32))?;
    let mesh = decode_mesh(reader, stream, bytes).map_err(|e| format!("buffer view {view} ({DRACO}) {e}"))?;

    let mut decoded = Vec::new();
    for &(accessor, id) in &stream.attributes {
        let fail = |e: String| format!("accessor {accessor} in buffer view {view} ({DRACO}) {e}");
        let attribute = mesh.attribute_by_unique_id(id).ok_or_else(|| fail(format!("has no attribute {id}")))?;
        let declared = reader.document.accessors.get(accessor).ok_or_else(|| fail("does not exist".to_owned()))?;
        decoded.push((accessor, attribute_elements(attribute, mesh.num_points(), declared).map_err(fail)?));
    }
    if let Some(accessor) = stream.indices {
        decoded.push((accessor, corners(&mesh)));
    }
    Ok(decoded)
}

/// Decodes a stream within the memory that the file's own accessors make likely.
fn decode_mesh(reader: &Reader, stream: &Stream, bytes: &[u8]) -> Result<Mesh, String> {
    // points may be split along seams of attributes: what is declared is no limit
    let size = |accessor: usize| {
        reader.document.accessors.get(accessor).map_or(0, |a| a.count.0.saturating_mul(element_size(a)))
    };
    let expected = stream.accessors().fold(0, |sum: u64, a| sum.saturating_add(size(a)));
    reader.budget.take(expected, || "a mesh compressed by Draco".to_owned())?;
    let limits = DecodeLimits::default()
        .with_max_points(u64::from(u32::MAX))
        .with_max_faces(u64::from(u32::MAX))
        .with_max_decoded_bytes(expected.saturating_mul(4).saturating_add(1 << 20));
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| format!("cannot be decoded: {}", e.message()))?;
    Ok(mesh)
}

/// Bytes of an element.
fn element_size(accessor: &Accessor) -> u64 {
    let components = valid(accessor.type_).map_or(1, |t: Type| t.multiplicity());
    let component = valid(accessor.component_type).map_or(4, |c| c.0.size());
    (components * component) as u64
}

/// Values of an attribute for every point, as the accessor declares them.
fn attribute_elements(
    attribute: &PointAttribute,
    points: usize,
    accessor: &Accessor,
) -> Result<DecodedElements, String> {
    let components = valid(accessor.type_).ok_or("is of an unknown type")?.multiplicity();
    let Checked::Valid(declared) = accessor.component_type else {
        return Err("has an unknown component type".to_owned());
    };

    // the same kind of numbers: their bytes; else as floats
    let (component, bytes) = if component_type(attribute.data_type()) == Some(declared.0)
        && usize::from(attribute.num_components()) == components
    {
        (declared.0, DecodedBytes::Bytes(copy_values(attribute, points)?))
    } else {
        let floats = attribute.read_f32s(points, components);
        (ComponentType::F32, DecodedBytes::Words(bytemuck::cast_vec(floats)))
    };
    Ok(DecodedElements { bytes, component, count: points as u64 })
}

/// The bytes of an attribute's values, point by point.
fn copy_values(attribute: &PointAttribute, points: usize) -> Result<Vec<u8>, String> {
    let size = usize::from(attribute.num_components()) * attribute.data_type().byte_length();
    let stride = usize::try_from(attribute.byte_stride()).map_err(|_| "has a negative stride".to_owned())?;
    let values = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..points {
        let value = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let start = value.checked_mul(stride);
        let value = start.and_then(|start| values.get(start..)?.get(..size)).ok_or("lacks the value of a point")?;
        bytes.extend_from_slice(value);
    }
    Ok(bytes)
}

/// Three corners a triangle.
fn corners(mesh: &Mesh) -> DecodedElements {
    let corners: Vec<u32> = mesh.faces().iter().flat_map(|face| face.map(|point| point.0)).collect();
    let count = corners.len() as u64;
    DecodedElements { bytes: DecodedBytes::Words(corners), component: ComponentType::U32, count }
}

/// The component type of glTF that holds numbers of this kind.
fn component_type(data: DataType) -> Option<ComponentType> {
    Some(match data {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        _ => return None,
    })
}
