//! Broken files: an error or a scene, never a panic, never absurd memory.

use serde_json::json;
use skylit::scene::Scene;
use skylit::scene::animation::{Playback, Pose};

use crate::build::*;

/// A small generator; the cases are the same on every run.
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % below.max(1)
    }
}

/// A file with some of everything in it.
fn rich() -> Doc {
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 3]), F32, "VEC3", 3);
    let texcoord = doc.accessor(&bytes(&TRIANGLE.map(|p| [p[0], p[1]])), F32, "VEC2", 3);
    let color = doc.accessor(&[255; 12], U8, "VEC4", 3);
    let indices = doc.accessor(&[0, 1, 2], U8, "SCALAR", 3);
    let at = doc.view(&[1], None);
    let values = doc.view(&bytes(&[[2.0, 0.0, 0.0f32]]), None);
    doc.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": { "bufferView": at, "componentType": U8 }, "values": { "bufferView": values },
    });
    let image = doc.view(&png(4, 4, [1, 2, 3, 4]), None);
    doc.push("images", json!({ "bufferView": image, "mimeType": "image/png" }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push(
        "materials",
        json!({
            "normalTexture": { "index": 0 }, "alphaMode": "MASK",
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
        }),
    );
    let position = doc.first()["attributes"]["POSITION"].clone();
    *doc.first() = json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord, "COLOR_0": color },
        "indices": indices, "material": 0 });
    doc.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    let joints = doc.accessor(&[0, 1, 0, 0].repeat(3), U8, "VEC4", 3);
    let weights = doc.accessor(&[128, 127, 0, 0].repeat(3), U8, "VEC4", 3);
    doc.json["accessors"][weights]["normalized"] = json!(true);
    doc.first()["attributes"]["JOINTS_0"] = json!(joints);
    doc.first()["attributes"]["WEIGHTS_0"] = json!(weights);
    doc.first()["targets"] = json!([{ "POSITION": position, "NORMAL": normal }]);
    let bind = doc.accessor(&bytes(&[glam::Mat4::IDENTITY.to_cols_array(); 2]), F32, "MAT4", 2);
    doc.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": bind }));
    let times = doc.accessor(&bytes(&[[0.0f32], [1.0]]), F32, "SCALAR", 2);
    let moves = doc.accessor(&bytes(&[[0.0f32; 3], [1.0; 3]]), F32, "VEC3", 2);
    let morphs = doc.accessor(&bytes(&[[0.0f32], [0.5], [0.0], [0.0], [1.0], [0.0]]), F32, "SCALAR", 6);
    doc.push(
        "animations",
        json!({ "samplers": [
            { "input": times, "output": moves },
            { "input": times, "output": morphs, "interpolation": "CUBICSPLINE" },
        ], "channels": [
            { "sampler": 0, "target": { "node": 1, "path": "scale" } },
            { "sampler": 1, "target": { "node": 0, "path": "weights" } },
            { "sampler": 0, "target": { "node": 3, "path": "translation" } },
        ] }),
    );
    doc.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "children": [1], "scale": [1, 2, 3], "weights": [0.5] },
        { "camera": 0, "rotation": [0, 0, 0, 1], "children": [2, 3] },
        { "translation": [0, 1, 0] },
        { "mesh": 0 },
    ]);
    doc
}

/// What matters in text formats.
const TEXT: &[u8] = b"0123456789-eE.[]{},:\"# /\\\n";

fn mutate(original: &[u8], random: &mut Random) -> Vec<u8> {
    let mut data = original.to_vec();
    for _ in 0..1 + random.next(4) {
        if data.is_empty() {
            break;
        }
        let at = random.next(data.len());
        match random.next(6) {
            0 => data.truncate(at),
            1 => drop(data.remove(at)),
            2 => data[at] = TEXT[random.next(TEXT.len())],
            3 => data[at] ^= 1 << random.next(8),
            4 => data[at] = random.next(256) as u8,
            _ => {
                let from = random.next(data.len());
                let piece = data[from..(from + random.next(20)).min(data.len())].to_vec();
                data.splice(at..at, piece);
            }
        }
    }
    data
}

/// Whatever was loaded can be played.
fn play(scene: &Scene) {
    let Some(rig) = &scene.rig else { return };
    let mut pose = Pose::default();
    for animation in 0..rig.animations().len() {
        let motion = rig.motion(animation).unwrap();
        for seconds in [0.0, 0.4, 1e9] {
            rig.pose(animation, seconds, Playback::Once, &mut pose).unwrap();
            assert_eq!((pose.instances.len(), pose.meshes.len()), (motion.instances.len(), motion.meshes.len()));
        }
    }
}

fn survive(name: &str, data: &[u8], cases: u32) {
    let folder = Folder::new();
    let mut random = Random(0x5eed);
    let (mut good, mut bad) = (0, 0);
    for _ in 0..cases {
        match folder.load(name, mutate(data, &mut random)) {
            Ok(scene) => {
                good += 1;
                play(&scene);
            }
            Err(e) => {
                bad += 1;
                assert!(!e.to_string().contains('\n'), "{e}");
            }
        }
    }
    println!("{name}: {good} loaded, {bad} refused");
    assert!(bad > 0);
}

#[test]
fn glb() {
    assert!(rich().try_load().is_ok_and(|s| s.rig.is_some_and(|r| !r.motion(0).unwrap().meshes.is_empty())));
    survive("a.glb", &rich().glb(), 6000);
}

#[test]
fn gltf() {
    survive("a.gltf", &rich().gltf(), 6000);
}

#[test]
fn obj() {
    let text = "mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl m\n\
                f 1/1/1 2/2/1 3/1/1 4/2/1\nf -1 -2 -3\nf 1//1 2//1 3//1\n";
    survive("a.obj", text.as_bytes(), 6000);
}

#[test]
fn mtl() {
    let folder = Folder::new();
    folder.write("t.png", png(4, 4, [1, 2, 3, 4]));
    folder.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    let text = "newmtl m\nKd 1 1 1\nKs 0 0 0\nNs 10\nd 0.5\nillum 2\nmap_Kd -s 1 2 -o 1 -clamp on t.png\nmap_d t.png\n";
    let mut random = Random(7);
    for _ in 0..3000 {
        folder.write("a.mtl", mutate(text.as_bytes(), &mut random));
        // a broken library never hides the model
        assert_eq!(load(&folder.path("a.obj")).unwrap().triangle_count(), 1);
    }
}

#[test]
fn brhan() {
    let text = "Camera position[0 1 2] view_direction[0 0 -1] vertical_fov[45] width[64] height[64]\n\
                Integrator type[path] spp[4] max_depth[4]\nSphere center[0 0 0] radius[1] material[glass]\n\
                SphericalLight center[0 9 0] radius[1] emittance[1 1 1]\nSaveIntervals[4 8]\nGenDepthImage[true]\n";
    survive("a.brhan", text.as_bytes(), 6000);
}

#[test]
fn images() {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(16, 16, |x, y| image::Rgb([x as u8 * 16, y as u8 * 16, 0]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    for (name, data) in [("t.png", png(16, 16, [1, 2, 3, 4])), ("t.jpg", jpeg.into_inner())] {
        let folder = Folder::new();
        let mut doc = Doc::triangle();
        doc.push("images", json!({ "uri": name }));
        doc.push("textures", json!({ "source": 0 }));
        doc.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
        doc.first()["material"] = json!(0);
        folder.write("a.gltf", doc.gltf());
        let mut random = Random(3);
        let mut shown = 0;
        for _ in 0..2000 {
            folder.write(name, mutate(&data, &mut random));
            shown += usize::from(!load(&folder.path("a.gltf")).unwrap().textures.is_empty());
        }
        println!("{name}: {shown} of 2000 shown");
    }
}
