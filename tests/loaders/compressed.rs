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
fn ktx2(format: u32, type_size: usize, size: [u32; 2], data: &[u8]) -> Vec<u8> {
    ktx2_of_levels(format, type_size, size, &[data])
}

/// The same with several levels, the largest first; files have it last.
fn ktx2_of_levels(format: u32, type_size: usize, [width, height]: [u32; 2], levels: &[&[u8]]) -> Vec<u8> {
    let mut file = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let mut put = |words: &[u32]| file.extend(words.iter().flat_map(|w| w.to_le_bytes()));
    put(&[format, type_size as u32, width, height, 0, 0, 1, levels.len() as u32, 0]);
    // descriptor of 4 + 24 bytes after the table of levels; no keys, no global data
    let descriptor = 80 + 24 * levels.len() as u32;
    put(&[descriptor, 28, 0, 0, 0, 0, 0, 0]);
    for (k, level) in levels.iter().enumerate() {
        let before: usize = levels[k + 1..].iter().map(|l| l.len()).sum();
        put(&[descriptor + 28 + before as u32, 0, level.len() as u32, 0, level.len() as u32, 0]);
    }
    put(&[28, 0, 2 | 24 << 16, 1, 0, 0, 0]);
    levels.iter().rev().for_each(|level| file.extend_from_slice(level));
    file
}

/// Stored levels are skipped: the texture is that of the largest one.
#[test]
fn ktx2_with_levels() {
    let largest: Vec<u8> = (0..4 * 4 * 2).map(|k| 8 * k as u8).collect();
    let with = with_texture(&ktx2_of_levels(37, 1, [4, 2], &[&largest, &[255; 8], &[254; 4]])).load();
    let without = with_texture(&ktx2(37, 1, [4, 2], &largest)).load();
    for scene in [&with, &without] {
        let [texture] = &scene.textures[..] else { panic!("{:?}", scene.report.warnings) };
        assert_eq!((texture.width, texture.height, texture.texels.as_bytes()), (4, 2, &largest[..]));
    }
}

/// A DDS file: flags of its pixel format, its four letters or number, bits a pixel and masks, and what follows the header.
fn dds(size: [u32; 2], flags: u32, code: [u8; 4], bits: u32, masks: [u32; 4], rest: &[u8]) -> Vec<u8> {
    let mut words = [0u32; 31];
    (words[0], words[1], words[2], words[3]) = (124, 0x1007, size[1], size[0]);
    (words[18], words[19], words[20], words[21]) = (32, flags, u32::from_le_bytes(code), bits);
    words[22..26].copy_from_slice(&masks);
    words[26] = 0x1000;
    let mut file = b"DDS ".to_vec();
    file.extend(words.iter().flat_map(|w| w.to_le_bytes()));
    file.extend_from_slice(rest);
    file
}

/// One of Direct3D 9, by letters or number.
fn dds_9(size: [u32; 2], code: [u8; 4], data: &[u8]) -> Vec<u8> {
    dds(size, 0x4, code, 0, [0; 4], data)
}

/// One of Direct3D 10: format, dimension, kind, layers.
fn dds_10(size: [u32; 2], [format, dimension, kind, layers]: [u32; 4], data: &[u8]) -> Vec<u8> {
    let rest: Vec<u8> = [format, dimension, kind, layers, 0].iter().flat_map(|w| w.to_le_bytes()).collect();
    dds_9(size, *b"DX10", &[rest.as_slice(), data].concat())
}

/// A triangle that shows an image by `MSFT_texture_dds`; what its file is besides is not told.
fn with_dds(file: &[u8]) -> Doc {
    let mut doc = with_texture(file);
    doc.json["textures"][0] = json!({ "extensions": { "MSFT_texture_dds": { "source": 0 } } });
    doc.json["images"][0]["uri"] = json!(format!("data:image/vnd-ms.dds;base64,{}", base64(file)));
    doc.json["images"][0]["mimeType"] = json!("image/vnd-ms.dds");
    doc.json["extensionsUsed"] = json!(["MSFT_texture_dds"]);
    doc.json["extensionsRequired"] = json!(["MSFT_texture_dds"]);
    doc
}

/// Blocks and plain numbers in DDS: all four corners of a block are its first pixel.
#[test]
fn dds_of_all_kinds() {
    let red = [0x00, 0xf8, 0x00, 0xf8, 0, 0, 0, 0];
    let halves = |x: [u16; 4]| x.into_iter().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let singles = |x: [f32; 4]| x.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    // alpha or one channel: two ends that are the same
    let ends = |value: u8| [value, value, 0, 0, 0, 0, 0, 0];
    // mode 6 of BC7: seven bits of each end and a last one that they share, all indices 0
    let bc7 = {
        let mut bits: u128 = 1 << 6;
        for (k, value) in [100u128, 100, 50, 50, 25, 25, 127, 127].into_iter().enumerate() {
            bits |= value << (7 + 7 * k);
        }
        (bits | 0b11 << 63).to_le_bytes()
    };
    // mode 11 of BC6H: 10 bits of each end, all indices 0
    let bc6h = {
        let mut bits: u128 = 0b00011;
        for (k, value) in [0x1e0u128, 0x0f0, 0].into_iter().enumerate() {
            bits |= value << (5 + 10 * k) | value << (35 + 10 * k);
        }
        bits.to_le_bytes()
    };
    // as the format unquantizes and finishes it
    let of_bc6h = |value: u32| {
        let half = ((value << 16) + 0x8000) >> 10;
        let half = (half * 31) >> 6;
        let (exponent, mantissa) = (half >> 10, half & 0x3ff);
        (1.0 + mantissa as f32 / 1024.0) * 2f32.powi(exponent as i32 - 15)
    };
    let byte = |x: u32| x as f32 / 255.0;
    // two channels are a normal map, whose third follows
    let third = |x: f32, y: f32| 0.5 + 0.5 * (1.0 - (2.0 * x - 1.0).powi(2) - (2.0 * y - 1.0).powi(2)).sqrt();
    let cases: Vec<(&str, Vec<u8>, [f32; 4])> = vec![
        ("BC1", dds_9([4, 4], *b"DXT1", &red), [1.0, 0.0, 0.0, 1.0]),
        ("BC2", dds_9([4, 4], *b"DXT3", &[[0x33; 8], red].concat()), [1.0, 0.0, 0.0, 0.2]),
        ("BC3", dds_9([4, 4], *b"DXT5", &[ends(51), red].concat()), [1.0, 0.0, 0.0, 0.2]),
        ("BC4", dds_9([4, 4], *b"ATI1", &ends(51)), [0.2, 0.0, 0.0, 1.0]),
        ("BC5", dds_9([4, 4], *b"BC5U", &[ends(153), ends(102)].concat()), [0.6, 0.4, third(0.6, 0.4), 1.0]),
        ("BC1 of DXGI", dds_10([4, 4], [72, 3, 0, 1], &red), [1.0, 0.0, 0.0, 1.0]),
        ("BC6H", dds_10([4, 4], [95, 3, 0, 1], &bc6h), [of_bc6h(0x1e0), of_bc6h(0x0f0), 0.0, 1.0]),
        ("BC7", dds_10([4, 4], [98, 3, 0, 1], &bc7), [byte(201), byte(101), byte(51), 1.0]),
        ("RGBA8", dds_10([1, 1], [29, 3, 0, 1], &[255, 51, 0, 102]), [1.0, 0.2, 0.0, 0.4]),
        ("BGRA8", dds_10([1, 1], [87, 3, 0, 1], &[0, 51, 255, 102]), [1.0, 0.2, 0.0, 0.4]),
        ("BGRX8", dds_10([1, 1], [88, 3, 0, 1], &[0, 51, 255, 102]), [1.0, 0.2, 0.0, 1.0]),
        ("RGBA16", dds_10([1, 1], [11, 3, 0, 1], &halves([0xffff, 0x3333, 0, 0x6666])), [1.0, 0.2, 0.0, 0.4]),
        ("RGBA16F", dds_9([1, 1], 113u32.to_le_bytes(), &halves([0x3c00, 0x4000, 0, 0x3800])), [1.0, 2.0, 0.0, 0.5]),
        ("RGBA32F", dds_10([1, 1], [2, 3, 0, 1], &singles([1.5, 0.5, f32::NAN, 1.0])), [1.5, 0.5, 0.0, 1.0]),
        (
            "A8R8G8B8",
            dds([1, 1], 0x41, [0; 4], 32, [0xff_0000, 0xff00, 0xff, 0xff00_0000], &[0, 51, 255, 102]),
            [1.0, 0.2, 0.0, 0.4],
        ),
        ("R8G8B8", dds([1, 1], 0x40, [0; 4], 24, [0xff_0000, 0xff00, 0xff, 0], &[0, 51, 255]), [1.0, 0.2, 0.0, 1.0]),
        ("R5G6B5", dds([1, 1], 0x40, [0; 4], 16, [0xf800, 0x7e0, 0x1f, 0], &[0x00, 0xf8]), [1.0, 0.0, 0.0, 1.0]),
        ("A1R5G5B5", dds([1, 1], 0x41, [0; 4], 16, [0x7c00, 0x3e0, 0x1f, 0x8000], &[0x1f, 0]), [0.0, 0.0, 1.0, 0.0]),
        ("L8", dds([1, 1], 0x2_0000, [0; 4], 8, [0xff, 0, 0, 0], &[51]), [0.2, 0.2, 0.2, 1.0]),
        ("A8L8", dds([1, 1], 0x2_0001, [0; 4], 16, [0xff, 0, 0, 0xff00], &[51, 102]), [0.2, 0.2, 0.2, 0.4]),
        ("A8", dds([1, 1], 0x2, [0; 4], 8, [0, 0, 0, 0xff], &[102]), [0.0, 0.0, 0.0, 0.4]),
    ];
    for (name, file, expected) in &cases {
        let scene = with_dds(file).load();
        let [texture] = &scene.textures[..] else { panic!("{name}: {:?}", scene.report.warnings) };
        let count = texture.texels.len();
        assert_eq!(count, (texture.width * texture.height) as usize, "{name}");
        for texel in [texture.texels.get(0), texture.texels.get(count - 1)] {
            assert!(
                texel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 3e-3),
                "{name}: {texel:?}, not {expected:?}"
            );
        }
    }

    // an edge that cuts blocks, and levels that follow the largest one
    let scene = with_dds(&dds_9([5, 6], *b"DXT1", &[red; 9].concat())).load();
    assert_eq!((scene.textures[0].width, scene.textures[0].height, scene.textures[0].texels.len()), (5, 6, 30));
    // without the extension, as some write it, and as a map of an .obj
    let mut plain = with_dds(&cases[0].1);
    plain.json["textures"][0] = json!({ "source": 0 });
    plain.json.as_object_mut().unwrap().retain(|key, _| !key.starts_with("extensions"));
    assert_eq!(plain.load().textures.len(), 1);
    let folder = Folder::new();
    folder.write("t.dds", &cases[0].1);
    folder.write("a.mtl", "newmtl m\nKd 1 1 1\nmap_Kd t.dds\n");
    let scene =
        folder.load("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n").unwrap();
    assert_eq!(scene.textures[0].texels.get(5), [1.0, 0.0, 0.0, 1.0]);
}

/// What is wrong with a DDS file, or is no image, leaves the texture out, with a line.
#[test]
fn dds_that_are_refused() {
    let red = [0x00, 0xf8, 0x00, 0xf8, 0, 0, 0, 0];
    let marked = |at: usize, flags: u32| {
        let mut file = dds_9([4, 4], *b"DXT1", &red);
        file[at..at + 4].copy_from_slice(&flags.to_le_bytes());
        file
    };
    for (file, text) in [
        (dds_9([5, 6], *b"DXT1", &red), "ends early"),
        (dds_9([16384, 16384], *b"DXT5", &red), "ends early"),
        (dds_9([4, 4], *b"DXT1", &red)[..100].to_vec(), "ends early"),
        (dds_9([4, 4], *b"DXT1", &red)[..120].to_vec(), "ends early"),
        (dds_10([1, 1], [29, 3, 0, 1], &[])[..140].to_vec(), "ends early"),
        (dds_9([40_000, 1], *b"DXT1", &red), "40000x1 pixels"),
        (dds_9([0, 4], *b"DXT1", &red), "0x4 pixels"),
        (marked(4, 100), "4x4 pixels"),
        (marked(112, 0xfe00), "cube map"),
        (marked(112, 0x20_0000), "volume"),
        (dds_10([4, 4], [98, 3, 4, 1], &[0; 96]), "cube map"),
        (dds_10([4, 4], [98, 3, 0, 2], &[0; 32]), "array"),
        (dds_10([4, 4], [98, 4, 0, 1], &[0; 32]), "volume"),
        (dds_10([4, 4], [84, 3, 0, 1], &[0; 16]), "number 84 of DXGI"),
        (dds_9([4, 4], *b"DXT2", &[0; 16]), "(DXT2)"),
        (dds_9([4, 4], 63u32.to_le_bytes(), &[0; 64]), "number 63 of Direct3D 9"),
        (dds([4, 4], 0x20, [0; 4], 8, [0; 4], &[0; 2000]), "flags 0x20"),
        (dds([4, 4], 0x40, [0; 4], 12, [0xf00, 0xf0, 0xf, 0], &[0; 64]), "12 bits"),
    ] {
        let scene = with_dds(&file).load();
        let warnings = &scene.report.warnings;
        assert!(scene.textures.is_empty() && warnings.len() == 1 && warnings[0].contains(text), "{text}: {warnings:?}");
    }
}

/// AVIF is not read: a file that requires it is refused by name, and one that has another image besides shows that one.
#[test]
fn avif_is_left_to_the_image_beside_it() {
    let mut doc = with_texture(&png(2, 2, [51, 102, 153, 255]));
    doc.json["images"][0]["uri"] = json!(format!("data:image/png;base64,{}", base64(&png(2, 2, [51, 102, 153, 255]))));
    let avif = doc.push("images", json!({ "uri": "t.avif", "mimeType": "image/avif" }));
    doc.json["textures"][0] = json!({ "source": 0, "extensions": { "EXT_texture_avif": { "source": avif } } });
    doc.json["extensionsUsed"] = json!(["EXT_texture_avif"]);
    let scene = doc.load();
    assert_eq!(scene.textures[0].texels.as_bytes()[..4], [51, 102, 153, 255]);
    assert_eq!(scene.report.warnings[0], "the extension EXT_texture_avif is ignored");
    doc.json["extensionsRequired"] = json!(["EXT_texture_avif"]);
    assert!(doc.error().contains("requires the extension EXT_texture_avif"), "{}", doc.error());
}
