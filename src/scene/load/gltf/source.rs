//! A glTF file as its author wrote it, for tools that add to it: the text of its JSON, its buffers,
//! and vertices of primitives as they are stored.

use std::path::{Path, PathBuf};

use ::gltf::json::Root;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::Primitive;
use glam::Vec3;

use super::accessor::{BufferBytes, Reader};
use super::decoded::Decoded;
use super::values::AccessorIndex;
use super::{compressed, container, mesh};
use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::load::options::{LoadOptions, Loading};

/// A glTF file in memory.
pub struct SourceFile {
    path: PathBuf,
    json: Vec<u8>,
    document: Root,
    buffers: Vec<BufferBytes<'static>>,
    decoded: Decoded,
    budget: Budget,
    is_binary: bool,
}

/// A vertex attribute, or one of a morph target, as it is stored.
pub struct StoredAttribute {
    /// Name, such as `TEXCOORD_0`.
    pub name: String,
    /// Elements, one after the other.
    pub bytes: Vec<u8>,
    /// Bytes of an element.
    pub size: usize,
    /// Type of an element, as glTF writes it: `VEC3`.
    pub shape: String,
    /// Type of a component, as glTF numbers it: 5126 is a float.
    pub component: u32,
    /// Integers are normalized.
    pub normalized: bool,
}

impl StoredAttribute {
    /// The elements of these vertices.
    pub fn of_vertices(&self, vertices: &[u32]) -> Self {
        let element = |&v: &u32| &self.bytes[v as usize * self.size..][..self.size];
        let bytes = vertices.iter().flat_map(element).copied().collect();
        Self { name: self.name.clone(), shape: self.shape.clone(), bytes, ..*self }
    }

    /// The least and the greatest stored value of each component, as accessors of positions have
    /// them.
    pub fn extremes(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.size / component_size(self.component);
        let (mut least, mut greatest) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
        for element in self.bytes.chunks_exact(self.size) {
            for (k, b) in element.chunks_exact(self.size / n).enumerate() {
                let value = stored_value(self.component, b);
                least[k] = least[k].min(value);
                greatest[k] = greatest[k].max(value);
            }
        }
        (least, greatest)
    }
}

/// Bytes of a component.
fn component_size(component: u32) -> usize {
    match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

/// The number in a component's bytes.
fn stored_value(component: u32, b: &[u8]) -> f64 {
    match component {
        5120 => f64::from(b[0] as i8),
        5121 => f64::from(b[0]),
        5122 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        5123 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        5125 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    }
}

/// The vertices of a primitive.
pub struct SourcePrimitive {
    /// Positions in object space.
    pub positions: Vec<Vec3>,
    /// Corners of its triangles, whether the file has a list, a strip or a fan.
    pub triangles: Vec<[u32; 3]>,
    /// Attributes of its vertices.
    pub attributes: Vec<StoredAttribute>,
    /// Attributes of each of its morph targets.
    pub targets: Vec<Vec<StoredAttribute>>,
    /// It is compressed by Draco.
    pub is_draco: bool,
}

impl SourceFile {
    /// Reads a `.gltf` or `.glb` file and its buffers.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn open(path: &Path) -> Result<Self> {
        let file = crate::files::read_regular(path).map_err(|e| Error::read(path, &e))?;
        let budget = Budget::default();
        budget.read(file.len());
        let chunks = container::split(&file, path)?;
        let (document, _) = container::document(&chunks.json, path)?;
        let loading = Loading { options: LoadOptions::default(), budget: &budget };
        let own = |bytes: BufferBytes| bytes.map(|b| b.into_owned().into());
        let buffers: Vec<BufferBytes<'static>> =
            container::buffers(&document, chunks.bin, path, loading).into_iter().map(own).collect();
        let stored = Reader { document: &document, buffers: &buffers, decoded: &Decoded::default(), budget: &budget };
        let decoded = compressed::decode(&stored, &|_| {});
        Ok(Self {
            path: path.to_owned(),
            json: chunks.json.into_owned(),
            document,
            buffers,
            decoded,
            budget,
            is_binary: file.starts_with(b"glTF"),
        })
    }

    /// The path that it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// It is a `.glb`, whatever its name.
    pub fn is_binary(&self) -> bool {
        self.is_binary
    }

    /// The text of its JSON.
    pub fn json(&self) -> &[u8] {
        &self.json
    }

    /// Bytes of each buffer; `None` for those that no buffer view uses, or that an extension fills.
    pub fn buffers(&self) -> impl Iterator<Item = Option<&[u8]>> {
        let length = |i: usize| self.document.buffers[i].byte_length.0 as usize;
        self.buffers.iter().enumerate().map(move |(i, b)| b.as_ref().ok().map(|b| &b[..length(i).min(b.len())]))
    }

    /// The bytes that a URI of the file stands for.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn read_uri(&self, uri: &str) -> Result<Vec<u8>> {
        let loading = Loading { options: LoadOptions::default(), budget: &self.budget };
        container::read_uri(uri, &self.path, loading)
            .map_err(|e| Error::input(&self.path, format!("{uri} cannot be read: {e}")))
    }

    /// The vertices of a primitive, decoded where they are compressed.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn primitive(&self, mesh: usize, primitive: usize) -> Result<SourcePrimitive> {
        let found = self.document.meshes.get(mesh).and_then(|m| m.primitives.get(primitive));
        let read = |found: &Primitive| self.read_primitive(found);
        found
            .ok_or_else(|| "does not exist".to_owned())
            .and_then(read)
            .map_err(|e| Error::input(&self.path, format!("mesh {mesh}, primitive {primitive}: {e}")))
    }

    fn read_primitive(&self, primitive: &Primitive) -> Result<SourcePrimitive, String> {
        let reader =
            Reader { document: &self.document, buffers: &self.buffers, decoded: &self.decoded, budget: &self.budget };
        let triangles = mesh::read(&reader, primitive, false, &[], &mut |_| {})?.ok_or("has no triangles")?;
        let vertices = triangles.positions.len();
        let read = |name: String, accessor| stored_attribute(&reader, name, accessor, vertices);

        // attributes of the vertices, and of each morph target
        let attributes = primitive.attributes.iter().filter_map(|(semantic, accessor)| {
            let semantic = super::values::valid(semantic.clone())?;
            Some(read(semantic.to_string(), *accessor))
        });
        let attributes = attributes.collect::<Result<_, _>>()?;
        let mut targets = Vec::new();
        for target in primitive.targets.iter().flatten() {
            let parts = [("POSITION", target.positions), ("NORMAL", target.normals), ("TANGENT", target.tangents)];
            let parts = parts.into_iter().filter_map(|(name, accessor)| Some(read(name.to_owned(), accessor?)));
            targets.push(parts.collect::<Result<_, _>>()?);
        }
        Ok(SourcePrimitive {
            positions: triangles.positions,
            triangles: triangles.indices,
            attributes,
            targets,
            is_draco: compressed::draco_extension(primitive).is_some(),
        })
    }
}

/// An attribute of a primitive of so many vertices.
fn stored_attribute(
    reader: &Reader,
    name: String,
    accessor: AccessorIndex,
    vertices: usize,
) -> Result<StoredAttribute, String> {
    let stored = reader.stored(accessor)?;
    if stored.count != vertices {
        return Err(format!("attribute {name} has {} elements for {vertices} vertices", stored.count));
    }
    let component = match stored.component {
        ComponentType::I8 => 5120,
        ComponentType::U8 => 5121,
        ComponentType::I16 => 5122,
        ComponentType::U16 => 5123,
        ComponentType::U32 => 5125,
        ComponentType::F32 => 5126,
    };
    let shape = match stored.shape {
        Type::Scalar => "SCALAR",
        Type::Vec2 => "VEC2",
        Type::Vec3 => "VEC3",
        Type::Vec4 => "VEC4",
        Type::Mat2 => "MAT2",
        Type::Mat3 => "MAT3",
        Type::Mat4 => "MAT4",
    };
    Ok(StoredAttribute {
        name,
        size: stored.shape.multiplicity() * stored.component.size(),
        bytes: stored.bytes,
        shape: shape.to_owned(),
        component,
        normalized: stored.normalized,
    })
}
