//! Bad input: one clear line each.

use serde_json::json;
use skylit::Error;

use crate::build::*;

fn message(result: skylit::Result<skylit::scene::Scene>) -> String {
    let error = result.map(|_| ()).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    let text = error.to_string();
    assert!(!text.contains('\n') && text.len() < 500, "{text}");
    text
}

#[test]
fn files_that_are_not_there_or_not_scenes() {
    let folder = Folder::new();
    for name in ["a.gltf", "a.glb", "a.obj", "a.brhan"] {
        let text = message(load(&folder.path(name)));
        assert!(text.contains(name) && text.contains("no such file"), "{text}");
    }
    std::fs::create_dir(folder.path("dir.glb")).unwrap();
    assert!(message(load(&folder.path("dir.glb"))).contains("folder"));
    assert!(message(folder.load("a.fbx", "")).contains(".fbx"));
    assert!(message(folder.load("noext", "")).contains("no extension"));
    assert!(message(skylit::scene::load::load("no-such-scene")).contains("no built-in scene"));
    let error = skylit::scene::load::load("builtin:no-such-scene").map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Usage(_)), "{error}");
}

/// What a clone without Git LFS, a download that failed and a web server put in the place of a file.
#[test]
fn files_that_are_something_else() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0\nsize 12345\n";
    let page = "\n<!DOCTYPE html>\n<html><head>";
    for name in ["a.gltf", "a.glb", "a.obj", "a.brhan"] {
        let folder = Folder::new();
        for (bytes, says) in [
            (pointer.as_bytes(), "is a Git LFS pointer"),
            (b"", "is empty"),
            (page.as_bytes(), "is an HTML page"),
            (b"PK\x03\x04\x14", "is a ZIP archive: unpack it first"),
            (b"\x1f\x8b\x08\0", "is compressed with gzip: unpack it first"),
        ] {
            let text = message(folder.load(name, bytes));
            assert!(text.contains(name) && text.contains(says), "{text}");
        }
    }
    // files that scenes name
    let folder = Folder::new();
    let mut doc = Doc::triangle();
    doc.json["buffers"] = json!([{ "uri": "a.bin", "byteLength": 36 }]);
    folder.write("a.bin", pointer);
    let text = message(folder.load("a.gltf", serde_json::to_vec(&doc.json).unwrap()));
    assert!(text.contains("a.bin is a Git LFS pointer"), "{text}");
    folder.write("a.mtl", page);
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    let text = match folder.load("a.obj", obj) {
        Ok(scene) => scene.report.warnings.join("; "),
        Err(error) => error.to_string(),
    };
    assert!(text.contains("a.mtl") && text.contains("is an HTML page"), "{text}");
    folder.write("a.mtl", "newmtl a\nmap_Kd a.png\n");
    let jpeg = {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let image = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y) as u8, (7 * x) as u8, (y * 3) as u8]));
        image.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    };
    for (bytes, says) in [
        (pointer.as_bytes(), "is a Git LFS pointer"),
        (page.as_bytes(), "is an HTML page"),
        (b"", "is empty"),
        (&jpeg[..jpeg.len() / 2], "ends early"),
    ] {
        folder.write("a.png", bytes);
        let warnings = folder.load("a.obj", obj).unwrap().report.warnings;
        assert!(warnings.iter().any(|w| w.contains("a.png") && w.contains(says)), "{warnings:?}");
    }
}

#[test]
fn truncated_glb() {
    let folder = Folder::new();
    let glb = Doc::triangle().glb();
    for length in 0..glb.len() {
        let text = message(folder.load("cut.glb", &glb[..length]));
        assert!(length < 4 || text.contains("truncated"), "{length}: {text}");
    }
    let mut other = glb.clone();
    other[4] = 1;
    assert!(message(folder.load("v1.glb", &other)).contains("version 1"));
    assert!(message(folder.load("text.glb", "hello")).contains("is not a .glb"));
}

#[test]
fn odd_glb() {
    let folder = Folder::new();
    let glb = Doc::triangle().glb();
    for length in 0..20u32 {
        let mut short = glb.clone();
        short[8..12].copy_from_slice(&length.to_le_bytes());
        assert!(message(folder.load("a.glb", &short)).contains("truncated"), "{length}");
        short[4] = 3;
        assert!(message(folder.load("a.glb", &short)).contains("version 3"), "{length}");
    }
    // what follows the length is not looked at
    let mut long = glb.clone();
    long.extend_from_slice(b"more");
    assert!(folder.load("a.glb", &long).is_ok());
    // chunks of other kinds are skipped: after the binary one, and in its place
    let mut more = glb;
    more.extend_from_slice(b"\x04\0\0\0MORE1234");
    let length = more.len() as u32;
    more[8..12].copy_from_slice(&length.to_le_bytes());
    assert!(folder.load("a.glb", &more).is_ok());
    let mut text = Doc::triangle().gltf();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8], body: &[u8]| [&(body.len() as u32).to_le_bytes(), kind, body].concat();
    let whole = |chunks: Vec<u8>| [b"glTF\x02\0\0\0", &(12 + chunks.len() as u32).to_le_bytes()[..], &chunks].concat();
    assert!(folder.load("a.glb", whole(chunk(b"JSON", &text))).is_ok());
    assert!(folder.load("a.glb", whole([chunk(b"JSON", &text), chunk(b"MORE", b"1234")].concat())).is_ok());
    assert!(message(folder.load("a.glb", whole(chunk(b"MORE", &text)))).contains("first chunk"));
    assert!(message(folder.load("a.glb", whole(chunk(b"BIN\0", &text)))).contains("broken"));
}

/// What the specification allows and the crate `gltf` does not.
#[test]
fn lenient_where_the_specification_is() {
    let mut doc = Doc::triangle();
    doc.push("scenes", json!({ "name": "empty" }));
    doc.push(
        "animations",
        json!({ "samplers": [{ "input": 0, "output": 0 }],
        "channels": [{ "sampler": 0, "target": { "path": "pointer" } }] }),
    );
    doc.json["nodes"][0]["extras"] = json!("text");
    assert!(doc.load().report.warnings[0].contains("animation 0 ``, channel 0: names no node"));
    // an extension that is not known where it is used, and one that is broken
    doc.push("materials", json!({ "name": "m", "extensions": { "EXT_new": { "a": [1] } } }));
    assert!(doc.try_load().is_ok());
    doc.json["materials"][0]["extensions"] = json!({ "KHR_materials_sheen": { "sheenColorFactor": "red" } });
    let text = doc.error();
    assert!(text.contains("material 0") && text.contains("KHR_materials_sheen"), "{text}");
}

#[test]
fn bad_json_and_versions() {
    let folder = Folder::new();
    assert!(message(folder.load("a.gltf", "{ \"asset\": ")).contains("JSON"));
    assert!(message(folder.load("a.gltf", " ")).contains("JSON"));
    assert!(message(folder.load("a.gltf", "[".repeat(100_000))).contains("JSON"));
    let one = r#"{ "asset": { "version": "1.0" }, "meshes": { "a": {} } }"#;
    assert!(message(folder.load("a.gltf", one)).contains("glTF 1.0"));
    let mut doc = Doc::triangle();
    let number = r#"{ "asset": { "version": 1 }, "meshes": { "a": {} } }"#;
    assert!(message(folder.load("a.gltf", number)).contains("is glTF 1; skylit reads glTF 2.0: convert it"));
    // what a name in a file has for a terminal does not reach it
    let escape = r#"{ "asset": { "version": "2.0" }, "\u001b[2J\u000a": 1, "meshes": [{ "primitives": [{ "attributes": { "\u001b[2J": 0, "POSITION": 7 } }] }] }"#;
    assert!(!message(folder.load("a.gltf", escape)).contains(char::is_control));
    doc.json["asset"] = json!({ "version": "2.1" });
    assert!(doc.try_load().is_ok());
    doc.json["asset"]["minVersion"] = json!("2.1");
    assert!(doc.error().contains("2.1"));
    doc.json["asset"] = json!({});
    assert!(doc.error().contains("no version"));
}

#[test]
fn buffers() {
    let folder = Folder::new();
    let mut doc = Doc::triangle();
    doc.json["buffers"] = json!([{ "byteLength": 36, "uri": "gone.bin" }]);
    let text = message(folder.load("a.gltf", doc.gltf()));
    assert!(text.contains("buffer 0") && text.contains("gone.bin") && text.contains("no such file"), "{text}");
    folder.write("gone.bin", [0; 20]);
    let text = message(folder.load("a.gltf", doc.gltf()));
    assert!(text.contains("truncated: 20 bytes of 36"), "{text}");
    doc.json["buffers"] = json!([{ "byteLength": 36 }]);
    assert!(message(folder.load("a.gltf", doc.gltf())).contains("neither"));
    doc.json["buffers"] = json!([{ "byteLength": 36, "uri": "https://example.org/a.bin" }]);
    assert!(message(folder.load("a.gltf", doc.gltf())).contains("download"));
}

#[test]
fn accessors_out_of_range() {
    let cases = [
        (json!({ "count": 4 }), "accessor 0"),
        (json!({ "count": u64::MAX }), "accessor 0"),
        (json!({ "byteOffset": 4 }), "accessor 0"),
        (json!({ "byteOffset": u64::MAX }), "accessor 0"),
        (json!({ "bufferView": 9 }), "buffer view 9"),
        (json!({ "componentType": 5124 }), "component type"),
        (json!({ "type": "VEC2" }), "VEC3 is needed"),
    ];
    for (change, expected) in cases {
        let mut doc = Doc::triangle();
        for (key, value) in change.as_object().unwrap() {
            doc.json["accessors"][0][key] = value.clone();
        }
        let text = doc.error();
        assert!(text.contains(expected) && text.contains("accessor 0"), "{change}: {text}");
    }
    let mut doc = Doc::triangle();
    doc.first()["attributes"]["POSITION"] = json!(5);
    assert!(doc.error().contains("accessor 5 does not exist"));
    let mut doc = Doc::triangle();
    doc.json["bufferViews"][0]["byteLength"] = json!(37);
    assert!(doc.error().contains("buffer view 0 lies outside"), "{}", doc.error());
    doc.json["bufferViews"][0] = json!({ "buffer": 3, "byteLength": 36 });
    assert!(doc.error().contains("buffer 3"), "{}", doc.error());
    doc.json["bufferViews"][0] = json!({ "buffer": 0, "byteLength": 36, "byteStride": 4 });
    assert!(doc.error().contains("stride"), "{}", doc.error());
    // nothing bounds an accessor without data
    let mut doc = Doc::triangle();
    doc.json["accessors"][0] = json!({ "componentType": F32, "type": "VEC3", "count": 4_000_000_000u64 });
    assert!(doc.error().contains("an accessor of 4000000000 elements takes"), "{}", doc.error());
    // attributes of other lengths
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 2]), F32, "VEC3", 2);
    doc.first()["attributes"]["NORMAL"] = json!(normal);
    assert!(doc.error().contains("2 elements for 3 vertices"), "{}", doc.error());
    // indices
    let mut doc = Doc::triangle();
    let indices = doc.accessor(&[0, 1, 3], U8, "SCALAR", 3);
    doc.first()["indices"] = json!(indices);
    assert!(doc.error().contains("vertex 3, but there are only 3"), "{}", doc.error());
    doc.json["accessors"][indices]["componentType"] = json!(I8);
    assert!(doc.error().contains("does not hold indices"), "{}", doc.error());
    let mut doc = Doc::triangle();
    doc.first()["material"] = json!(0);
    assert!(doc.error().contains("material 0"), "{}", doc.error());
}

#[test]
fn nan_and_infinite_positions() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut doc = Doc::new();
        let position = doc.positions(&[TRIANGLE[0], [0.0, bad, 0.0], TRIANGLE[2]]);
        doc.primitive(json!({ "attributes": { "POSITION": position } }));
        let text = doc.error();
        assert!(text.contains("mesh 0 `mesh`: the position of vertex 1 is not finite"), "{text}");
    }
    let mut doc = Doc::triangle();
    doc.json["nodes"][0]["scale"] = json!([1e300, 1, 1]);
    doc.json["nodes"][0]["children"] = json!([1]);
    doc.push("nodes", json!({ "scale": [1e300, 1, 1], "mesh": 0 }));
    assert!(doc.error().contains("not finite"), "{}", doc.error());
    let mut doc = Doc::triangle();
    doc.json["nodes"][0]["translation"] = json!([1e30, 0, 0]);
    assert!(doc.error().contains("scale it down"), "{}", doc.error());
}

#[test]
fn nothing_to_render() {
    let mut doc = Doc::triangle();
    doc.json["meshes"][0]["primitives"] = json!([]);
    let text = doc.error();
    assert!(text.contains("no triangles and no spheres"), "{text}");
    let mut doc = Doc::new();
    let position = doc.positions(&[[0.0; 3]; 3]);
    doc.primitive(json!({ "attributes": { "POSITION": position } }));
    assert!(doc.error().contains("1 degenerate"), "{}", doc.error());
    assert!(matches!(doc.try_load().map(|_| ()).unwrap_err(), Error::Scene(_)));
    let folder = Folder::new();
    assert!(message(folder.load("a.obj", "v 0 0 0\n")).contains("no triangles"));
    assert!(message(folder.load("a.brhan", "# nothing\n")).contains("no triangles"));
}

#[test]
fn extensions() {
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    let scene = doc.load();
    assert!(scene.report.warnings[0].contains("EXT_lights_ies"));
    doc.json["extensionsRequired"] = json!(["EXT_lights_ies"]);
    let text = doc.error();
    assert!(text.contains("EXT_lights_ies") && text.contains("export the file without it"), "{text}");
}

/// An index beyond 32 bits is no index, and not what its lower bits say.
#[test]
fn indices_that_do_not_fit() {
    let folder = Folder::new();
    for (pointer, key) in [
        ("/scene", "scene"),
        ("/scenes/0/nodes/0", "nodes"),
        ("/nodes/0/mesh", "mesh"),
        ("/meshes/0/primitives/0/attributes/POSITION", "an attribute"),
        ("/accessors/0/bufferView", "bufferView"),
        ("/bufferViews/0/buffer", "buffer"),
    ] {
        let mut doc = Doc::triangle();
        doc.json["scene"] = json!(0);
        for index in [1u64 << 32, (1 << 32) + 1, 1 << 63] {
            let place = doc.json.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}"));
            *place = json!(index);
            let text = message(folder.load("a.gltf", serde_json::to_vec(&doc.json).unwrap()));
            assert!(text.contains(key) && text.contains(&format!("is {index}, and no file has so many")), "{text}");
        }
    }
    // numbers that are no indices may be as large as they like, and so may names and what others have left in a file
    let mut doc = Doc::triangle();
    doc.json["extras"] = json!({ "mesh": 1u64 << 40 });
    doc.json["cameras"] =
        json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 1, "zfar": 10_000_000_000u64 } }]);
    doc.json["nodes"][0]["name"] = json!("mesh 4294967296");
    let loaded = folder.load("a.gltf", doc.gltf());
    assert!(loaded.is_ok(), "{}", loaded.err().map(|e| e.to_string()).unwrap_or_default());
    // of other formats
    let obj = |corner: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {corner}\n");
    for corner in ["4294967297", "4294967299", "-4294967295", "18446744073709551617", "3/4294967297"] {
        let text = message(folder.load("a.obj", obj(corner)));
        assert!(text.contains("line 4"), "{text}");
    }
    folder.write("a.mtl", "newmtl a\nillum 4294967300\nKd 1 0 0\n");
    let scene = folder.load("a.obj", "mtllib a.mtl\nusemtl a\n".to_owned() + &obj("3")).unwrap();
    assert!(
        scene.report.warnings.join("; ").contains("no illumination model (0 to 10): ignored"),
        "{:?}",
        scene.report.warnings
    );
}
