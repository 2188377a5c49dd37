//! glTF 2.0 writer.

mod hierarchy;
mod rig;

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3};
use serde_json::{Value, json};

use super::{ExportStats, glb, icosphere, material, write_buffered};
use crate::error::{Error, Result};
use crate::scene::animation::VertexData;
use crate::scene::{
    Camera, ClipPlanes, Filter, Geometry, Light, LightKind, Projection, Scene, Sphere, TexelData, Texture,
    TriangleMesh, Wrap,
};

/// Writes `scene` as glTF 2.0: one `.glb` file with everything in it, or a `.gltf` with a `.bin`
/// and PNG files of the same name beside it. The extension of `path` decides. Each file appears
/// only when it is complete, the `.gltf` last.
///
/// Triangles, transforms, the nodes above them, materials (core and KHR_materials extensions),
/// textures, cameras, punctual lights and animations with skins and morph targets survive a round
/// trip through the loader (animated scenes are written in their rest pose). Spheres are
/// tessellated, with a warning, and animations of other values are left out, with another; what
/// glTF cannot express (the environment, render settings, the `.brhan` kind of a material) is left
/// out.
///
/// # Errors
/// [`Error::Output`], also for another extension or more than 4 GiB.
pub fn export_gltf(scene: &Scene, path: &Path) -> Result<ExportStats> {
    let fail = |message: String| Error::Output { path: path.to_owned(), message };
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let embed = match extension.to_str() {
        Some("glb") => true,
        Some("gltf") => false,
        _ => return Err(fail("glTF files end in .glb or .gltf".to_owned())),
    };

    // everything in memory first: sizes come before contents in a .glb
    let mut writer = Writer { embed, ..Writer::default() };
    writer.scene(scene, path).map_err(fail)?;
    let Writer { bin, json, images, written, .. } = writer;
    let text = json.to_string();
    if u32::try_from(bin.len() + text.len() + 64).is_err() {
        return Err(fail("the scene is larger than 4 GiB, the limit of .glb".to_owned()));
    }

    // one file, padded to words
    if embed {
        glb::write(path, text.as_bytes(), &[&bin])?;
        return Ok(written);
    }

    // or a file for each buffer and image
    for (name, png) in &images {
        write_buffered(&path.with_file_name(name), |out| out.write_all(png))?;
    }
    if !bin.is_empty() {
        write_buffered(&path.with_extension("bin"), |out| out.write_all(&bin))?;
    }
    write_buffered(path, |out| out.write_all(text.as_bytes()))?;
    Ok(written)
}

/// Name of the program in the files that it writes.
const GENERATOR: &str = concat!("skylit ", env!("CARGO_PKG_VERSION"));

/// The files that [`export_gltf`] writes beside a `.gltf`; none for another extension.
pub fn companions(scene: &Scene, path: &Path) -> Vec<PathBuf> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf")) {
        return Vec::new();
    }
    let mut pixels: Vec<&TexelData> = Vec::new();
    for texture in &scene.textures {
        if !pixels.iter().any(|p| p.is_shared_with(&texture.texels)) {
            pixels.push(&texture.texels);
        }
    }
    let images = (0..pixels.len()).map(|k| path.with_file_name(image_name(path, k)));
    std::iter::once(path.with_extension("bin")).chain(images).collect()
}

/// Whether a file beside `gltf` belongs to it, and an earlier export has written both.
pub fn is_companion_of(path: &Path, gltf: &Path) -> bool {
    let Ok(text) = crate::files::read_regular(gltf) else { return false };
    let Ok(json) = serde_json::from_slice::<Value>(&text) else { return false };
    let uri = encode(&path.file_name().unwrap_or_default().to_string_lossy());
    let is_own =
        json["asset"]["generator"].as_str().is_some_and(|g| g.split(' ').next() == GENERATOR.split(' ').next());
    let names = |key: &str| json[key].as_array().into_iter().flatten().any(|file| file["uri"].as_str() == Some(&uri));
    is_own && (names("buffers") || names("images"))
}

/// The name of an image beside a `.gltf`.
fn image_name(path: &Path, index: usize) -> String {
    format!("{}_{index}.png", path.file_stem().unwrap_or_default().to_string_lossy())
}

/// JSON arrays.
#[derive(Default)]
struct Textures {
    textures: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
}

#[derive(Default)]
struct Writer {
    embed: bool,
    bin: Vec<u8>,
    json: Value,
    views: Vec<Value>,
    accessors: Vec<Value>,
    /// File name and bytes of each image that is not embedded.
    images: Vec<(String, Vec<u8>)>,
    written: ExportStats,
}

impl Writer {
    fn scene(&mut self, scene: &Scene, path: &Path) -> Result<(), String> {
        let mut used = BTreeSet::new();
        let materials: Vec<Value> = scene.materials.iter().map(|m| material::material(m, &mut used)).collect();
        let Textures { textures, images, samplers } = self.textures(&scene.textures, path)?;

        let meshes = self.meshes(scene);
        let rig = scene.rig.as_ref();

        // nodes, and lights on those that carry them
        let mut tree = rig.map_or_else(|| hierarchy::tree(scene), |rig| rig::tree(scene, rig));
        let mut nodes = std::mem::take(&mut tree.nodes);
        let mut roots = std::mem::take(&mut tree.roots);
        let free = nodes.len();
        let lights = self.lights(scene, &tree, &mut nodes);

        // cameras that no node carries have one of their own
        let diagonal = scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).length());
        let nothing = ClipPlanes { near: 0.01f64.min(1e-4 * diagonal.max(1e-30)), far: 1e6f64.max(1e3 * diagonal) };
        let cameras: Vec<Value> = scene.cameras.iter().map(|c| camera(c, nothing)).collect();
        nodes.extend(scene.cameras.iter().enumerate().filter_map(|(i, c)| {
            if tree.cameras.contains(&i) {
                return None;
            }
            let mut node = node(&c.name, &c.camera_to_world);
            node["camera"] = json!(i);
            Some(node)
        }));
        roots.extend(free..nodes.len());

        let (mut skins, mut animations) = (Vec::new(), Vec::new());
        if let Some(rig) = rig {
            skins.extend(rig.parts().skins.iter().map(|s| self.skin(s)));
            animations.extend(rig.animations().iter().map(|a| self.animation(a, rig, &tree)));
            let values: usize = rig.animations().iter().map(|a| a.values.len()).sum();
            if values > 0 {
                self.written.warnings.push(format!(
                    "{values} animation channels are left out, of materials, lights, cameras and visibility: skylit writes those of transforms and morph targets"
                ));
            }

            // what is hidden at rest stays so
            for (node, written) in rig.parts().nodes.iter().zip(&mut nodes).filter(|(node, _)| node.hidden) {
                used.insert("KHR_node_visibility");
                written["extensions"]["KHR_node_visibility"] = json!({ "visible": !node.hidden });
            }
        }

        let mut json = json!({
            "asset": { "version": "2.0", "generator": GENERATOR },
            "scene": 0,
        });
        let mut put = |key: &str, values: Vec<Value>| {
            // glTF does not allow empty arrays
            if !values.is_empty() {
                json[key] = Value::Array(values);
            }
        };
        if !self.bin.is_empty() {
            let mut buffer = json!({ "byteLength": self.bin.len() });
            if !self.embed {
                let name = path.with_extension("bin");
                buffer["uri"] = json!(encode(&name.file_name().unwrap_or_default().to_string_lossy()));
            }
            put("buffers", vec![buffer]);
        }

        put("bufferViews", std::mem::take(&mut self.views));
        put("accessors", std::mem::take(&mut self.accessors));
        put("images", images);
        put("samplers", samplers);
        put("textures", textures);
        put("materials", materials);
        put("meshes", meshes);
        put("cameras", cameras);
        put("nodes", nodes);
        put("skins", skins);
        put("animations", animations);
        json["scenes"] = if roots.is_empty() { json!([{}]) } else { json!([{ "nodes": roots }]) };
        if !lights.is_empty() {
            used.insert("KHR_lights_punctual");
            json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        }
        if !used.is_empty() {
            json["extensionsUsed"] = json!(used);
        }
        self.json = json;
        Ok(())
    }

    /// All meshes in their undeformed shape, spheres as triangles.
    fn meshes(&mut self, scene: &Scene) -> Vec<Value> {
        // spheres become triangles, fewer for each the more there are
        let spheres = scene.meshes.iter().map(|m| match &m.geometry {
            Geometry::Triangles(_) => 0,
            Geometry::Spheres(s) => s.len() as u64,
        });
        let spheres = spheres.sum::<u64>();
        let level = icosphere::level(spheres).min(4);
        let each = 20u64 << (2 * level);
        self.written.triangles = scene.triangle_count() + scene.sphere_count() * each;
        if spheres > 0 {
            self.written.warnings.push(format!("{spheres} spheres become {each} triangles each: glTF has no spheres"));
        }

        // meshes, in their undeformed shape
        let rig = scene.rig.as_ref();
        let mut meshes = Vec::new();
        for (m, mesh) in scene.meshes.iter().enumerate() {
            let made;
            let deformations = rig.map_or(&[][..], |r| &r.parts().deformations);
            let deformation = deformations.iter().position(|d| d.mesh == m);
            let triangles = match &mesh.geometry {
                Geometry::Triangles(t) => match deformation.and_then(|d| rig?.undeformed(d)) {
                    Some(shape) => {
                        made = undeformed(t, shape);
                        &made
                    }
                    None => t,
                },
                Geometry::Spheres(s) => {
                    made = tessellate(s, level);
                    &made
                }
            };
            let mut out = self.mesh(&mesh.name, triangles, mesh.material);
            if let Some(d) = deformation {
                self.deformation(&deformations[d], triangles.positions.len(), &mut out["primitives"][0]);
            }
            meshes.push(out);
        }
        meshes
    }

    /// The lights that glTF has; each is put on its node, which may be a new one.
    fn lights(&mut self, scene: &Scene, tree: &rig::Tree, nodes: &mut Vec<Value>) -> Vec<Value> {
        let mut lights = Vec::new();
        for (k, light) in scene.lights.iter().enumerate() {
            if matches!(light.kind, LightKind::Directional { angle } if angle > 0.0) {
                let name = &light.name;
                self.written
                    .warnings
                    .push(format!("light '{name}' loses its angular diameter: glTF's directional lights have none"));
            }
            let Some(written) = punctual(light) else {
                let (name, kind) = (&light.name, light.kind.about().name);
                self.written.warnings.push(format!("light '{name}' is left out: glTF has no {kind} lights"));
                continue;
            };
            match tree.lights.get(&k) {
                Some(&carrier) => put_light(&mut nodes[carrier], lights.len()),
                None => nodes.push(light_node(light, lights.len())),
            }
            lights.push(written);
        }
        lights
    }

    /// Appends bytes as a buffer view of their own.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Appends an accessor of `N` floats a vertex.
    fn floats<const N: usize>(&mut self, values: impl Iterator<Item = [f32; N]>, bounds: bool) -> usize {
        self.numbers(values, bounds, Some(34962))
    }

    /// Appends an accessor of `N` floats an element; `target`: what its buffer view is for, if it
    /// is for vertices.
    fn numbers<const N: usize>(
        &mut self,
        values: impl Iterator<Item = [f32; N]>,
        bounds: bool,
        target: Option<u32>,
    ) -> usize {
        let (mut bytes, mut count) = (Vec::new(), 0);
        let (mut min, mut max) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        for value in values {
            count += 1;
            for (k, x) in value.into_iter().enumerate() {
                (min[k], max[k]) = (min[k].min(x), max[k].max(x));
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        }
        let view = self.view(&bytes, target);
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(N - 1).unwrap_or(&"MAT4");
        let mut accessor = json!({ "bufferView": view, "componentType": 5126, "count": count, "type": shape });
        if bounds {
            (accessor["min"], accessor["max"]) = (json!(min.as_slice()), json!(max.as_slice()));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn mesh(&mut self, name: &str, mesh: &TriangleMesh, material: usize) -> Value {
        let mut attributes = json!({ "POSITION": self.floats(mesh.positions.iter().map(|p| p.to_array()), true) });
        if !mesh.normals.is_empty() {
            attributes["NORMAL"] = json!(self.floats(mesh.normals.iter().map(|n| n.to_array()), false));
        }
        // tangents of a file are those of all its textures: where they differ, readers compute them
        if !mesh.tangents.is_empty() && mesh.clearcoat_tangents.is_empty() && mesh.anisotropy_tangents.is_empty() {
            attributes["TANGENT"] = json!(self.floats(mesh.tangents.iter().map(|t| t.to_array()), false));
        }
        for (k, set) in mesh.texcoords.iter().chain(&mesh.more_texcoords).enumerate() {
            if !set.is_empty() {
                attributes[format!("TEXCOORD_{k}")] = json!(self.floats(set.iter().map(|t| t.to_array()), false));
            }
        }
        if !mesh.colors.is_empty() {
            attributes["COLOR_0"] = json!(self.floats(mesh.colors.iter().map(|c| c.to_array()), false));
        }
        let corners = mesh.indices.iter().flatten();
        // 0xffff is the primitive restart value, which glTF forbids
        let small = mesh.positions.len() <= 0xffff;
        let bytes: Vec<u8> = if small {
            corners.flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            corners.flat_map(|i| i.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(34963));
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": if small { 5123 } else { 5125 },
            "count": mesh.indices.len() * 3,
            "type": "SCALAR",
        }));
        let indices = self.accessors.len() - 1;
        json!({ "name": name, "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] })
    }

    /// JSON of textures, images and samplers. Textures that share pixels share the image.
    fn textures(&mut self, all: &[Texture], path: &Path) -> Result<Textures, String> {
        let Textures { mut textures, mut images, mut samplers } = Textures::default();
        let mut pixels: Vec<&TexelData> = Vec::new();
        for texture in all {
            let source = match pixels.iter().position(|p| p.is_shared_with(&texture.texels)) {
                Some(known) => known,
                None => {
                    let png = png(texture)?;
                    let mut image = json!({ "name": texture.name, "mimeType": "image/png" });
                    if self.embed {
                        image["bufferView"] = json!(self.view(&png, None));
                    } else {
                        let name = image_name(path, images.len());
                        image["uri"] = json!(encode(&name));
                        self.images.push((name, png));
                    }
                    images.push(image);
                    pixels.push(&texture.texels);
                    images.len() - 1
                }
            };
            let sampler = sampler(texture);
            let index = samplers.iter().position(|s| *s == sampler).unwrap_or_else(|| {
                samplers.push(sampler);
                samplers.len() - 1
            });
            textures.push(json!({ "name": texture.name, "sampler": index, "source": source }));
        }
        Ok(Textures { textures, images, samplers })
    }
}

fn png(texture: &Texture) -> Result<Vec<u8>, String> {
    use image::ExtendedColorType::{Rgb8, Rgb16, Rgba8, Rgba16};
    fn opaque<T: Copy>(rgba: &[T]) -> Vec<T> {
        rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect()
    }
    let has_alpha = texture.texels.iter().any(|[_, _, _, alpha]| alpha < 1.0);
    let (bytes, color) = match &texture.texels {
        TexelData::Unorm8(rgba) if has_alpha => (rgba.to_vec(), Rgba8),
        TexelData::Unorm8(rgba) => (opaque(rgba), Rgb8),
        TexelData::Unorm16(rgba) if has_alpha => (bytemuck::cast_slice(rgba).to_vec(), Rgba16),
        TexelData::Unorm16(rgba) => (bytemuck::cast_slice(&opaque(rgba)).to_vec(), Rgb16),
        TexelData::Float(_) => {
            return Err(format!(
                "the texture `{}` has floating-point texels, which glTF images cannot store: convert it to PNG",
                texture.name
            ));
        }
    };
    let mut png = Vec::new();
    let format = image::ImageFormat::Png;
    image::write_buffer_with_format(&mut Cursor::new(&mut png), &bytes, texture.width, texture.height, color, format)
        .map_err(|e| format!("the texture `{}` cannot be encoded: {e}", texture.name))?;
    Ok(png)
}

fn sampler(texture: &Texture) -> Value {
    let wrap = |w: Wrap| match w {
        Wrap::Repeat => 10497,
        Wrap::Mirror => 33648,
        Wrap::Clamp => 33071,
    };
    let (mag, min) = match texture.filter {
        Filter::Nearest => (9728, 9728),
        Filter::Linear => (9729, 9987),
    };
    json!({ "magFilter": mag, "minFilter": min, "wrapS": wrap(texture.wrap[0]), "wrapT": wrap(texture.wrap[1]) })
}

/// A copy of a posed mesh with its undeformed vertices.
fn undeformed(posed: &TriangleMesh, shape: &VertexData) -> TriangleMesh {
    let VertexData { positions, normals, tangents: [tangents, clearcoat_tangents, anisotropy_tangents] } =
        shape.clone();
    TriangleMesh { positions, normals, tangents, clearcoat_tangents, anisotropy_tangents, ..posed.clone() }
}

/// Spheres as one smooth mesh.
fn tessellate(spheres: &[Sphere], level: u32) -> TriangleMesh {
    let (points, triangles) = icosphere::icosphere(level);
    let mut mesh = TriangleMesh::default();
    for s in spheres {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(points.iter().map(|&p| s.center + s.radius * p));
        mesh.normals.extend_from_slice(&points);
        mesh.indices.extend(triangles.iter().map(|t| t.map(|i| i + first)));
    }
    mesh
}

fn node(name: &str, to_world: &DAffine3) -> Value {
    let mut node = json!({ "name": name });
    if *to_world != DAffine3::IDENTITY {
        let m = glam::DMat4::from(*to_world).to_cols_array();
        node["matrix"] = json!(m);
    }
    node
}

fn with_mesh(name: &str, mesh: usize, to_world: &DAffine3) -> Value {
    let mut node = node(name, to_world);
    node["mesh"] = json!(mesh);
    node
}

/// `nothing`: planes that clip next to nothing, for cameras without: glTF wants a near plane of
/// perspective ones, and both of orthographic ones.
fn camera(camera: &Camera, nothing: ClipPlanes) -> Value {
    let clip = camera.clip;
    let far = if clip.far.is_finite() { clip.far } else { nothing.far };
    match camera.projection {
        Projection::Perspective { fov_y } => {
            let mut perspective =
                json!({ "yfov": fov_y, "znear": if clip.near > 0.0 { clip.near } else { nothing.near } });
            if clip.far.is_finite() {
                perspective["zfar"] = json!(clip.far);
            }
            if let Some(aspect) = camera.aspect {
                perspective["aspectRatio"] = json!(aspect);
            }
            json!({ "name": camera.name, "type": "perspective", "perspective": perspective })
        }
        Projection::Orthographic { half_height } => {
            let xmag = half_height * camera.aspect.unwrap_or(1.0);
            let orthographic = json!({ "xmag": xmag, "ymag": half_height, "znear": clip.near, "zfar": far });
            json!({ "name": camera.name, "type": "orthographic", "orthographic": orthographic })
        }
    }
}

/// The transform of a node that carries a light.
fn light_place(light: &Light) -> DAffine3 {
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, light.direction.try_normalize().unwrap_or(DVec3::NEG_Z));
    DAffine3::from_rotation_translation(turn, light.position)
}

fn light_node(light: &Light, index: usize) -> Value {
    let mut node = node(&light.name, &light_place(light));
    put_light(&mut node, index);
    node
}

fn put_light(node: &mut Value, index: usize) {
    node["extensions"] = json!({ "KHR_lights_punctual": { "light": index } });
}

/// A light of KHR_lights_punctual; `None` if that has no such type.
fn punctual(light: &Light) -> Option<Value> {
    let kind = light.kind.about().gltf?;
    let (color, intensity) = material::split(light.intensity);
    let mut out = json!({ "name": light.name, "type": kind, "color": color.to_array(), "intensity": intensity });
    if light.range.is_finite() {
        out["range"] = json!(light.range);
    }
    if let LightKind::Spot { inner_angle, outer_angle } = light.kind {
        out["spot"] = json!({ "innerConeAngle": inner_angle, "outerConeAngle": outer_angle });
    }
    Some(out)
}

/// A file name as a URI.
pub(super) fn encode(name: &str) -> String {
    let mut out = String::new();
    for b in name.bytes() {
        match b {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => out.push(char::from(b)),
            _ => out.push_str(&format!("%{b:02X}")),
        }
    }
    out
}
