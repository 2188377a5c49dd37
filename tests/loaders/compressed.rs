//! Compressed geometry and textures: the same scene as without compression, and a line for what is broken.
//!
//! `scripts/compressed/make.sh` made the files with the encoders that people use; views of small documents are packed here by meshoptimizer's own encoder.

use std::path::Path;

use glam::{DVec2, DVec3, Vec4};
use meshopt::{EncodeExpMode, encode_filter_color, encode_filter_exp, encode_filter_oct, encode_filter_quat};
use meshopt::{encode_index_buffer, encode_index_sequence, encode_vertex_buffer};
use serde_json::{Value, json};
use skylit::Error;
use skylit::scene::{Geometry, Scene};

use crate::build::*;

fn made(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/loaders/compressed").join(format!("{name}.glb"));
    let scene = load(&path).unwrap();
    assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    scene
}

/// A triangle in the world: mean position, normal and texture coordinate of its corners.
type Triangle = (DVec3, DVec3, DVec2);

fn triangles(scene: &Scene) -> Vec<Triangle> {
    let mut all = Vec::new();
    for instance in &scene.instances {
        let Geometry::Triangles(mesh) = &scene.meshes[instance.mesh].geometry else { panic!("spheres") };
        let to_world = instance.object_to_world;
        let to_normal = to_world.matrix3.inverse().transpose();
        for corners in &mesh.indices {
            let corners = corners.map(|i| i as usize);
            let position: DVec3 =
                corners.iter().map(|&i| to_world.transform_point3(mesh.positions[i].as_dvec3())).sum();
            let normal: DVec3 =
                corners.iter().map(|&i| mesh.normals.get(i).map_or(DVec3::ZERO, |n| to_normal * n.as_dvec3())).sum();
            let texcoord: DVec2 =
                corners.iter().map(|&i| mesh.texcoords[0].get(i).map_or(DVec2::ZERO, |t| t.as_dvec2())).sum();
            all.push((position / 3.0, normal.normalize_or_zero(), texcoord / 3.0));
        }
    }
    all
}

/// Every triangle has its own in the other scene, whose mean position, normal and texture coordinate
/// are as near as `within`. Texture coordinates that a texture transform stretches are not compared.
fn same_triangles(name: &str, a: &Scene, b: &Scene, within: [f64; 3]) {
    let (a, b) = (triangles(a), triangles(b));
    assert_eq!(a.len(), b.len(), "{name}");
    let mut is_taken = vec![false; b.len()];
    for (position, normal, texcoord) in &a {
        let fits = |(p, n, t): &Triangle| {
            p.distance(*position) <= within[0] && n.distance(*normal) <= within[1] && t.distance(*texcoord) <= within[2]
        };
        let found = (0..b.len()).find(|&i| !is_taken[i] && fits(&b[i]));
        is_taken[found.unwrap_or_else(|| panic!("{name}: no triangle at {position}, {normal}, {texcoord}"))] = true;
    }
}

#[test]
fn twins_have_the_same_triangles() {
    let plain = made("plain");
    assert_eq!(plain.triangle_count(), 962);
    // lossless, but that the encoder's program takes the matrices of nodes apart
    same_triangles("meshopt", &plain, &made("meshopt"), [1e-5, 1e-5, 0.0]);
    let vertices = |s: &Scene| (0..s.meshes.len()).map(|m| mesh(s, m).positions.clone()).collect::<Vec<_>>();
    assert_eq!(vertices(&plain), vertices(&made("meshopt")));
    let one = |s: &Scene| (s.meshes.len(), s.instances.len(), s.materials.len(), s.textures.len());
    assert_eq!(one(&plain), one(&made("meshopt")));

    // quantized to 14 or 11 bits of a mesh, 8 or 10 of a normal and 12 of texture coordinates, along an axis each
    for (name, texcoords) in
        [("meshopt-filter", f64::MAX), ("gltfpack", f64::MAX), ("draco-edgebreaker", 1e-3), ("draco-sequential", 1e-3)]
    {
        same_triangles(name, &plain, &made(name), [2e-3, 2e-2, texcoords]);
    }
}

#[test]
fn twins_have_the_same_textures() {
    let plain = made("plain");
    // root mean square difference of bytes that two images may have; the encoders' own decoders say the same
    for (name, within) in [("webp", 0.0), ("uastc", 4.0), ("etc1s", 12.0), ("meshopt", 0.0), ("gltfpack", 0.0)] {
        let twin = made(name);
        assert_eq!(plain.textures.len(), twin.textures.len());
        for (a, b) in plain.textures.iter().zip(&twin.textures) {
            assert_eq!((a.width, a.height, a.wrap, a.filter), (b.width, b.height, b.wrap, b.filter), "{name}");
            let (a, b) = (a.texels.as_bytes(), b.texels.as_bytes());
            assert_eq!(a.len(), b.len());
            // encoders leave out the colour of what is transparent
            let texels = a.chunks(4).zip(b.chunks(4)).map(|(a, b)| if a[3] == 0 { (&a[3..], &b[3..]) } else { (a, b) });
            let square =
                |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum::<f64>();
            let rms = (texels.map(square).sum::<f64>() / a.len() as f64).sqrt();
            assert!(rms <= within, "{name}: {rms}");
        }
    }
}

/// What a compressed view says of itself.
fn compressed(count: usize, stride: usize, mode: &str, filter: Option<&str>) -> Value {
    let mut value = json!({ "count": count, "byteStride": stride, "mode": mode });
    if let Some(filter) = filter {
        value["filter"] = json!(filter);
    }
    value
}

/// Adds a compressed view, whose own buffer has no bytes.
fn add_view(doc: &mut Doc, name: &str, encoded: &[u8], mut content: Value) -> usize {
    doc.bin.resize(doc.bin.len().next_multiple_of(4), 0);
    content["buffer"] = json!(0);
    content["byteOffset"] = json!(doc.bin.len());
    content["byteLength"] = json!(encoded.len());
    doc.bin.extend_from_slice(encoded);
    let size = content["count"].as_u64().unwrap() * content["byteStride"].as_u64().unwrap();
    doc.push("bufferViews", json!({ "buffer": 1, "byteLength": size, "extensions": { name: content } }))
}

/// The document with its buffers: the second one stands for what is decoded.
fn finish(mut doc: Doc, name: &str) -> Doc {
    let data = format!("data:application/octet-stream;base64,{}", base64(&doc.bin));
    doc.json["buffers"] = json!([
        { "byteLength": doc.bin.len(), "uri": data },
        { "byteLength": 1 << 20, "extensions": { name: { "fallback": true } } },
    ]);
    doc.json["extensionsUsed"] = json!([name, "KHR_mesh_quantization"]);
    doc.json["extensionsRequired"] = json!([name]);
    doc
}

const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Four corners of a square.
const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.25]];

/// A square of two triangles, whose vertices are packed.
fn square(name: &str) -> Doc {
    let mut doc = Doc::new();
    let view = add_view(&mut doc, name, &encode_vertex_buffer(&SQUARE).unwrap(), compressed(4, 12, "ATTRIBUTES", None));
    let position =
        doc.push("accessors", json!({ "bufferView": view, "componentType": F32, "type": "VEC3", "count": 4 }));
    doc.primitive(json!({ "attributes": { "POSITION": position } }));
    doc
}

/// Gives the square indices, of 2 or 4 bytes.
fn add_indices(doc: &mut Doc, name: &str, encoded: &[u8], count: usize, stride: usize, mode: &str) {
    let view = add_view(doc, name, encoded, compressed(count, stride, mode, None));
    let component = if stride == 2 { U16 } else { U32 };
    let indices = doc
        .push("accessors", json!({ "bufferView": view, "componentType": component, "type": "SCALAR", "count": count }));
    doc.first()["indices"] = json!(indices);
}

#[test]
fn views_of_all_modes() {
    let list = [0, 1, 2, 2, 3, 0];
    for name in NAMES {
        for stride in [2, 4] {
            let mut doc = square(name);
            add_indices(&mut doc, name, &encode_index_buffer(&list, 4).unwrap(), 6, stride, "TRIANGLES");
            let scene = finish(doc, name).load();
            assert_eq!(mesh(&scene, 0).positions.iter().map(|p| p.to_array()).collect::<Vec<_>>(), SQUARE);
            // the encoder may turn a triangle, and keeps its orientation
            let turned = |t: &[u32; 3]| (0..3).map(|k| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]).min().unwrap();
            assert_eq!(mesh(&scene, 0).indices.iter().map(turned).collect::<Vec<_>>(), [[0, 1, 2], [0, 2, 3]]);

            // a sequence keeps all corners in their order
            let mut doc = square(name);
            add_indices(&mut doc, name, &encode_index_sequence(&[0, 1, 3, 2], 4).unwrap(), 4, stride, "INDICES");
            doc.first()["mode"] = json!(5);
            let scene = finish(doc, name).load();
            assert_eq!(mesh(&scene, 0).indices, [[0, 1, 3], [1, 2, 3]]);
        }
    }
}

#[test]
fn views_of_all_filters() {
    let normals = [[0.6f32, 0.0, 0.8, 0.0], [0.0, 0.6, 0.8, 0.0], [-0.6, 0.0, 0.8, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let colors = [[1.0f32, 0.5, 0.25, 1.0], [0.0, 1.0, 0.0, 0.5], [0.2, 0.3, 0.9, 1.0], [1.0, 1.0, 1.0, 1.0]];
    let texcoords = [[0.125f32, 0.5], [0.75, -3.0], [1024.0, 0.0], [1.0, 1.0]];
    for name in NAMES {
        let mut doc = square(name);
        let mut add = |attribute: &str, encoded: &[u8], stride: usize, filter: &str, component: u32, shape: &str| {
            let view = add_view(&mut doc, name, encoded, compressed(4, stride, "ATTRIBUTES", Some(filter)));
            doc.json["bufferViews"][view]["byteStride"] = json!(stride);
            let normalized = component != F32;
            let accessor = json!({ "bufferView": view, "componentType": component, "type": shape, "count": 4, "normalized": normalized });
            let accessor = doc.push("accessors", accessor);
            doc.first()["attributes"][attribute] = json!(accessor);
        };
        let oct = encode_vertex_buffer(&encode_filter_oct::<i16>(&normals, 16)).unwrap();
        add("NORMAL", &oct, 8, "OCTAHEDRAL", I16, "VEC3");
        let floats: Vec<f32> = texcoords.iter().flatten().copied().collect();
        let exp = encode_filter_exp::<2>(bytemuck::cast_slice(&floats), 23, EncodeExpMode::Separate);
        add("TEXCOORD_0", &encode_vertex_buffer(&exp).unwrap(), 8, "EXPONENTIAL", F32, "VEC2");
        let color = encode_vertex_buffer(&encode_filter_color::<u8>(&colors, 8)).unwrap();
        add("COLOR_0", &color, 4, "COLOR", U8, "VEC4");
        let scene = finish(doc, name).load();

        let mesh = mesh(&scene, 0);
        for k in 0..4 {
            assert!(mesh.normals[k].distance(Vec4::from(normals[k]).truncate()) < 1e-4, "{}", mesh.normals[k]);
            assert_eq!(mesh.texcoords[0][k].to_array(), texcoords[k]);
            assert!(mesh.colors[k].distance(Vec4::from(colors[k])) < 0.02, "{} {:?}", mesh.colors[k], colors[k]);
        }
    }
}

/// Rotations of an animation: an element of four numbers of 16 bits.
#[test]
fn animations_are_unpacked() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let quaternions = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]];
    let name = NAMES[0];
    let mut doc = square(name);
    let times = doc.accessor(&bytes(&[[0.0], [1.0]]), F32, "SCALAR", 2);
    let encoded = encode_vertex_buffer(&encode_filter_quat(&quaternions, 16)).unwrap();
    let view = add_view(&mut doc, name, &encoded, compressed(2, 8, "ATTRIBUTES", Some("QUATERNION")));
    let output = json!({ "bufferView": view, "componentType": I16, "type": "VEC4", "count": 2, "normalized": true });
    let output = doc.push("accessors", output);
    let sampler = json!({ "input": times, "output": output });
    let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "rotation" } });
    doc.push("animations", json!({ "samplers": [sampler], "channels": [channel] }));
    let scene = finish(doc, name).load();
    let rig = scene.rig.as_ref().unwrap();
    assert_eq!(rig.animations().len(), 1);
    assert!(scene.report.warnings.iter().all(|w| !w.contains("animation")), "{:?}", scene.report.warnings);
}

/// A buffer whose bytes are never needed is not read, and its file may be missing.
#[test]
fn fallbacks_are_not_read() {
    let mut doc = finish(square(NAMES[0]), NAMES[0]);
    doc.json["buffers"][1]["uri"] = json!("gone.bin");
    assert_eq!(doc.load().triangle_count(), 1);
}

#[test]
fn broken_views_are_told() {
    let says = |change: &dyn Fn(&mut Value, &mut Doc), text: &str| {
        let mut doc = finish(square(NAMES[0]), NAMES[0]);
        let mut extension = doc.json["bufferViews"][0]["extensions"][NAMES[0]].clone();
        change(&mut extension, &mut doc);
        doc.json["bufferViews"][0]["extensions"][NAMES[0]] = extension;
        let error = doc.error();
        assert!(error.contains("buffer view 0") && error.contains(text), "{text}: {error}");
    };
    says(&|e, _| e["mode"] = json!("STRIPS"), "is not valid");
    says(&|e, _| e["buffer"] = json!(7), "buffer 7, which does not exist");
    says(&|e, _| e["byteLength"] = json!(9999), "outside of its buffer");
    says(&|e, _| e["byteOffset"] = json!(u64::MAX), "outside of its buffer");
    says(&|e, _| e["byteLength"] = json!(10), "broken data");
    says(
        &|e, d| (e["byteStride"], d.json["bufferViews"][0]["byteLength"]) = (json!(6), json!(24)),
        "a stride of 6 bytes",
    );
    says(&|e, _| e["byteStride"] = json!(260), "a stride of 260 bytes");
    says(
        &|e, d| (e["byteStride"], d.json["bufferViews"][0]["byteLength"]) = (json!(0), json!(0)),
        "a stride of 0 bytes",
    );
    says(&|e, _| e["count"] = json!(3), "36 bytes where 48 are declared");
    says(&|e, _| e["filter"] = json!("OCTAHEDRAL"), "does not fit its stride");
    says(&|e, _| (e["mode"], e["filter"]) = (json!("TRIANGLES"), json!("EXPONENTIAL")), "not an attribute");
    says(&|e, _| (e["mode"], e["count"]) = (json!("TRIANGLES"), json!(4)), "no multiple of three");
    says(&|e, _| e["mode"] = json!("INDICES"), "neither 2 nor 4");

    // more than a file of this size can mean
    let mut doc = finish(square(NAMES[0]), NAMES[0]);
    doc.json["bufferViews"][0]["extensions"][NAMES[0]]["count"] = json!(1u64 << 40);
    assert!(matches!(doc.try_load().map(|_| ()), Err(Error::OutOfMemory(_))));
}

/// The bytes of a made file, with one thing changed after the other: a line or a scene, never a panic.
#[test]
fn damaged_files_are_told() {
    let folder = Folder::new();
    for name in ["draco-edgebreaker", "draco-sequential", "meshopt-filter", "etc1s", "uastc"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/loaders/compressed").join(format!("{name}.glb"));
        let whole = std::fs::read(path).unwrap();
        // after the JSON
        let start = 20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize + 8;
        let mut told = 0;
        for k in 0..64 {
            let mut damaged = whole.clone();
            let at = start + (k * 7919) % (whole.len() - start);
            damaged[at] ^= 1 << (k % 8);
            damaged[start + (k * 104_729) % (whole.len() - start)] = 0xff;
            told += usize::from(folder.load("damaged.glb", damaged).is_err());
        }
        assert!(told < 64, "{name}: not one is a scene");
    }
}

#[test]
fn broken_streams_are_told() {
    let mut doc = Doc::triangle();
    let view = doc.view(b"DRACO\x02\x02\x01\x01\x00\x00no mesh", None);
    doc.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    doc.first()["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": view, "attributes": { "POSITION": 0 } } });
    let text = doc.error();
    assert!(text.contains("KHR_draco_mesh_compression") && text.contains("cannot be decoded"), "{text}");
    doc.first()["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": 9, "attributes": { "POSITION": 0 } } });
    assert!(doc.error().contains("buffer view 9 does not exist"), "{}", doc.error());
    doc.first()["extensions"] = json!({ "KHR_draco_mesh_compression": { "attributes": [] } });
    assert!(doc.error().contains("is not valid"), "{}", doc.error());
}

/// Plain numbers and blocks in KTX2, as Vulkan numbers their formats.
#[test]
fn ktx2_of_all_kinds() {
    let red_block = [0x00, 0xf8, 0x00, 0xf8, 0, 0, 0, 0];
    let half = |x: u16| x.to_le_bytes();
    let cases: [(u32, usize, Vec<u8>, [f32; 4]); 8] = [
        (9, 1, vec![51], [0.2, 0.0, 0.0, 1.0]),
        (23, 1, vec![255, 51, 0], [1.0, 0.2, 0.0, 1.0]),
        (37, 1, vec![255, 51, 0, 102], [1.0, 0.2, 0.0, 0.4]),
        (44, 1, vec![255, 51, 0, 102], [0.0, 0.2, 1.0, 0.4]),
        (
            91,
            2,
            [0xffffu16, 0, 0x8000, 0xffff].into_iter().flat_map(half).collect(),
            [1.0, 0.0, 32768.0 / 65535.0, 1.0],
        ),
        (97, 2, [0x3c00u16, 0x4000, 0xbc00, 0x7c00].into_iter().flat_map(half).collect(), [1.0, 2.0, 0.0, 0.0]),
        (109, 4, [1.5f32, 0.5, f32::NAN, 1.0].into_iter().flat_map(f32::to_le_bytes).collect(), [1.5, 0.5, 0.0, 1.0]),
        (131, 1, red_block.to_vec(), [1.0, 0.0, 0.0, 1.0]),
    ];
    for (format, type_size, data, expected) in cases {
        let scene = with_texture(&ktx2(format, type_size, [1, 1], &data)).load();
        assert_eq!(scene.textures.len(), 1, "format {format}: {:?}", scene.report.warnings);
        let texel = scene.textures[0].texels.get(0);
        assert!(texel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3), "format {format}: {texel:?}");
    }
    // an edge that cuts blocks
    let blocks = [red_block; 4].concat();
    let scene = with_texture(&ktx2(131, 1, [5, 6], &blocks)).load();
    assert_eq!((scene.textures[0].width, scene.textures[0].height, scene.textures[0].texels.len()), (5, 6, 30));

    // what is wrong leaves the texture out, with a line
    for (file, text) in [
        (ktx2(131, 1, [5, 6], &blocks[..8]), "ends early"),
        (ktx2(37, 1, [2, 2], &[0; 4]), "another number of texels"),
        (ktx2(1_000_054_000, 1, [4, 4], &[0; 64]), "does not read"),
        (ktx2(37, 1, [40_000, 1], &[0; 4]), "40000x1 pixels"),
        (ktx2(37, 1, [1, 1], &[0; 4])[..90].to_vec(), "cannot be decoded"),
    ] {
        let scene = with_texture(&file).load();
        assert!(scene.textures.is_empty() && scene.report.warnings[0].contains(text), "{:?}", scene.report.warnings);
    }
}

/// A triangle that shows an image by `KHR_texture_basisu`.
fn with_texture(file: &[u8]) -> Doc {
    let mut doc = Doc::triangle();
    let uri = format!("data:image/ktx2;base64,{}", base64(file));
    doc.push("images", json!({ "uri": uri }));
    doc.push("textures", json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } }));
    let material = doc.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
    doc.first()["material"] = json!(material);
    doc
}

/// A KTX2 file with one level and the shortest description of its data.
fn ktx2(format: u32, type_size: usize, [width, height]: [u32; 2], data: &[u8]) -> Vec<u8> {
    let mut file = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let mut put = |words: &[u32]| file.extend(words.iter().flat_map(|w| w.to_le_bytes()));
    put(&[format, type_size as u32, width, height, 0, 0, 1, 1, 0]);
    // descriptor of 4 + 24 bytes after the table of levels; no keys, no global data
    let (descriptor, level) = (104, 132);
    put(&[descriptor, 28, 0, 0, 0, 0, 0, 0]);
    put(&[level, 0, data.len() as u32, 0, data.len() as u32, 0]);
    put(&[28, 0, 2 | 24 << 16, 1, 0, 0, 0]);
    file.extend_from_slice(data);
    file
}
