//! Files that would cost the square of their size where a loop looks at all pairs of something: each loads in time that grows with the file.

use std::fmt::Write;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use skylit::scene::Scene;
use skylit::scene::load::load_file;

/// Far more than each takes, and far less than its square would.
const LIMIT: Duration = Duration::from_secs(15);

fn load(name: &str, text: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    let start = Instant::now();
    let scene = load_file(&path).unwrap();
    let time = start.elapsed();
    println!("{name}: {} bytes in {time:?}", text.len());
    assert!(time < LIMIT, "{time:?}");
    scene
}

/// A glTF file of a triangle, whose buffer has these floats behind it, with more in it. Accessor 0 is the triangle's.
fn gltf(floats: &[f32], accessors: &[Value], more: &[(&str, Value)]) -> String {
    let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0_f32];
    let bytes: Vec<u8> = positions.iter().chain(floats).flat_map(|v| v.to_le_bytes()).collect();
    let digits: String = bytes.iter().fold(String::new(), |mut text, b| {
        write!(text, "%{b:02x}").unwrap();
        text
    });
    let own = json!({ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] });
    let accessors: Vec<Value> = std::iter::once(own).chain(accessors.iter().cloned()).collect();
    let mut file = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": accessors,
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 4 * floats.len().max(1) },
        ],
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:,{digits}") }],
    });
    for (key, value) in more {
        file[*key] = value.clone();
    }
    file.to_string()
}

fn accessor(kind: &str, count: usize, offset: usize) -> Value {
    json!({ "bufferView": 1, "byteOffset": offset, "componentType": 5126, "count": count, "type": kind })
}

/// Two times, and values of vectors and quaternions at them.
fn samplers() -> (Vec<f32>, Vec<Value>) {
    let values = [0.0, 1.0, 1.0, 2.0, 3.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0];
    (values.into(), vec![accessor("SCALAR", 2, 0), accessor("VEC3", 2, 8), accessor("VEC4", 2, 32)])
}

#[test]
fn channels_of_many_nodes() {
    let count = 20_000;
    let (floats, accessors) = samplers();
    let nodes: Vec<Value> = (0..count).map(|_| json!({ "mesh": 0 })).collect();
    let channel = |(node, path): (usize, &str)| json!({ "sampler": usize::from(path == "rotation"), "target": { "node": node, "path": path } });
    let targets = (0..count).flat_map(|n| ["translation", "rotation", "scale"].map(|path| (n, path)));
    let animation = json!({
        "channels": targets.map(channel).collect::<Vec<_>>(),
        "samplers": [{ "input": 1, "output": 2 }, { "input": 1, "output": 3 }],
    });
    let roots: Vec<usize> = (0..count).collect();
    let more = [("nodes", json!(nodes)), ("scenes", json!([{ "nodes": roots }])), ("animations", json!([animation]))];
    let scene = load("channels.gltf", &gltf(&floats, &accessors, &more));
    assert_eq!(scene.rig.unwrap().animations()[0].channels.len(), 3 * count);
}

#[test]
fn as_many_animations_as_nodes() {
    let count = 15_000;
    let (floats, accessors) = samplers();
    let nodes: Vec<Value> = (0..count).map(|_| json!({ "mesh": 0 })).collect();
    let animation = |node: usize| {
        json!({
            "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
            "samplers": [{ "input": 1, "output": 2 }],
        })
    };
    let animations: Vec<Value> = (0..count).map(animation).collect();
    let roots: Vec<usize> = (0..count).collect();
    let more = [("nodes", json!(nodes)), ("scenes", json!([{ "nodes": roots }])), ("animations", json!(animations))];
    let scene = load("animations.gltf", &gltf(&floats, &accessors, &more));
    assert_eq!(scene.rig.unwrap().animations().len(), count);
}

/// Meshes that share a skin, which no animation moves, and then one that moves its last joint.
#[test]
fn meshes_of_one_skin_with_many_joints() {
    let (meshes, joints) = (3000, 3000);
    let (mut floats, mut accessors) = samplers();
    let at = 4 * floats.len();
    // each vertex follows the first joint
    floats.extend([0.0; 12].iter().chain([1.0, 0.0, 0.0, 0.0].repeat(3).iter()));
    accessors.push(json!({ "bufferView": 1, "byteOffset": at, "componentType": 5121, "count": 3, "type": "VEC4" }));
    accessors.push(accessor("VEC4", 3, at + 48));
    let attributes = json!({ "POSITION": 0, "JOINTS_0": 4, "WEIGHTS_0": 5 });
    let primitive = json!({ "primitives": [{ "attributes": attributes }] });
    let first = meshes + joints - 1;
    let nodes: Vec<Value> =
        (0..meshes).map(|m| json!({ "mesh": m, "skin": 0 })).chain((0..joints).map(|_| json!({}))).collect();
    let list: Vec<usize> = (meshes..meshes + joints).collect();
    let all: Vec<usize> = (0..meshes + joints).collect();
    let mut more = vec![
        ("nodes", json!(nodes)),
        ("meshes", json!(vec![primitive; meshes])),
        ("scenes", json!([{ "nodes": all }])),
        ("skins", json!([{ "joints": list }])),
    ];
    let still = load("skin.gltf", &gltf(&floats, &accessors, &more));
    assert_eq!((still.instances.len(), still.rig.is_none()), (meshes, true));
    let channel = json!([{ "sampler": 0, "target": { "node": first, "path": "translation" } }]);
    more.push(("animations", json!([{ "channels": channel, "samplers": [{ "input": 1, "output": 2 }] }])));
    let moving = load("moving-skin.gltf", &gltf(&floats, &accessors, &more));
    let rig = moving.rig.unwrap();
    let start = Instant::now();
    let mut pose = skylit::scene::animation::Pose::default();
    rig.pose(0, 0.5, skylit::scene::animation::Playback::Loop, &mut pose).unwrap();
    assert!(pose.meshes.len() == meshes && start.elapsed() < LIMIT);
}

#[test]
fn names_of_many_extensions() {
    let used: Vec<String> = (0..60_000).map(|k| format!("KHR_texture_transfor{}", k % 10)).collect();
    let more = [("extensionsUsed", json!(used)), ("extensionsRequired", json!(vec!["KHR_texture_transform"; 60_000]))];
    let scene = load("extensions.gltf", &gltf(&[], &[], &more));
    assert_eq!(scene.report.extensions.len(), 60_000);
}

/// A polygon that crosses itself at each of its corners.
#[test]
fn a_polygon_of_many_corners() {
    let mut state = 1_u32;
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    let count = 60_000;
    let mut text: String = (0..count).map(|_| format!("v {} {} 0\n", number(), number())).collect();
    text += "f";
    (1..=count).for_each(|k| write!(text, " {k}").unwrap());
    let scene = load("polygon.obj", &text);
    assert!(scene.report.warnings.iter().any(|w| w.contains("more than 10000 corners")), "{:?}", scene.report.warnings);
}

/// A normal map on triangles whose vertices lie at one position and are not the same, and on others around one vertex, which share edges: deep recursion for MikkTSpace.
#[test]
fn tangents_at_one_position() {
    let count = 60_000;
    let (mut apart, mut ring) = (
        String::from("mtllib m.mtl\nusemtl m\nvn 0 0 1\n"),
        String::from("mtllib m.mtl\nusemtl m\nv 0 0 0.5\nvt 0 0\nvn 0 0 1\n"),
    );
    for k in 0..count {
        let (s, far) = (f64::from(k) / f64::from(count), 1.0 + 1e-4 * f64::from(k));
        writeln!(
            apart,
            "v 0 0 0\nv {far} 0 0\nv 0 {far} 0\nvt {s} 0\nvt {s} 1\nvt {} 0\nf -3/-3/1 -2/-2/1 -1/-1/1",
            s + 1.0
        )
        .unwrap();
        let (sin, cos) = (std::f64::consts::TAU * s).sin_cos();
        writeln!(ring, "v {cos} {sin} 0\nvt {cos} {sin}").unwrap();
    }
    (0..count).for_each(|k| writeln!(ring, "f 1/1/1 {0}/{0}/1 {1}/{1}/1", k + 2, (k + 1) % count + 2).unwrap());
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::write(at("m.mtl"), "newmtl m\nnorm n.png\n").unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([128, 128, 255])).save(at("n.png")).unwrap();
    for (name, text) in [("apart.obj", apart), ("ring.obj", ring)] {
        std::fs::write(at(name), text).unwrap();
        let start = Instant::now();
        let scene = load_file(&at(name)).unwrap();
        println!("{name}: {:?}", start.elapsed());
        assert!(start.elapsed() < LIMIT && scene.report.tangents_computed == 1, "{name}: {:?}", start.elapsed());
    }
}

/// A normal map on triangles that have a vertex in common, each with a tangent of its own there.
#[test]
fn a_vertex_of_many_triangles() {
    let count = 60_000;
    let mut text = String::from("mtllib m.mtl\nv 0 0 0\nvt 0 0\nvn 0 0 1\n");
    for k in 0..count {
        for turn in [0.0_f64, 1.0] {
            let at = turn + 1e-4 * f64::from(k);
            writeln!(text, "v {} {} 0", at.cos(), at.sin()).unwrap();
        }
    }
    text += "vt 1 0\nvt 0.540302 0.841471\nusemtl m\n";
    (0..count).for_each(|k| writeln!(text, "f 1/1/1 {}/2/1 {}/3/1", 2 * k + 2, 2 * k + 3).unwrap());
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::write(at("m.mtl"), "newmtl m\nnorm n.png\n").unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([128, 128, 255])).save(at("n.png")).unwrap();
    std::fs::write(at("fan.obj"), text).unwrap();
    let start = Instant::now();
    let scene = load_file(&at("fan.obj")).unwrap();
    println!("fan.obj: {:?}", start.elapsed());
    assert!(start.elapsed() < LIMIT && scene.report.tangents_computed == 1, "{:?}", start.elapsed());
    let skylit::scene::Geometry::Triangles(mesh) = &scene.meshes[0].geometry else { panic!("no triangles") };
    assert!(mesh.tangents.len() > 100_000, "{}", mesh.tangents.len());
}
