//! Small files, put together in tests.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use skylit::error::Result;
use skylit::scene::load::{GeometryOptions, LoadOptions, Projection, load_with};
use skylit::scene::{Geometry, Scene, TriangleMesh};
use tempfile::TempDir;

/// A glTF document in the making.
pub struct Doc {
    pub json: Value,
    pub bin: Vec<u8>,
}

pub const F32: u32 = 5126;
pub const U32: u32 = 5125;
pub const U16: u32 = 5123;
pub const I16: u32 = 5122;
pub const U8: u32 = 5121;
pub const I8: u32 = 5120;

/// A right triangle in the xy plane.
pub const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

pub fn bytes<const N: usize>(values: &[[f32; N]]) -> Vec<u8> {
    values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

impl Doc {
    /// One node with one mesh without primitives.
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": "node", "mesh": 0 }],
            "meshes": [{ "name": "mesh", "primitives": [] }],
        });
        Self { json, bin: Vec::new() }
    }

    /// One triangle, not indexed, without material.
    pub fn triangle() -> Self {
        let mut doc = Doc::new();
        let position = doc.positions(&TRIANGLE);
        doc.primitive(json!({ "attributes": { "POSITION": position } }));
        doc
    }

    pub fn push(&mut self, key: &str, value: Value) -> usize {
        if self.json[key].is_null() {
            self.json[key] = json!([]);
        }
        let array = self.json[key].as_array_mut().unwrap();
        array.push(value);
        array.len() - 1
    }

    pub fn view(&mut self, data: &[u8], stride: Option<usize>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": data.len() });
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bin.extend_from_slice(data);
        self.push("bufferViews", view)
    }

    pub fn accessor(&mut self, data: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let view = self.view(data, None);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }))
    }

    pub fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        self.accessor(&bytes(positions), F32, "VEC3", positions.len())
    }

    pub fn primitive(&mut self, primitive: Value) {
        self.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }

    /// The first primitive.
    pub fn first(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    fn with_buffer(&self, uri: Option<String>) -> Value {
        let mut json = self.json.clone();
        if !self.bin.is_empty() && json["buffers"].is_null() {
            json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
            if let Some(uri) = uri {
                json["buffers"][0]["uri"] = json!(uri);
            }
        }
        json
    }

    /// As a `.gltf` text with the buffer in a data URI.
    pub fn gltf(&self) -> Vec<u8> {
        let data: String = base64(&self.bin);
        self.with_buffer(Some(format!("data:application/octet-stream;base64,{data}"))).to_string().into_bytes()
    }

    /// As a `.glb`.
    pub fn glb(&self) -> Vec<u8> {
        let mut text = self.with_buffer(None).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut out = b"glTF".to_vec();
        for n in [2, 12 + 8 + text.len() + 8 + bin.len(), text.len()] {
            out.extend_from_slice(&(n as u32).to_le_bytes());
        }
        out.extend_from_slice(b"JSON");
        out.extend_from_slice(&text);
        out.extend_from_slice(&(bin.len() as u32).to_le_bytes());
        out.extend_from_slice(b"BIN\0");
        out.extend_from_slice(&bin);
        out
    }

    pub fn load(&self) -> Scene {
        self.try_load().unwrap()
    }

    pub fn try_load(&self) -> Result<Scene> {
        let folder = Folder::new();
        folder.load("scene.gltf", self.gltf())
    }

    /// The error of loading as one line.
    pub fn error(&self) -> String {
        let text = self.try_load().map(|_| ()).unwrap_err().to_string();
        assert!(!text.contains('\n'), "{text}");
        text
    }
}

pub fn base64(data: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(data)
}

/// A temporary folder.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, data: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, data).unwrap();
        path
    }

    pub fn load(&self, name: &str, data: impl AsRef<[u8]>) -> Result<Scene> {
        load(&self.write(name, data))
    }
}

pub fn load(path: &Path) -> Result<Scene> {
    skylit::scene::load::load(path.to_str().unwrap())
}

/// Loads with options for normals and texture coordinates.
pub fn load_vertices(path: &Path, normals: &str, uv: Option<Projection>) -> Scene {
    let geometry = GeometryOptions { normals: normals.parse().unwrap(), uv, ..Default::default() };
    load_with(path.to_str().unwrap(), &LoadOptions { geometry, ..LoadOptions::default() }).unwrap()
}

pub fn mesh(scene: &Scene, index: usize) -> &TriangleMesh {
    match &scene.meshes[index].geometry {
        Geometry::Triangles(t) => t,
        Geometry::Spheres(_) => panic!("spheres"),
    }
}

/// Corner positions of a mesh's triangles.
pub fn corners(mesh: &TriangleMesh) -> Vec<[[f32; 3]; 3]> {
    mesh.indices.iter().map(|t| t.map(|i| mesh.positions[i as usize].to_array())).collect()
}

/// A PNG whose texels are a function of column and row.
pub fn png_of(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbaImage::from_fn(width, height, |x, y| image::Rgba(texel(x, y)));
    pixels.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

/// One texel of 16 bits a channel.
pub fn png16(color: [u16; 4]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let pixels = image::ImageBuffer::<image::Rgba<u16>, _>::from_pixel(1, 1, image::Rgba(color));
    pixels.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

/// A PNG of one colour.
pub fn png(width: u32, height: u32, color: [u8; 4]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbaImage::from_pixel(width, height, image::Rgba(color));
    pixels.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}
