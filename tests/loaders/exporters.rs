//! Files as careless exporters write them, which other programs read.

use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use skylit::scene::{ClipPlanes, Material, Scene, TextureSlot};

use crate::build::*;

/// A quad of two triangles with one texture as its base colour, whose image is at `uri`.
fn textured(uri: &str) -> Doc {
    let mut doc = Doc::triangle();
    let texcoord = doc.accessor(&bytes(&TRIANGLE.map(|p| [p[0], p[1]])), F32, "VEC2", 3);
    doc.first()["attributes"]["TEXCOORD_0"] = json!(texcoord);
    doc.push("images", json!({ "uri": uri }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    doc.first()["material"] = json!(0);
    doc
}

fn first_texel(scene: &Scene) -> [f32; 4] {
    scene.textures.first().unwrap_or_else(|| panic!("no texture: {:?}", scene.report.warnings)).texels.get(0)
}

#[test]
fn paths_of_other_systems_and_browsers() {
    let folder = Folder::new();
    folder.write("maps/a b.png", png(1, 1, [0, 255, 0, 255]));
    folder.write("odd%20name.png", png(1, 1, [0, 0, 255, 255]));
    let (green, blue) = ([0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
    for (uri, color) in [
        ("maps/a%20b.png", green),
        ("maps/a b.png", green),
        ("maps\\a b.png", green),
        (".\\maps\\a%20b.png", green),
        ("maps%5Ca%20b.png", green),
        ("maps/a%20b.png?version=3#top", green),
        // a name that really has an escape in it
        ("odd%20name.png", blue),
        ("C:\\work\\odd%20name.png", blue),
        ("file:///home/someone/odd%20name.png", blue),
        ("FILE:maps/a%20b.png", green),
        ("/maps/a b.png", green),
    ] {
        let scene = folder.load("a.gltf", textured(uri).gltf()).unwrap();
        assert_eq!(first_texel(&scene), color, "{uri}");
        assert!(scene.report.warnings.is_empty() && scene.report.files.iter().all(|f| f.is_file()), "{uri}");
    }
    // buffers, too
    let mut doc = textured("maps\\a b.png");
    folder.write("data/the buffer.bin", &doc.bin);
    doc.json["buffers"] = json!([{ "byteLength": doc.bin.len(), "uri": "data\\the%20buffer.bin" }]);
    assert_eq!(folder.load("b.gltf", doc.gltf()).unwrap().triangle_count(), 1);
    let scene = folder.load("a.gltf", textured("gone\\a.png").gltf()).unwrap();
    assert!(scene.report.warnings[0].contains("gone/a.png"), "{:?}", scene.report.warnings);
}

#[test]
fn data_uris_of_all_kinds() {
    let folder = Folder::new();
    let image = base64(&png(1, 1, [255, 0, 0, 255]));
    let (start, end) = image.split_at(20);
    for uri in [
        format!("DATA:image/png;BASE64,{image}"),
        format!("data:image/png;base64,{start}\r\n{end}\n"),
        format!("data:image/png;charset=utf-8;base64,{}", image.trim_end_matches('=')),
        format!("data:;base64,{}", image.replace('+', "-").replace('/', "_")),
        format!("data:;base64,{}", image.replace('=', "%3D").replace('+', "%2B")),
    ] {
        assert_eq!(first_texel(&folder.load("a.gltf", textured(&uri).gltf()).unwrap()), [1.0, 0.0, 0.0, 1.0], "{uri}");
    }
}

/// A `.glb` of these chunks, each with its own kind, as they are.
fn glb(chunks: &[(&[u8], &[u8])]) -> Vec<u8> {
    let chunk = |(kind, body): &(&[u8], &[u8])| [&(body.len() as u32).to_le_bytes(), *kind, *body].concat();
    let chunks: Vec<u8> = chunks.iter().flat_map(chunk).collect();
    [b"glTF\x02\0\0\0", &(12 + chunks.len() as u32).to_le_bytes()[..], &chunks].concat()
}

#[test]
fn containers_of_all_kinds() {
    let folder = Folder::new();
    let doc = Doc::triangle();
    let loads = |name: &str, data: &[u8]| {
        let scene = folder.load(name, data).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scene.triangle_count(), 1);
    };
    let text = doc.gltf();
    // named like the other kind
    loads("json.glb", &text);
    loads("binary.gltf", &doc.glb());
    // text with what editors put before it, and in another encoding
    loads("a.gltf", &[&b"\xef\xbb\xbf"[..], &text].concat());
    loads("a.glb", &[&b"\xef\xbb\xbf \n"[..], &text].concat());
    let units: Vec<u16> = String::from_utf8(text.clone()).unwrap().encode_utf16().collect();
    loads("a.gltf", &[vec![0xff, 0xfe], units.iter().flat_map(|u| u.to_le_bytes()).collect()].concat());
    loads("a.gltf", &[vec![0xfe, 0xff], units.iter().flat_map(|u| u.to_be_bytes()).collect()].concat());
    loads("a.gltf", &[&text[..], &[0; 7]].concat());

    // padding by zeros, in the chunk and behind it
    let mut json = doc.json.clone();
    json["buffers"] = json!([{ "byteLength": doc.bin.len() }]);
    let json = json.to_string().into_bytes();
    let padded = |by: u8| [&json[..], &vec![by; json.len().next_multiple_of(4) - json.len() + 4]].concat();
    loads("a.glb", &glb(&[(b"JSON", &padded(0)), (b"BIN\0", &doc.bin)]));
    loads("a.glb", &[glb(&[(b"JSON", &padded(b' ')), (b"BIN\0", &doc.bin)]), vec![0; 64]].concat());
    let inside = glb(&[(b"JSON", &padded(0)), (b"BIN\0", &doc.bin), (&[0; 4], &[])]);
    loads("a.glb", &inside);
    // padding that the chunk's length does not count
    let odd = [&json[..], &vec![b' '; (5 - json.len() % 4) % 4]].concat();
    assert_eq!(odd.len() % 4, 1);
    let mut short = glb(&[(b"JSON", &odd)]);
    short.extend([0; 3]);
    short.extend([&(doc.bin.len() as u32).to_le_bytes()[..], b"BIN\0", &doc.bin].concat());
    let length = short.len() as u32;
    short[8..12].copy_from_slice(&length.to_le_bytes());
    loads("a.glb", &short);
    // a binary chunk that is said to be longer by its padding
    let mut long = glb(&[(b"JSON", &padded(0)), (b"BIN\0", &doc.bin)]);
    let at = long.len() - doc.bin.len() - 8;
    long[at..at + 4].copy_from_slice(&(doc.bin.len() as u32 + 3).to_le_bytes());
    loads("a.glb", &long);
}

#[test]
fn buffers_that_nothing_needs() {
    let mut doc = Doc::triangle();
    doc.json["buffers"] = json!([
        { "byteLength": 36, "uri": format!("data:;base64,{}", base64(&doc.bin)) },
        { "byteLength": 100 },
        { "byteLength": 100, "uri": "gone.bin" },
    ]);
    // of one there is a view, which no accessor uses
    doc.push("bufferViews", json!({ "buffer": 1, "byteLength": 8 }));
    let scene = doc.load();
    assert!(scene.triangle_count() == 1 && scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    doc.json["bufferViews"][0]["buffer"] = json!(1);
    assert!(doc.error().contains("buffer 1 has neither"), "{}", doc.error());
}

#[test]
fn what_no_extension_fills_is_told() {
    // a buffer that stands for compressed views, and a view that is none
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
    doc.json["buffers"] =
        json!([{ "byteLength": 36, "extensions": { "EXT_meshopt_compression": { "fallback": true } } }]);
    assert!(doc.error().contains("the extension EXT_meshopt_compression fills it"), "{}", doc.error());

    // positions that the compressed stream does not have
    let mut doc = Doc::triangle();
    doc.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    doc.first()["extensions"] =
        json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "NORMAL": 0 } } });
    assert!(doc.error().contains("the extension KHR_draco_mesh_compression does not fill it"), "{}", doc.error());
    // data of their own is read where the stream cannot be
    doc.json["accessors"][0]["bufferView"] = json!(0);
    doc.first()["extensions"]["KHR_draco_mesh_compression"]["attributes"] = json!({ "POSITION": 0 });
    assert_eq!(doc.load().triangle_count(), 1);
}

/// A file that requires what skylit does not read is refused before a buffer is read.
#[test]
fn files_are_refused_by_the_extension() {
    for name in ["EXT_lights_ies", "KHR_techniques_webgl", "KHR_gaussian_splatting"] {
        let mut doc = Doc::triangle();
        doc.json["buffers"] = json!([{ "byteLength": 36, "uri": "gone.bin" }]);
        doc.json["extensionsUsed"] = json!([name]);
        doc.json["extensionsRequired"] = json!([name]);
        let text = doc.error();
        assert!(text.contains(&format!("requires the extension {name}, which skylit does not support")), "{text}");
    }
}

#[test]
fn clipping_planes_of_cameras() {
    let planes = |kind: &str, lens: Value| {
        let mut doc = Doc::triangle();
        doc.push("cameras", json!({ "type": kind, kind: lens }));
        doc.json["nodes"][0]["camera"] = json!(0);
        let scene = doc.load();
        (scene.cameras[0].clip, scene.report.warnings.join("; "))
    };
    let clip = |near, far| (ClipPlanes { near, far }, String::new());
    let inf = f64::INFINITY;
    assert_eq!(planes("perspective", json!({ "yfov": 0.8, "znear": 0.1, "zfar": 100 })), clip(0.1, 100.0));
    assert_eq!(planes("perspective", json!({ "yfov": 0.8, "znear": 0.1 })), clip(0.1, inf));
    assert_eq!(planes("perspective", json!({ "yfov": 0.8 })), clip(0.0, inf));
    assert_eq!(planes("perspective", json!({ "yfov": 0.8, "znear": 0.1, "zfar": 0 })), clip(0.1, inf));
    assert_eq!(planes("orthographic", json!({ "xmag": 1, "ymag": 1, "znear": -5, "zfar": 3 })), clip(0.0, 3.0));
    let (none, said) = planes("orthographic", json!({ "xmag": 1, "ymag": 1, "znear": 4, "zfar": 3 }));
    assert!(none == ClipPlanes::NONE && said.contains("camera 0 has its far plane (3) before"), "{said}");
}

#[test]
fn occlusion_textures_have_a_strength() {
    let strength = |texture: Value| {
        let mut doc = textured("t.png");
        doc.json["materials"][0]["occlusionTexture"] = texture;
        doc.load().materials[0].occlusion_strength
    };
    assert_eq!(strength(json!({ "index": 0, "strength": 0.25 })), 0.25);
    assert_eq!(strength(json!({ "index": 0 })), 1.0);
    assert_eq!(strength(json!({ "index": 0, "strength": 7 })), 1.0);
}

/// A bumpy grid, whose texture coordinates a transform maps to `baked`; its normals are not those of its faces.
fn grid(coordinates: impl Fn(Vec2) -> Vec2, material: &Value) -> Doc {
    const SIDE: usize = 5;
    let mut doc = Doc::new();
    let (mut positions, mut normals, mut texcoords, mut indices) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::<u8>::new());
    for k in 0..SIDE * SIDE {
        let (x, y) = ((k % SIDE) as f32, (k / SIDE) as f32);
        positions.push([x, y, (x * 1.3).sin() + (y * 0.7).cos()]);
        normals.push(Vec3::new(0.3 * x.cos(), 0.2 * y.sin(), 1.0).normalize().to_array());
        texcoords.push(coordinates(Vec2::new(0.21 * x + 0.04 * y, 0.9 - 0.17 * y + 0.01 * x * y)).to_array());
        if x < 4.0 && y < 4.0 {
            let [a, b, c, d] = [k, k + 1, k + SIDE, k + SIDE + 1].map(|i| i as u8);
            indices.extend([a, b, c, b, d, c]);
        }
    }
    let count = SIDE * SIDE;
    let position = doc.positions(&positions);
    let normal = doc.positions(&normals);
    let texcoord = doc.accessor(&bytes(&texcoords), F32, "VEC2", count);
    let indices = doc.accessor(&indices, U8, "SCALAR", indices.len());
    doc.primitive(json!({
        "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord }, "indices": indices, "material": 0,
    }));
    doc.push("images", json!({ "uri": format!("data:image/png;base64,{}", base64(&png(2, 2, [128, 128, 255, 255]))) }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push("materials", material.clone());
    doc
}

/// A material with this texture in a slot of directions, and the slot.
struct Directions {
    material: fn(Value) -> Value,
    slot: fn(&Material) -> Option<TextureSlot>,
}

/// Tangents follow the coordinates of the texture, its transform included, as if it were baked into them.
#[test]
fn tangents_follow_texture_transforms() {
    let slots = [
        Directions { material: |texture| json!({ "normalTexture": texture }), slot: |m| m.normal_texture },
        Directions {
            material: |texture| json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatNormalTexture": texture } } }),
            slot: |m| m.clearcoat.normal_texture,
        },
        Directions {
            material: |texture| json!({ "extensions": { "KHR_materials_anisotropy": { "anisotropyStrength": 1, "anisotropyTexture": texture } } }),
            slot: |m| m.anisotropy.texture,
        },
    ];
    let plain = grid(|uv| uv, &(slots[0].material)(json!({ "index": 0 }))).load();
    for transform in [
        json!({ "rotation": std::f64::consts::FRAC_PI_2 }),
        json!({ "rotation": -0.6, "offset": [0.3, 9] }),
        json!({ "scale": [-1, 1] }),
        json!({ "scale": [1, -1], "rotation": 0.4 }),
        json!({ "scale": [0.2, 3], "rotation": 2.5, "offset": [-1, 0.5] }),
    ] {
        for Directions { material, slot } in &slots {
            let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
            let moved = grid(|uv| uv, &material(texture)).load();
            let affine = slot(&moved.materials[0]).unwrap().transform;
            let baked = grid(|uv| affine.transform_point2(uv), &material(json!({ "index": 0 }))).load();
            let tangents = |scene: &Scene| -> Vec<(Vec3, Vec4)> {
                let m = mesh(scene, 0);
                m.indices.iter().flatten().map(|&i| (m.positions[i as usize], m.tangents[i as usize])).collect()
            };
            let (a, b) = (tangents(&moved), tangents(&baked));
            assert_eq!(a.len(), 96);
            for ((p, t), (q, u)) in a.iter().zip(&b) {
                assert!(p == q && t.w == u.w && t.distance(*u) < 1e-4, "{transform}: {t} {u}");
            }
            assert!(
                a.iter().zip(tangents(&plain)).any(|(a, b)| a.1.distance(b.1) > 0.3),
                "{transform} changes nothing"
            );
        }
    }
}

/// Two textures of a material have tangents of their own where their transforms or sets differ, and share them where they do not.
#[test]
fn textures_of_a_material_have_tangents_of_their_own() {
    let turned = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "rotation": 0.9 } } });
    let scaled =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [3, 7], "offset": [0.5, 0] } } });
    let material = |clearcoat: &Value, anisotropy: &Value| {
        json!({ "normalTexture": { "index": 0 }, "extensions": {
            "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatNormalTexture": clearcoat },
            "KHR_materials_anisotropy": { "anisotropyStrength": 1, "anisotropyTexture": anisotropy } } })
    };
    let plain = json!({ "index": 0 });
    for alike in [&plain, &scaled] {
        let scene = grid(|uv| uv, &material(alike, alike)).load();
        let m = mesh(&scene, 0);
        assert!(!m.tangents.is_empty() && m.clearcoat_tangents.is_empty() && m.anisotropy_tangents.is_empty());
    }
    // as if each were the only texture
    let corner = |scene: &Scene, array: &[Vec4]| -> Vec<Vec4> {
        mesh(scene, 0).indices.iter().flatten().map(|&i| array[i as usize]).collect()
    };
    let tangents = |material: &Value| {
        let scene = grid(|uv| uv, material).load();
        corner(&scene, &mesh(&scene, 0).tangents)
    };
    let (first, second) = (tangents(&json!({ "normalTexture": plain })), tangents(&json!({ "normalTexture": turned })));
    let scene = grid(|uv| uv, &material(&turned, &plain)).load();
    let m = mesh(&scene, 0);
    assert!(m.anisotropy_tangents.is_empty() && m.clearcoat_tangents.len() == m.positions.len());
    assert_eq!((corner(&scene, &m.tangents), corner(&scene, &m.clearcoat_tangents)), (first.clone(), second.clone()));
    let scene = grid(|uv| uv, &material(&plain, &turned)).load();
    assert_eq!(corner(&scene, &mesh(&scene, 0).anisotropy_tangents), second);
    // other coordinates: those of the second set lie as the turned ones
    let other = grid(|uv| uv, &material(&json!({ "index": 0, "texCoord": 1 }), &plain));
    let mut doc = other;
    let affine =
        grid(|uv| uv, &json!({ "normalTexture": turned })).load().materials[0].normal_texture.unwrap().transform;
    let texcoord = grid(|uv| affine.transform_point2(uv), &plain);
    let at = texcoord.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"].as_u64().unwrap() as usize;
    let view = texcoord.json["accessors"][at]["bufferView"].as_u64().unwrap() as usize;
    let offset = texcoord.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    let second_set = doc.accessor(&texcoord.bin[offset..offset + 25 * 8], F32, "VEC2", 25);
    doc.first()["attributes"]["TEXCOORD_1"] = json!(second_set);
    let scene = doc.load();
    let found = corner(&scene, &mesh(&scene, 0).clearcoat_tangents);
    assert!(found.iter().zip(&second).all(|(a, b)| a.w == b.w && a.distance(*b) < 1e-4));
}

/// Tangents of the file are those of its own coordinates and are used as they are.
#[test]
fn tangents_of_the_file_are_not_transformed() {
    let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "rotation": 1.0 } } });
    let mut doc = grid(|uv| uv, &json!({ "normalTexture": texture }));
    let tangent = doc.accessor(&bytes(&[[0.0, 1.0, 0.0, -1.0f32]; 25]), F32, "VEC4", 25);
    doc.first()["attributes"]["TANGENT"] = json!(tangent);
    assert!(mesh(&doc.load(), 0).tangents.iter().all(|t| *t == Vec4::new(0.0, 1.0, 0.0, -1.0)));
}
