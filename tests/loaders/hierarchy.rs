//! Nodes, scenes, cameras, lights.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DAffine3, DVec3, Vec3};
use serde_json::json;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::{LightKind, Projection, Scene, SceneSettings};

use crate::build::*;

fn place(scene: &Scene, instance: usize, p: DVec3) -> DVec3 {
    scene.instances[instance].object_to_world.transform_point3(p)
}

#[test]
fn transforms_compose_in_f64() {
    let mut doc = Doc::triangle();
    // a millionth at a million away is lost in f32
    doc.json["nodes"] = json!([
        { "name": "far", "translation": [1e6, 0, 0], "children": [1] },
        { "name": "turned", "rotation": [0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2], "scale": [2, 3, 4], "children": [2] },
        { "name": "leaf", "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 1e-6,0,0,1], "mesh": 0 },
    ]);
    let scene = doc.load();
    assert_eq!((scene.instances.len(), scene.instances[0].name.as_str()), (1, "leaf"));
    // x -> scaled by 2 -> turned to y
    let p = place(&scene, 0, DVec3::new(1.0, 0.0, 0.0));
    assert!((p - DVec3::new(1e6, 2.0 + 2e-6, 0.0)).length() < 1e-9, "{p}");
}

#[test]
fn meshes_are_shared_by_nodes() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([
        { "mesh": 0, "children": [1, 2] },
        { "mesh": 0, "translation": [1, 0, 0] },
        { "mesh": 0, "scale": [-1, 1, 1] },
    ]);
    let scene = doc.load();
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.triangle_count()), (1, 3, 3));
    // a mirrored transform stays one
    assert!(scene.instances[2].object_to_world.matrix3.determinant() < 0.0);
}

#[test]
fn each_primitive_is_a_mesh() {
    let mut doc = Doc::triangle();
    let primitive = doc.first().clone();
    doc.push("materials", json!({ "name": "red" }));
    doc.primitive(primitive);
    doc.json["meshes"][0]["primitives"][1]["material"] = json!(0);
    let scene = doc.load();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2));
    assert_eq!(scene.materials[scene.meshes[1].material].name, "red");
    // glTF's default material is metallic
    assert_eq!(scene.materials[scene.meshes[0].material].metallic, 1.0);
    assert_ne!(scene.meshes[0].material, scene.meshes[1].material);
}

#[test]
fn which_scene() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] =
        json!([{ "name": "a", "mesh": 0 }, { "name": "b", "mesh": 0, "children": [2] }, { "name": "c", "mesh": 0 }]);
    let names = |doc: &Doc| doc.load().instances.iter().map(|i| i.name.clone()).collect::<Vec<_>>().concat();
    doc.json["scenes"] = json!([{ "nodes": [0] }, { "nodes": [1] }]);
    doc.json["scene"] = json!(1);
    assert_eq!(names(&doc), "bc");
    doc.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(names(&doc), "a");
    doc.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(names(&doc), "abc");
}

/// Name of a node, index of the node above it, and ranges of instances, cameras and lights.
type NodeContent<'a> = (&'a str, Option<usize>, [std::ops::Range<usize>; 3]);

/// Content of all nodes.
fn nodes(scene: &Scene) -> Vec<NodeContent<'_>> {
    scene.nodes.iter().map(|node| (&*node.name, node.parent(), node.items())).collect()
}

/// Nodes keep what is below them, whatever is dropped, and settings name them.
#[test]
fn nodes_have_what_is_below_them() {
    let mut doc = Doc::triangle();
    doc.json["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "name": "bulb" }, { "type": "point" }] } });
    doc.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1 } }]);
    let light = |k: usize| json!({ "KHR_lights_punctual": { "light": k } });
    doc.json["nodes"] = json!([
        { "name": "car", "children": [1, 2, 4, 5] },
        { "name": "nothing", "mesh": 0, "scale": [0, 0, 0] },
        { "name": "body", "mesh": 0, "children": [3] },
        { "name": "lamp", "extensions": light(0) },
        { "name": "driver", "camera": 0 },
        { "children": [6, 7, 8] },
        { "name": "spare", "extensions": light(1) },
        { "name": "wheel", "mesh": 0 },
        { "children": [9] },
        { "name": "wheel", "mesh": 0 },
        { "name": "house", "mesh": 0 },
    ]);
    doc.json["scenes"] = json!([{ "nodes": [0, 10] }]);
    let mut scene = doc.load();
    let names: Vec<&str> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["body", "wheel", "wheel", "house"]);
    assert_eq!(
        nodes(&scene),
        [
            ("car", None, [0..3, 0..1, 0..2]),
            ("body", Some(0), [0..1, 0..0, 0..1]),
            ("lamp", Some(1), [1..1, 0..0, 0..1]),
            ("", Some(0), [1..3, 1..1, 1..2]),
        ]
    );

    let texts = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
    for (hide, only, hidden) in [
        (&["car"][..], &[][..], &[0, 1, 2][..]),
        (&["body"], &[], &[0]),
        (&["wheel"], &[], &[1, 2]),
        (&["2..4", "0"], &[], &[0, 2, 3]),
        (&["body"], &["car"], &[0, 3]),
    ] {
        let settings = SceneSettings { hide: texts(hide), only: texts(only), ..Default::default() };
        assert!(settings.apply(&mut scene).unwrap());
        assert!(scene.hidden.iter().eq(hidden), "{hide:?} {only:?}: {:?}", scene.hidden);
    }
    for text in ["lamp", "4", "3..5"] {
        let settings = SceneSettings { hide: texts(&[text]), ..Default::default() };
        let error = settings.apply(&mut scene).unwrap_err().to_string();
        assert!(error.contains(text) && error.contains("no such object or node, but 8, such as car, body"), "{error}");
    }
    // what is taken out takes nodes without anything with it
    let settings = SceneSettings { only: texts(&["house", "1"]), ..Default::default() };
    settings.apply(&mut scene).unwrap();
    scene.take_out_hidden();
    assert_eq!(nodes(&scene)[0], ("car", None, [0..1, 0..1, 0..2]));
}

/// A node with several primitives is above them; a node without anything else is its own instance.
#[test]
fn primitives_are_below_their_node() {
    let mut doc = Doc::triangle();
    assert!(doc.load().nodes.is_empty());
    let primitive = doc.first().clone();
    doc.primitive(primitive);
    assert_eq!(nodes(&doc.load()), [("node", None, [0..2, 0..0, 0..0])]);
    // deep files are no deep calls
    let chain = |k: usize| if k < 100_000 { json!({ "name": "n", "children": [k + 1] }) } else { json!({ "mesh": 0 }) };
    doc.json["nodes"] = (0..=100_000).map(chain).collect();
    let scene = doc.load();
    assert_eq!((scene.nodes.len(), scene.nodes.above(1).len(), scene.nodes.top(2)), (100_001, 100_001, vec![100_000]));
}

#[test]
fn broken_hierarchies() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "children": [0] }]);
    assert!(doc.error().contains("ancestor"), "{}", doc.error());
    doc.json.as_object_mut().unwrap().remove("scenes");
    doc.json.as_object_mut().unwrap().remove("scene");
    assert!(doc.error().contains("ancestor"), "{}", doc.error());
    doc.json["nodes"] = json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]);
    assert!(doc.error().contains("child of more than one"), "{}", doc.error());
    doc.json["nodes"] = json!([{ "children": [7], "mesh": 0 }]);
    assert!(doc.error().contains("child 7"), "{}", doc.error());
    doc.json["nodes"] = json!([{ "mesh": 3 }]);
    assert!(doc.error().contains("mesh 3"), "{}", doc.error());
}

#[test]
fn deep_hierarchies_do_not_overflow_the_stack() {
    let mut doc = Doc::triangle();
    let n = 100_000;
    let mut nodes: Vec<_> = (1..n).map(|i| json!({ "children": [i], "translation": [0, 0, 1] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    doc.json["nodes"] = json!(nodes);
    assert_eq!(place(&doc.load(), 0, DVec3::ZERO).z, f64::from(n - 1));
}

#[test]
fn squashed_instances_are_baked() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2] }, { "mesh": 0, "scale": [2, 2, 0] }, { "mesh": 0, "scale": [0, 0, 0] }]);
    let scene = doc.load();
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.report.degenerate_triangles), (2, 2, 0));
    assert!(scene.report.warnings[0].contains("scaled to nothing"), "{:?}", scene.report.warnings);
    assert_eq!(scene.instances[1].object_to_world, DAffine3::IDENTITY);
    assert_eq!(corners(mesh(&scene, 1))[0], TRIANGLE.map(|p| p.map(|x| 2.0 * x)));
}

#[test]
fn cameras() {
    let mut doc = Doc::triangle();
    doc.json["cameras"] = json!([
        { "name": "cam", "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5 } },
        { "type": "orthographic", "orthographic": { "xmag": 4, "ymag": 2, "znear": 0, "zfar": 10 } },
        { "type": "perspective", "perspective": { "yfov": 4.0, "znear": 0.1 } },
    ]);
    let s = FRAC_1_SQRT_2;
    doc.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2, 3] },
        { "camera": 0, "translation": [1, 2, 3], "rotation": [0, s, 0, s], "scale": [5, 2, 9] },
        { "name": "flat", "camera": 1, "scale": [-1, 1, 1] },
        { "camera": 2 }]);
    let scene = doc.load();
    assert_eq!((scene.cameras.len(), scene.report.warnings.len()), (2, 1), "{:?}", scene.report.warnings);
    let camera = &scene.cameras[0];
    assert_eq!((camera.name.as_str(), camera.aspect), ("cam", Some(1.5)));
    assert_eq!(camera.projection, Projection::Perspective { fov_y: 0.7 });
    let m = &camera.camera_to_world;
    // turned left by 90 degrees: looks along -x
    assert!((m.matrix3 * DVec3::NEG_Z - DVec3::NEG_X).length() < 1e-12);
    assert_eq!(m.translation, DVec3::new(1.0, 2.0, 3.0));
    for m in scene.cameras.iter().map(|c| c.camera_to_world.matrix3) {
        assert!(
            (m.determinant() - 1.0).abs() < 1e-12
                && (m.transpose() * m - glam::DMat3::IDENTITY).abs_diff_eq(glam::DMat3::ZERO, 1e-12)
        );
    }
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { half_height: 2.0 });
    assert_eq!((scene.cameras[1].name.as_str(), scene.cameras[1].aspect), ("flat", Some(2.0)));
}

#[test]
fn punctual_lights() {
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    doc.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "color": [1, 0.5, 0], "intensity": 10, "range": 7, "name": "lamp" },
        { "type": "spot", "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.3 } },
        { "type": "directional" },
        { "type": "area" },
    ] } });
    let with = |i: usize| json!({ "KHR_lights_punctual": { "light": i } });
    let s = FRAC_1_SQRT_2;
    doc.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2, 3, 4, 5] },
        { "extensions": with(0), "translation": [1, 2, 3] },
        { "extensions": with(1), "rotation": [-s, 0, 0, s] },
        { "extensions": with(2), "name": "sun" },
        { "extensions": with(3) }, { "extensions": with(9) }]);
    let scene = doc.load();
    assert_eq!((scene.lights.len(), scene.report.warnings.len()), (3, 2), "{:?}", scene.report.warnings);
    let [lamp, spot, sun] = &scene.lights[..] else { panic!() };
    assert_eq!((lamp.kind, lamp.intensity, lamp.range), (LightKind::Point, Vec3::new(10.0, 5.0, 0.0), 7.0));
    assert_eq!((lamp.position, lamp.name.as_str()), (DVec3::new(1.0, 2.0, 3.0), "lamp"));
    assert_eq!(spot.kind, LightKind::Spot { inner_angle: 0.1, outer_angle: 0.3 });
    // turned by -90 degrees about x: emits downwards
    assert!((spot.direction - DVec3::NEG_Y).length() < 1e-12, "{}", spot.direction);
    assert_eq!(
        (sun.kind, sun.direction, sun.range),
        (LightKind::Directional { angle: 0.0 }, DVec3::NEG_Z, f64::INFINITY)
    );
    assert_eq!(sun.name, "sun");
}

#[test]
fn what_is_not_shown_is_said() {
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    let warnings = doc.load().report.warnings.join("; ");
    assert!(warnings.contains("EXT_lights_ies"), "{warnings}");
}

/// A node whose instances have these accessors.
fn instanced(doc: &mut Doc, attributes: serde_json::Value) {
    doc.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    doc.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
}

#[test]
fn nodes_place_their_mesh_many_times() {
    let mut doc = Doc::triangle();
    doc.json["nodes"][0]["translation"] = json!([10, 0, 0]);
    let translation = doc.accessor(&bytes(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0f32]]), F32, "VEC3", 3);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = bytes(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half], [0.0, 0.0, 0.0, 2.0f32]]);
    let rotation = doc.accessor(&turns, F32, "VEC4", 3);
    let scale = doc.accessor(&bytes(&[[1.0; 3], [2.0, 1.0, 1.0], [0.5f32; 3]]), F32, "VEC3", 3);
    instanced(&mut doc, json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": 99 }));
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!((scene.instances.len(), scene.meshes.len()), (3, 1));
    // the corner (1, 0, 0) of each
    let corners: Vec<DVec3> = scene.instances.iter().map(|i| i.object_to_world.transform_point3(DVec3::X)).collect();
    let expected = [DVec3::new(12.0, 0.0, 0.0), DVec3::new(10.0, 4.0, 0.0), DVec3::new(10.5, 0.0, 3.0)];
    assert!(corners.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-6), "{corners:?}");

    // rotations alone, of bytes
    let mut doc = Doc::triangle();
    let rotation = doc.accessor(&[0, 0, 127, 0, 0, 0, 0, 127], I8, "VEC4", 2);
    doc.json["accessors"][rotation]["normalized"] = json!(true);
    instanced(&mut doc, json!({ "ROTATION": rotation }));
    let scene = doc.load();
    let corner = scene.instances[0].object_to_world.transform_point3(DVec3::X);
    assert!(corner.distance(DVec3::NEG_X) < 1e-6 && scene.instances.len() == 2, "{corner}");
}

#[test]
fn instances_that_do_not_fit_are_told() {
    let mut doc = Doc::triangle();
    let two = doc.accessor(&bytes(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0f32]]), F32, "VEC3", 2);
    let three = doc.accessor(&bytes(&[[1.0; 3]; 3]), F32, "VEC3", 3);
    let broken = doc.accessor(&bytes(&[[f32::NAN; 3]; 2]), F32, "VEC3", 2);
    for (attributes, text) in [
        (json!({ "TRANSLATION": two, "SCALE": three }), "3 elements, not 2"),
        (json!({ "TRANSLATION": two, "ROTATION": two }), "type VEC3 where VEC4 is needed"),
        (json!({ "TRANSLATION": 77 }), "accessor 77 does not exist"),
        (json!({ "TRANSLATION": broken }), "instance 0 is not finite"),
        (json!([]), "is not valid"),
    ] {
        instanced(&mut doc, attributes);
        let error = doc.error();
        assert!(error.contains("node 0") && error.contains(text), "{text}: {error}");
    }
}

/// Instances of a node that moves move with it.
#[test]
fn instances_follow_animations() {
    let mut doc = Doc::triangle();
    let translation = doc.accessor(&bytes(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0f32]]), F32, "VEC3", 2);
    instanced(&mut doc, json!({ "TRANSLATION": translation }));
    let times = doc.accessor(&bytes(&[[0.0], [1.0f32]]), F32, "SCALAR", 2);
    let places = doc.accessor(&bytes(&[[0.0; 3], [0.0, 0.0, 8.0f32]]), F32, "VEC3", 2);
    let sampler = json!({ "input": times, "output": places });
    let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
    doc.push("animations", json!({ "samplers": [sampler], "channels": [channel] }));
    let scene = doc.load();
    let mut pose = Pose::default();
    scene.rig.as_ref().unwrap().pose(0, 0.5, Playback::Once, &mut pose).unwrap();
    let places: Vec<DVec3> = pose.instances.iter().map(|(_, to_world)| to_world.translation).collect();
    assert_eq!(places, [DVec3::new(1.0, 0.0, 4.0), DVec3::new(0.0, 2.0, 4.0)]);
}

#[test]
fn hidden_nodes_are_left_out() {
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["KHR_node_visibility", "KHR_lights_punctual"]);
    doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    let lamp = json!({ "KHR_lights_punctual": { "light": 0 } });
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 3]);
    doc.push("nodes", json!({ "mesh": 0, "children": [2], "extensions": hidden }));
    doc.push("nodes", json!({ "mesh": 0, "extensions": lamp }));
    doc.push("nodes", json!({ "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": true } } }));
    let scene = doc.load();
    assert_eq!((scene.instances.len(), scene.lights.len()), (2, 0));
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}
