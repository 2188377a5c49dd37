//! Additions to a glTF file that keep the rest of it: text of the JSON that does not change is
//! written as it was read, and so are the bytes of buffers.

mod object;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::gltf::encode;
use super::{glb, write_buffered};
use crate::error::{Error, Result};
use crate::files;
use crate::scene::load::{SourceFile, StoredAttribute};
use object::Object;

/// The extension of primitives that Draco packed.
const DRACO: &str = "KHR_draco_mesh_compression";
/// Uses of buffer views, as glTF numbers them.
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Extensions of buffer views that name a buffer of their own.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A glTF file with additions, in memory until it is saved.
pub struct AmendedFile {
    source: SourceFile,
    root: Object,
    /// Lists of the document that were looked at, by their names.
    lists: BTreeMap<&'static str, List>,
    /// Whether a primitive that Draco packed was written anew.
    unpacks_draco: bool,
    /// Bytes of added buffer views, each from a multiple of 4.
    bytes: Vec<u8>,
    /// Added buffer views.
    views: Vec<AddedView>,
    /// Added images: name and PNG file.
    images: Vec<(String, Vec<u8>)>,
}

/// A list of the document, which is read once.
struct List {
    values: Vec<Box<RawValue>>,
    has_changed: bool,
}

/// A buffer view that is added.
struct AddedView {
    /// Offset in the added bytes, and length.
    offset: usize,
    length: usize,
    /// The use of its bytes; `None` for images.
    target: Option<u32>,
    /// Bytes from one vertex to the next, where that is not the size of an element.
    stride: Option<usize>,
}

/// New vertices of a primitive.
pub struct NewVertices<'a> {
    /// The vertex of the file that each is a copy of.
    pub sources: &'a [u32],
    /// Corners of the triangles.
    pub triangles: &'a [[u32; 3]],
    /// A set of texture coordinates that they get, and its number.
    pub texcoords: (&'a [[f32; 2]], u32),
}

impl AmendedFile {
    /// Reads a `.gltf` or `.glb` file.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn open(path: &Path) -> Result<Self> {
        let source = SourceFile::open(path)?;
        let root = Object::parse(source.json()).map_err(|e| Error::input(path, format!("is not valid JSON: {e}")))?;
        let (bytes, views, images) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { source, root, lists: BTreeMap::new(), unpacks_draco: false, bytes, views, images })
    }

    /// The file as it was read.
    pub fn source(&self) -> &SourceFile {
        &self.source
    }

    /// A list of the file, empty where there is none.
    fn list(&mut self, name: &'static str) -> &mut List {
        let root = &self.root;
        self.lists.entry(name).or_insert_with(|| List { values: root.list(name), has_changed: false })
    }

    /// Puts the lists that have changed into the document.
    fn write_lists(&mut self) {
        for (name, list) in std::mem::take(&mut self.lists) {
            if list.has_changed {
                self.root.set(name, &list.values);
            }
        }
    }

    /// Appends a value to a list of the file, which is made where there is none; returns its index.
    fn push(&mut self, list: &'static str, value: &Value) -> usize {
        let list = self.list(list);
        list.values.push(object::raw(value));
        list.has_changed = true;
        list.values.len() - 1
    }

    /// Changes an element of a list of the file.
    fn change(&mut self, name: &'static str, index: usize, change: impl FnOnce(&mut Object)) -> Result<()> {
        let list = self.list(name);
        let parsed = list.values.get(index).and_then(|value| Object::parse(value.get().as_bytes()).ok());
        let Some(mut element) = parsed else {
            return Err(Error::input(self.source.path(), format!("{name} has no element {index}")));
        };
        change(&mut element);
        list.values[index] = object::raw(&element);
        list.has_changed = true;
        Ok(())
    }

    /// Changes all elements of a list of the file.
    fn change_each(&mut self, list: &'static str, mut change: impl FnMut(&mut Object)) {
        let list = self.list(list);
        for value in &mut list.values {
            if let Ok(mut element) = Object::parse(value.get().as_bytes()) {
                change(&mut element);
                *value = object::raw(&element);
            }
        }
        list.has_changed |= !list.values.is_empty();
    }

    /// Adds a buffer view of these bytes; returns its index.
    fn add_view(&mut self, bytes: &[u8], target: Option<u32>, stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(AddedView { offset: self.bytes.len(), length: bytes.len(), target, stride });
        self.bytes.extend_from_slice(bytes);
        self.list("bufferViews").values.len() + self.views.len() - 1
    }

    /// Adds a texture of a PNG file, which is called `name` where it is a file of its own; returns
    /// its index. It is filtered bilinearly and through its mip levels, and repeated or clamped.
    pub fn add_texture(&mut self, name: &str, png: Vec<u8>, repeats: bool) -> usize {
        const LINEAR: u32 = 9729;
        const LINEAR_MIPMAP_LINEAR: u32 = 9987;
        const CLAMP_TO_EDGE: u32 = 33071;
        const REPEAT: u32 = 10497;
        let wrap = if repeats { REPEAT } else { CLAMP_TO_EDGE };
        let sampler = self.push(
            "samplers",
            &json!({
                "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR,
                "wrapS": wrap, "wrapT": wrap,
            }),
        );
        // where its bytes lie is known when the file is saved
        let source = self.list("images").values.len() + self.images.len();
        self.images.push((name.to_owned(), png));
        self.push("textures", &json!({ "name": name, "source": source, "sampler": sampler }))
    }

    /// Gives a material an occlusion texture, in place of the one that it had.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such material.
    pub fn set_occlusion(&mut self, material: usize, texture: usize, texcoord: u32) -> Result<()> {
        self.change("materials", material, |m| {
            m.set("occlusionTexture", &json!({ "index": texture, "texCoord": texcoord }));
        })
    }

    /// Gives a material a texture of roughness and metalness, in place of the one that it had.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such material.
    pub fn set_metallic_roughness(&mut self, material: usize, texture: usize, texcoord: u32) -> Result<()> {
        self.change("materials", material, |m| {
            m.change("pbrMetallicRoughness", |pbr| {
                pbr.set("metallicRoughnessTexture", &json!({ "index": texture, "texCoord": texcoord }));
            });
        })
    }

    /// Appends a copy of an element of a list, with changes; returns its index.
    fn push_copy(&mut self, name: &'static str, index: usize, change: impl FnOnce(&mut Object)) -> Result<usize> {
        let list = self.list(name);
        let copy = list.values.get(index).cloned();
        list.values.extend(copy);
        list.has_changed = true;
        // a list without such an element has grown by none, and has none at its end
        let last = if index < list.values.len() { list.values.len() - 1 } else { index };
        self.change(name, last, change)?;
        Ok(last)
    }

    /// Adds a copy of a material that is called `name`; returns its index.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such material.
    pub fn copy_material(&mut self, material: usize, name: &str) -> Result<usize> {
        self.push_copy("materials", material, |m| m.set("name", &name))
    }

    /// Gives a node a copy of its mesh, which shares all accessors with it; returns the index of
    /// the copy.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such node, or the node no mesh.
    pub fn copy_mesh_of_node(&mut self, node: usize) -> Result<usize> {
        let mut mesh = None;
        self.change("nodes", node, |n| {
            mesh = n.get("mesh").and_then(|mesh| serde_json::from_str::<usize>(mesh.get()).ok());
        })?;
        let mesh = mesh.ok_or_else(|| Error::input(self.source.path(), format!("node {node} has no mesh")))?;
        let copy = self.push_copy("meshes", mesh, |_| {})?;
        self.change("nodes", node, |n| n.set("mesh", &copy))?;
        Ok(copy)
    }

    /// Returns true if an animation changes a property of a material (`KHR_animation_pointer`).
    pub fn is_animated(&self, material: usize) -> bool {
        let animations = self.root.get("animations");
        animations.is_some_and(|text| text.get().contains(&format!("\"/materials/{material}/")))
    }

    /// Adds a material with glTF's default values, for primitives that have none.
    pub fn add_material(&mut self, name: &str) -> usize {
        self.push("materials", &json!({ "name": name }))
    }

    /// Changes a primitive.
    fn change_primitive(&mut self, mesh: usize, primitive: usize, change: impl FnOnce(&mut Object)) -> Result<()> {
        self.change("meshes", mesh, |mesh| {
            let mut primitives = mesh.list("primitives");
            let Some(text) = primitives.get(primitive) else { return };
            if let Ok(mut found) = Object::parse(text.get().as_bytes()) {
                change(&mut found);
                primitives[primitive] = object::raw(&found);
                mesh.set("primitives", &primitives);
            }
        })
    }

    /// Gives a primitive a material.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such mesh.
    pub fn set_material(&mut self, mesh: usize, primitive: usize, material: usize) -> Result<()> {
        self.change_primitive(mesh, primitive, |p| p.set("material", &material))
    }

    /// Gives the vertices of a primitive colours in place of those that they had: linear RGB and
    /// alpha as normalized 16-bit integers.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such mesh.
    pub fn set_colors(&mut self, mesh: usize, primitive: usize, colors: &[[u16; 4]]) -> Result<()> {
        let view = self.add_view(bytemuck::cast_slice(colors), Some(ARRAY_BUFFER), None);
        let accessor = self.push(
            "accessors",
            &json!({
                "bufferView": view, "componentType": 5123, "normalized": true,
                "count": colors.len(), "type": "VEC4",
            }),
        );
        self.change_primitive(mesh, primitive, |p| {
            p.change("attributes", |attributes| attributes.set("COLOR_0", &accessor));
        })
    }

    /// Replaces the vertices of a primitive by copies of them with a further set of texture
    /// coordinates. All its attributes and morph targets are written anew, uncompressed.
    ///
    /// # Errors
    /// [`Error::Input`] if the file has no such primitive.
    pub fn replace_vertices(&mut self, mesh: usize, primitive: usize, new: &NewVertices) -> Result<()> {
        let source = self.source.primitive(mesh, primitive)?;

        // attributes of the vertices and of their morph targets
        let mut attributes = Vec::new();
        for attribute in &source.attributes {
            attributes.push((attribute.name.clone(), self.add_attribute(attribute, new.sources)));
        }
        let mut targets = Vec::new();
        for target in &source.targets {
            let parts = target.iter().map(|a| (a.name.clone(), json!(self.add_attribute(a, new.sources))));
            targets.push(Value::Object(parts.collect()));
        }

        // the new set of texture coordinates, and the corners
        let (texcoords, set) = new.texcoords;
        let view = self.add_view(bytemuck::cast_slice(texcoords), Some(ARRAY_BUFFER), None);
        let accessor = json!({ "bufferView": view, "componentType": 5126, "count": texcoords.len(), "type": "VEC2" });
        attributes.push((format!("TEXCOORD_{set}"), self.push("accessors", &accessor)));
        let view = self.add_view(bytemuck::cast_slice(new.triangles), Some(ELEMENT_ARRAY_BUFFER), None);
        let corners = 3 * new.triangles.len();
        let accessor = json!({ "bufferView": view, "componentType": 5125, "count": corners, "type": "SCALAR" });
        let indices = self.push("accessors", &accessor);

        // the primitive, without the compression that it may have had
        self.change_primitive(mesh, primitive, |p| {
            p.change("attributes", |all| attributes.iter().for_each(|(name, accessor)| all.set(name, accessor)));
            p.set("indices", &indices);
            p.remove("mode");
            if !targets.is_empty() {
                p.set("targets", &targets);
            }
            p.change("extensions", |all| all.remove(DRACO));
            if p.get("extensions").is_some_and(|e| e.get().trim() == "{}") {
                p.remove("extensions");
            }
        })?;
        self.unpacks_draco |= source.is_draco;
        Ok(())
    }

    /// Adds a copy of an attribute for new vertices; returns its accessor.
    fn add_attribute(&mut self, attribute: &StoredAttribute, sources: &[u32]) -> usize {
        // elements begin at multiples of 4 bytes
        let stride = attribute.size.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(stride * sources.len());
        for &vertex in sources {
            bytes.extend_from_slice(&attribute.bytes[vertex as usize * attribute.size..][..attribute.size]);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let view = self.add_view(&bytes, Some(ARRAY_BUFFER), (stride != attribute.size).then_some(stride));
        let mut accessor = json!({
            "bufferView": view, "componentType": attribute.component, "count": sources.len(), "type": attribute.shape,
        });
        if attribute.normalized {
            accessor["normalized"] = json!(true);
        }
        if attribute.name == "POSITION" {
            let (least, greatest) = attribute.of_vertices(sources).extremes();
            accessor["min"] = json!(least);
            accessor["max"] = json!(greatest);
        }
        self.push("accessors", &accessor)
    }

    /// Takes Draco out of the extensions of the file, if no primitive has it any more.
    fn forget_draco(&mut self) {
        if self.root.get("meshes").is_some_and(|meshes| meshes.get().contains(DRACO)) {
            return;
        }
        for list in ["extensionsUsed", "extensionsRequired"] {
            let names = self.root.list(list);
            let kept: Vec<Box<RawValue>> =
                names.iter().filter(|name| name.get() != format!("\"{DRACO}\"")).cloned().collect();
            if kept.is_empty() {
                self.root.remove(list);
            } else if kept.len() < names.len() {
                self.root.set(list, &kept);
            }
        }
    }

    /// Writes the file: one `.glb` with all buffers and images in it, or a `.gltf` that refers to
    /// the files of the source, with what was added in files of its own beside it. Each file
    /// appears only when it is complete, the `.gltf` last. Returns the files.
    ///
    /// # Errors
    /// [`Error::Output`], also for a `.gltf` of a `.glb`; [`Error::Input`] for images that cannot
    /// be read.
    pub fn save(mut self, path: &Path) -> Result<Vec<PathBuf>> {
        self.write_lists();
        if self.unpacks_draco {
            self.forget_draco();
        }
        if files::has_extension(path, "glb") { self.save_binary(path) } else { self.save_text(path) }
    }

    /// Puts the added buffer views into the document, which lie in a buffer from `base` on.
    fn list_views(&mut self, buffer: usize, base: usize) {
        for view in std::mem::take(&mut self.views) {
            let mut json = json!({ "buffer": buffer, "byteOffset": base + view.offset, "byteLength": view.length });
            if let Some(target) = view.target {
                json["target"] = json!(target);
            }
            if let Some(stride) = view.stride {
                json["byteStride"] = json!(stride);
            }
            self.push("bufferViews", &json);
        }
    }

    fn save_binary(mut self, path: &Path) -> Result<Vec<PathBuf>> {
        self.embed_images()?;

        // buffers that have bytes become one, in whose place the others count on
        let buffers = self.list("buffers").values.clone();
        let mut places = Vec::new();
        let (mut base, mut others) = (0usize, Vec::new());
        for (i, bytes) in self.source.buffers().enumerate() {
            match bytes {
                Some(bytes) => {
                    places.push((0, base));
                    base = (base + bytes.len()).next_multiple_of(4);
                }
                None => {
                    others.push(i);
                    places.push((others.len(), 0));
                }
            }
        }
        let is_joined = places.iter().enumerate().any(|(i, place)| *place != (i, 0));
        if is_joined {
            self.move_views(&places);
        }
        self.list_views(0, base);

        // the list of buffers
        let total = base + self.bytes.len();
        if total > 0 {
            let first = places.iter().position(|(buffer, _)| *buffer == 0).and_then(|i| buffers.get(i));
            let mut joined = first.and_then(|b| Object::parse(b.get().as_bytes()).ok()).unwrap_or_default();
            joined.remove("uri");
            joined.set("byteLength", &total);
            let kept = others.iter().filter_map(|&i| buffers.get(i).cloned());
            let all: Vec<Box<RawValue>> = std::iter::once(object::raw(&joined)).chain(kept).collect();
            *self.list("buffers") = List { values: all, has_changed: true };
        }

        // the bytes, each buffer padded
        self.write_lists();
        let mut parts: Vec<&[u8]> = Vec::new();
        for bytes in self.source.buffers().flatten() {
            parts.push(bytes);
            parts.push(&[0; 3][..bytes.len().next_multiple_of(4) - bytes.len()]);
        }
        parts.push(&self.bytes);
        glb::write(path, object::raw(&self.root).get().as_bytes(), &parts)?;
        Ok(vec![path.to_owned()])
    }

    /// Moves buffer views to where their buffers have gone: `places` has a buffer and an offset in
    /// it for each.
    fn move_views(&mut self, places: &[(usize, usize)]) {
        let moved = |view: &mut Object| {
            let number =
                |view: &Object, key: &str| -> Option<usize> { serde_json::from_str(view.get(key)?.get()).ok() };
            let Some((buffer, base)) = number(view, "buffer").and_then(|b| places.get(b)).copied() else { return };
            let offset = number(view, "byteOffset").unwrap_or_default();
            view.set("buffer", &buffer);
            view.set("byteOffset", &(base + offset));
        };
        self.change_each("bufferViews", |view| {
            moved(view);
            view.change("extensions", |all| MESHOPT.iter().for_each(|name| all.change(name, moved)));
        });
    }

    /// Makes buffer views of all images, those of the file that are elsewhere and the added ones.
    fn embed_images(&mut self) -> Result<()> {
        for index in 0..self.list("images").values.len() {
            let image = &self.list("images").values[index];
            let uri: Option<String> = Object::parse(image.get().as_bytes())
                .ok()
                .and_then(|image| serde_json::from_str(image.get("uri")?.get()).ok());
            let Some(uri) = uri else { continue };
            let bytes = self.source.read_uri(&uri)?;
            let view = self.add_view(&bytes, None, None);
            self.change("images", index, |image| {
                image.remove("uri");
                if image.get("mimeType").is_none() {
                    image.set("mimeType", &media_type(&bytes));
                }
                image.set("bufferView", &view);
            })?;
        }
        for (name, png) in std::mem::take(&mut self.images) {
            let view = self.add_view(&png, None, None);
            self.push("images", &json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        }
        Ok(())
    }

    fn save_text(mut self, path: &Path) -> Result<Vec<PathBuf>> {
        let fail = |message: &str| Error::Output { path: path.to_owned(), message: message.to_owned() };
        if self.source.is_binary() {
            return Err(fail("what is added to a .glb is written into a .glb: choose that extension"));
        }
        self.move_files(path)?;

        // added images, then added bytes, as files beside it
        let mut written = Vec::new();
        for (name, png) in std::mem::take(&mut self.images) {
            let file = companion(path, &format!("{name}.png"));
            write_buffered(&file, |out| out.write_all(&png))?;
            self.push("images", &json!({ "name": name, "uri": uri_of(&file) }));
            written.push(file);
        }
        if !self.bytes.is_empty() {
            let file = companion(path, "baked.bin");
            write_buffered(&file, |out| out.write_all(&self.bytes))?;
            let buffer = self.push("buffers", &json!({ "byteLength": self.bytes.len(), "uri": uri_of(&file) }));
            self.list_views(buffer, 0);
            written.push(file);
        }
        self.write_lists();
        write_buffered(path, |out| out.write_all(object::raw(&self.root).get().as_bytes()))?;
        written.push(path.to_owned());
        Ok(written)
    }

    /// Has the URIs of buffers and images name the files of the source from the folder of `path`.
    fn move_files(&mut self, path: &Path) -> Result<()> {
        let folder = |path: &Path| {
            let folder = files::folder_of(path);
            std::path::absolute(folder).and_then(|f| f.canonicalize()).map_err(|e| Error::read(folder, &e))
        };
        let (from, to) = (folder(self.source.path())?, folder(path)?);
        if from == to {
            return Ok(());
        }
        let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
        let up = to.components().skip(shared).map(|_| "..".to_owned());
        let down = from.components().skip(shared).map(|c| encode(&c.as_os_str().to_string_lossy()));
        let prefix: Vec<String> = up.chain(down).collect();
        for list in ["buffers", "images"] {
            self.change_each(list, |file| {
                let uri: Option<String> = file.get("uri").and_then(|uri| serde_json::from_str(uri.get()).ok());
                let is_own = |uri: &String| !uri.contains(':') && !uri.starts_with('/');
                if let Some(uri) = uri.filter(is_own) {
                    file.set("uri", &format!("{}/{uri}", prefix.join("/")));
                }
            });
        }
        Ok(())
    }
}

/// A file beside a `.gltf`, named after it.
fn companion(path: &Path, end: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{end}"))
}

/// The files that [`AmendedFile::save`] may write beside a `.gltf` with these textures; none for
/// another extension.
pub fn companions(path: &Path, textures: &[String]) -> Vec<PathBuf> {
    if files::has_extension(path, "glb") {
        return Vec::new();
    }
    let images = textures.iter().map(|name| companion(path, &format!("{name}.png")));
    images.chain([companion(path, "baked.bin")]).collect()
}

/// The name of a file as a URI.
fn uri_of(path: &Path) -> String {
    encode(&path.file_name().unwrap_or_default().to_string_lossy())
}

/// Media type of an image by its first bytes.
fn media_type(bytes: &[u8]) -> &'static str {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => "image/png",
        [0xab, b'K', b'T', b'X', ..] => "image/ktx2",
        [b'R', b'I', b'F', b'F', ..] => "image/webp",
        [b'D', b'D', b'S', b' ', ..] => "image/vnd-ms.dds",
        _ => "image/jpeg",
    }
}
