//! Small files that ask for much memory are refused before it is taken: what a file holds and what it says are two things.

use std::sync::Arc;

use serde_json::json;
use skylit::Error;
use skylit::memory::Budget;
use skylit::scene::TexelData;

use crate::build::*;

/// Loading fails for lack of memory, and says this.
fn is_too_much(doc: &Doc, says: &str) {
    match doc.try_load().map(|_| ()) {
        Err(Error::OutOfMemory(text)) => assert!(text.contains(says) && text.contains("--memory-limit"), "{text}"),
        other => panic!("{says}: {other:?}"),
    }
}

/// An image of one colour and one bit a pixel, which takes a few bytes for thousands of pixels.
fn bomb(side: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; (side / 8 * side) as usize]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// A triangle whose materials show as many images, of which `uri` is the address.
fn with_images(count: usize, uri: impl Fn(usize) -> String) -> Doc {
    let mut doc = Doc::triangle();
    for k in 0..count {
        doc.push("images", json!({ "uri": uri(k) }));
        doc.push("textures", json!({ "source": k }));
        doc.push("materials", json!({ "emissiveTexture": { "index": k } }));
        let mut primitive = doc.first().clone();
        primitive["material"] = json!(k);
        doc.primitive(primitive);
    }
    doc
}

#[test]
fn accessors_without_data() {
    let of = |count: u64, primitives: usize| {
        let mut doc = Doc::triangle();
        let zeros = doc.push("accessors", json!({ "componentType": F32, "type": "VEC3", "count": count }));
        for _ in 0..primitives {
            doc.primitive(json!({ "attributes": { "POSITION": zeros } }));
        }
        doc
    };
    assert!(of(100_000, 5).try_load().is_ok(), "the specification allows them");
    is_too_much(&of(60_000_000, 2), "an accessor of 60000000 elements");
    // one alone, beyond everything
    for count in [1_u64 << 31, 1 << 62] {
        is_too_much(&of(count, 1), "elements");
        let mut doc = Doc::triangle();
        let zeros = doc.push("accessors", json!({ "componentType": U32, "type": "SCALAR", "count": count }));
        doc.first()["indices"] = json!(zeros);
        is_too_much(&doc, "elements");
    }
}

#[test]
fn morph_targets_of_zeros_take_nothing() {
    let mut doc = Doc::new();
    let zeros = doc.push("accessors", json!({ "componentType": F32, "type": "VEC3", "count": 1_000_000 }));
    doc.primitive(json!({ "attributes": { "POSITION": zeros }, "targets": vec![json!({ "POSITION": zeros }); 2000] }));
    doc.json["nodes"][0]["weights"] = json!(vec![1.0; 2000]);
    let start = std::time::Instant::now();
    // 24 GB of zeros, if they were read
    assert!(doc.error().contains("degenerate"));
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn nodes_that_share_a_mesh_of_many_targets() {
    let mut doc = Doc::triangle();
    doc.first()["targets"] = json!(vec![json!({}); 20_000]);
    doc.json["nodes"] = json!(vec![json!({ "mesh": 0 }); 20_000]);
    doc.json["scenes"][0]["nodes"] = json!((0..20_000).collect::<Vec<u32>>());
    is_too_much(&doc, "a node with 20000 morph targets");
}

#[test]
fn planes_that_share_a_mesh() {
    let mut doc = Doc::new();
    let points: Vec<[f32; 3]> = (0..30_000).map(|k| [(k % 173) as f32, (k / 173) as f32, (k % 7) as f32]).collect();
    let position = doc.positions(&points);
    doc.primitive(json!({ "attributes": { "POSITION": position } }));
    doc.json["nodes"] = json!(vec![json!({ "mesh": 0, "scale": [1, 1, 0] }); 2000]);
    doc.json["scenes"][0]["nodes"] = json!((0..2000).collect::<Vec<u32>>());
    is_too_much(&doc, "which is scaled to a plane");
}

#[test]
fn images_of_one_colour() {
    let folder = Folder::new();
    let load = |doc: &Doc| folder.load("scene.gltf", doc.gltf());
    for k in 0..5 {
        folder.write(&format!("{k}.png"), bomb(8192));
    }
    let error = load(&with_images(5, |k| format!("{k}.png"))).map(|_| ()).unwrap_err();
    assert!(error.exit_code() == 5 && error.to_string().contains("an image of 8192x8192 pixels"), "{error}");

    // eight images, one file: it is decoded once and kept once
    folder.write("small.png", bomb(1024));
    let scene = load(&with_images(8, |_| "small.png".into())).unwrap();
    let texels = |k: usize| match &scene.textures[k].texels {
        TexelData::Unorm8(texels) => texels.clone(),
        other => panic!("{} texels", other.len()),
    };
    assert_eq!(scene.textures.len(), 8);
    assert!((1..8).all(|k| Arc::ptr_eq(&texels(0), &texels(k))));
}

#[test]
fn images_that_are_compared() {
    let folder = Folder::new();
    let image = folder.write("a.png", bomb(1024));
    let load = |budget: &Budget| skylit::output::load_within(&image, budget).map(|_| ());
    // a channel and, until it is made, pixels of a byte and floats
    let two = Budget::with_limit(12 << 20);
    assert!(load(&two).is_ok());
    assert_eq!(load(&two).unwrap_err().exit_code(), 5);
    assert_eq!(load(&Budget::with_limit((9 << 20) - 1)).unwrap_err().exit_code(), 5);
}

/// A file with a hole of many gigabytes takes no place on the disk, and none in memory.
#[test]
fn files_that_are_too_large() {
    let folder = Folder::new();
    let sparse = |name: &str, bytes: u64| {
        let path = folder.path(name);
        std::fs::File::create(&path).and_then(|file| file.set_len(bytes)).unwrap();
        path
    };
    let path = sparse("a.glb", 1 << 42);
    let error = load(&path).map(|_| ()).unwrap_err();
    assert!(error.exit_code() == 5 && error.to_string().contains("more than the"), "{error}");
    let path = sparse("a.toml", 1 << 31);
    let error = skylit::renderer::RenderSettings::load(&path).map(|_| ()).unwrap_err();
    assert!(error.exit_code() == 3 && error.to_string().contains("more than the 67108864 that may be read"), "{error}");
}
