//! Animations, skins and morph targets: from files to poses, against values computed by hand.

use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use serde_json::{Value, json};
use skylit::Error;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::builtin::by_name;
use skylit::scene::export::export_gltf;
use skylit::scene::{AnimationRig, Scene};

use crate::build::*;

const H: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Adds a channel to animation 0, which is made when it is not there.
fn animate<const N: usize>(
    doc: &mut Doc,
    node: usize,
    path: &str,
    interpolation: &str,
    times: &[f32],
    values: &[[f32; N]],
) {
    let input = doc.accessor(&bytes(&times.iter().map(|t| [*t]).collect::<Vec<_>>()), F32, "SCALAR", times.len());
    let output = doc.accessor(&bytes(values), F32, ["SCALAR", "", "VEC3", "VEC4"][N - 1], values.len());
    if doc.json["animations"].is_null() {
        doc.push("animations", json!({ "name": "move", "samplers": [], "channels": [] }));
    }
    let animation = &mut doc.json["animations"][0];
    let samplers = animation["samplers"].as_array_mut().unwrap();
    samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
    let sampler = samplers.len() - 1;
    let channel = json!({ "sampler": sampler, "target": { "node": node, "path": path } });
    animation["channels"].as_array_mut().unwrap().push(channel);
}

fn rig(scene: &Scene) -> &AnimationRig {
    scene.rig.as_ref().unwrap_or_else(|| panic!("no rig: {:?}", scene.report.warnings))
}

fn pose(scene: &Scene, seconds: f64) -> Pose {
    let mut pose = Pose::default();
    rig(scene).pose(0, seconds, Playback::Once, &mut pose).unwrap();
    pose
}

fn near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-6, "{a} {b}");
}

/// A quarter turn about an axis, in file order.
fn quarter(x: f32, y: f32, z: f32) -> [f32; 4] {
    [x * H, y * H, z * H, H]
}

const NO_TURN: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

#[test]
fn children_follow_their_parents() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([
        { "name": "turning", "children": [1, 2], "translation": [10, 0, 0], "mesh": 0 },
        { "name": "child", "translation": [2, 0, 0], "mesh": 0, "scale": [1, 2, 1] },
        { "name": "eye", "translation": [0, 0, 3], "scale": [2, 2, 2], "camera": 0 },
        { "name": "aside", "mesh": 0 },
    ]);
    doc.json["scenes"][0]["nodes"] = json!([0, 3]);
    doc.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    animate(&mut doc, 0, "rotation", "LINEAR", &[1.0, 3.0], &[NO_TURN, quarter(0.0, 1.0, 0.0)]);
    animate(&mut doc, 0, "translation", "STEP", &[0.0, 2.5], &[[10.0, 0.0, 0.0], [10.0, 5.0, 0.0]]);
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    let motion = rig(&scene).motion(0).unwrap();
    assert_eq!((motion.instances, motion.meshes), (vec![0, 1], vec![]));
    assert_eq!(rig(&scene).moving_cameras(0).unwrap(), [0]);
    let animation = &rig(&scene).animations()[0];
    assert_eq!((animation.name.as_str(), animation.duration), ("move", 3.0));
    // at rest, bit by bit, before the first key
    let still = pose(&scene, 0.5);
    for (i, t) in &still.instances {
        assert_eq!(*t, scene.instances[*i].object_to_world);
    }
    assert_eq!(still.cameras[0].1, scene.cameras[0].camera_to_world);
    for (seconds, angle, y) in [(2.0, FRAC_PI_2 * 0.5, 0.0), (2.5, FRAC_PI_2 * 0.75, 5.0), (9.0, FRAC_PI_2, 5.0)] {
        let pose = pose(&scene, seconds);
        let parent = DAffine3::from_rotation_translation(DQuat::from_rotation_y(angle), DVec3::new(10.0, y, 0.0));
        near(pose.instances[0].1.transform_point3(DVec3::ONE), parent.transform_point3(DVec3::ONE));
        near(pose.instances[1].1.transform_point3(DVec3::ONE), parent.transform_point3(DVec3::new(3.0, 2.0, 1.0)));
        let eye = pose.cameras[0].1;
        near(eye.translation, parent.transform_point3(DVec3::Z * 3.0));
        near(eye.matrix3 * DVec3::Z, DQuat::from_rotation_y(angle) * DVec3::Z);
    }
    // looped, 3 s is the beginning
    let mut looped = Pose::default();
    rig(&scene).pose(0, 3.0 + 2.0, Playback::Loop, &mut looped).unwrap();
    assert_eq!(looped.instances, pose(&scene, 2.0).instances);
    for odd in [f64::NAN, f64::INFINITY, -1.0] {
        rig(&scene).pose(0, odd, Playback::Loop, &mut looped).unwrap();
        assert!(looped.instances.iter().all(|(_, t)| t.is_finite()));
    }
    let error = rig(&scene).pose(1, 0.0, Playback::Loop, &mut looped).unwrap_err();
    assert!(matches!(error, Error::Usage(_)) && rig(&scene).motion(1).is_err(), "{error}");
}

/// A quad of four vertices on two joints, the second one unit above the first. Vertex 2 is torn between them.
fn bound(normals: bool) -> Doc {
    let mut doc = Doc::new();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 2.0, 0.0]];
    let position = doc.positions(&corners);
    let joints = doc.accessor(&[0, 0, 0, 0, 0, 9, 9, 9, 0, 1, 0, 0, 1, 0, 0, 0], U8, "VEC4", 4);
    let weights = [[1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0f32], [1.0, 0.0, 0.0, 0.0]];
    let weights = doc.accessor(&bytes(&weights), F32, "VEC4", 4);
    let indices = doc.accessor(&[0, 1, 2, 0, 2, 3], U8, "SCALAR", 6);
    let mut attributes = json!({ "POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights });
    if normals {
        attributes["NORMAL"] = json!(doc.accessor(&bytes(&[[0.0, 0.6, 0.8f32]; 4]), F32, "VEC3", 4));
    }
    doc.primitive(json!({ "attributes": attributes, "indices": indices }));
    let bind = |y: f32| {
        let mut m = glam::Mat4::IDENTITY.to_cols_array();
        m[13] = -y;
        m
    };
    let matrices = doc.accessor(&bytes(&[bind(0.0), bind(1.0)]), F32, "MAT4", 2);
    doc.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": matrices, "name": "arm" }));
    // the mesh's own node lies far off, which must not matter
    doc.json["nodes"] = json!([
        { "name": "node", "mesh": 0, "skin": 0, "translation": [100, 0, 0], "scale": [3, 3, 3] },
        { "name": "lower", "children": [2] },
        { "name": "upper", "translation": [0, 1, 0] },
    ]);
    doc.json["scenes"][0]["nodes"] = json!([0, 1]);
    doc
}

/// What the bound quad becomes when the upper joint is turned about z.
fn closed_form(angle: f64) -> [DVec3; 4] {
    let turned = |p: DVec3| DVec3::Y + DQuat::from_rotation_z(angle) * (p - DVec3::Y);
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 2.0, 0.0]].map(DVec3::from_array);
    [a, b, c * 0.25 + turned(c) * 0.75, turned(d)]
}

fn check_positions(found: &[Vec3], wanted: &[DVec3]) {
    assert_eq!(found.len(), wanted.len());
    for (a, b) in found.iter().zip(wanted) {
        near(a.as_dvec3(), *b);
    }
}

#[test]
fn a_skin_against_its_closed_form() {
    let mut doc = bound(true);
    animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    let motion = rig(&scene).motion(0).unwrap();
    assert_eq!((motion.instances, motion.meshes), (vec![], vec![0]));
    assert_eq!(scene.instances[0].object_to_world, DAffine3::IDENTITY);
    check_positions(&mesh(&scene, 0).positions, &closed_form(0.0));
    let mut pose = Pose::default();
    for seconds in [0.0, 0.25, 2.0 / 3.0, 1.0] {
        rig(&scene).pose(0, seconds, Playback::Once, &mut pose).unwrap();
        let angle = FRAC_PI_2 * seconds;
        let [posed] = &pose.meshes[..] else { panic!() };
        check_positions(&posed.shape.positions, &closed_form(angle));
        let n = DVec3::new(0.0, 0.6, 0.8);
        let turn = DMat3::from_rotation_z(angle);
        // vertex 2: by the inverse transpose of the mean of the joints' matrices
        let mean = DMat3::IDENTITY * 0.25 + turn * 0.75;
        let wanted = [n, n, (mean.inverse().transpose() * n).normalize(), turn * n];
        check_positions(&posed.shape.normals, &wanted);
        let changes = pose.changes();
        assert_eq!((changes.meshes[0].mesh, changes.meshes[0].positions.len()), (0, 4));
        assert_eq!(changes.meshes[0].normals.map(<[Vec3]>::len), Some(4));
    }
    // posed at rest where nothing is animated, mirrored with its skeleton: the front of a triangle stays its front
    let mut doc = bound(true);
    doc.push("nodes", json!({ "name": "left", "children": [1], "scale": [-1, 1, 1] }));
    doc.json["scenes"][0]["nodes"] = json!([0, 3]);
    let scene = doc.load();
    let (to_world, shape) = (scene.instances[0].object_to_world, mesh(&scene, 0));
    assert!(to_world.matrix3.determinant() < 0.0 && shape.indices[0] == [0, 1, 2]);
    for ((p, n), wanted) in shape.positions.iter().zip(&shape.normals).zip(closed_form(0.0)) {
        near(to_world.transform_point3(p.as_dvec3()), wanted * DVec3::new(-1.0, 1.0, 1.0));
        near(n.as_dvec3(), DVec3::new(0.0, 0.6, 0.8));
    }
    // and the same without normals
    let mut doc = bound(false);
    doc.json["nodes"][2]["rotation"] = json!([0, 0, H, H]);
    let scene = doc.load();
    assert!(scene.rig.is_none() && scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    check_positions(&mesh(&scene, 0).positions, &closed_form(FRAC_PI_2));
    assert!(mesh(&scene, 0).normals.is_empty());
    // animated elsewhere: still no cost
    animate(&mut doc, 0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
    assert!(rig(&doc.load()).motion(0).unwrap().is_none(), "its node's transform is ignored");
}

#[test]
fn a_second_set_of_joints_pulls_too() {
    let mut doc = bound(false);
    let joints = doc.accessor(&bytes16(&[[1, 0, 0, 0]; 4]), U16, "VEC4", 4);
    let weights = doc.accessor(&[255, 0, 0, 0].repeat(4), U8, "VEC4", 4);
    doc.json["accessors"][weights]["normalized"] = json!(true);
    doc.first()["attributes"]["JOINTS_1"] = json!(joints);
    doc.first()["attributes"]["WEIGHTS_1"] = json!(weights);
    doc.json["nodes"][2]["translation"] = json!([0, 3, 0]);
    let scene = doc.load();
    // the upper joint is lifted by 2: by its share of all weights
    let shares = [0.5, 1.0 / 3.0, 1.75 / 2.0, 1.0];
    let wanted: Vec<DVec3> = closed_form(0.0).iter().zip(shares).map(|(p, s)| *p + DVec3::Y * 2.0 * s).collect();
    check_positions(&mesh(&scene, 0).positions, &wanted);
}

fn bytes16<const N: usize>(values: &[[u16; N]]) -> Vec<u8> {
    values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

#[test]
fn skeletons_far_away_lose_nothing() {
    let mut doc = bound(false);
    doc.json["nodes"][1]["translation"] = json!([1e7, 0, -3e6]);
    animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    let scene = doc.load();
    let place = scene.instances[0].object_to_world;
    assert_eq!(place.matrix3, DMat3::IDENTITY);
    let pose = pose(&scene, 0.5);
    for (p, wanted) in pose.meshes[0].shape.positions.iter().zip(closed_form(FRAC_PI_2 * 0.5)) {
        let p = place.transform_point3(p.as_dvec3()) - DVec3::new(1e7, 0.0, -3e6);
        assert!((p - wanted).length() < 1e-4, "{p} {wanted}");
    }
}

/// A triangle whose corners two targets move.
fn morphing() -> Doc {
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 3]), F32, "VEC3", 3);
    doc.first()["attributes"]["NORMAL"] = json!(normal);
    let lift = doc.positions(&[[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0; 3]]);
    let tilt = doc.accessor(&bytes(&[[1.0, 0.0, 0.0f32], [0.0; 3], [0.0; 3]]), F32, "VEC3", 3);
    let slide = doc.positions(&[[4.0, 0.0, 0.0]; 3]);
    doc.first()["targets"] = json!([{ "POSITION": lift, "NORMAL": tilt }, { "POSITION": slide }]);
    doc
}

fn morphed(lift: f64, slide: f64) -> [DVec3; 3] {
    let at = |p: [f32; 3], z: f64| Vec3::from_array(p).as_dvec3() + DVec3::new(4.0 * slide, 0.0, z * lift);
    [at(TRIANGLE[0], 1.0), at(TRIANGLE[1], 2.0), at(TRIANGLE[2], 0.0)]
}

#[test]
fn morph_targets_add_up() {
    // as the mesh says, as the node says, and as neither says
    let mut doc = morphing();
    check_positions(&mesh(&doc.load(), 0).positions, &morphed(0.0, 0.0));
    doc.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    let scene = doc.load();
    assert!(scene.rig.is_none() && scene.report.warnings.is_empty());
    check_positions(&mesh(&scene, 0).positions, &morphed(0.5, 0.25));
    near(mesh(&scene, 0).normals[0].as_dvec3(), DVec3::new(0.5, 0.0, 1.0).normalize());
    doc.json["nodes"][0]["weights"] = json!([1.0, -1.0]);
    check_positions(&mesh(&doc.load(), 0).positions, &morphed(1.0, -1.0));

    animate(&mut doc, 0, "weights", "LINEAR", &[0.0, 2.0], &[[0.0], [0.0], [1.0], [0.5]]);
    let scene = doc.load();
    check_positions(&mesh(&scene, 0).positions, &morphed(1.0, -1.0));
    let motion = rig(&scene).motion(0).unwrap();
    assert_eq!((motion.instances, motion.meshes), (vec![], vec![0]));
    let pose = pose(&scene, 1.5);
    check_positions(&pose.meshes[0].shape.positions, &morphed(0.75, 0.375));
    near(pose.meshes[0].shape.normals[0].as_dvec3(), DVec3::new(0.75, 0.0, 1.0).normalize());
    near(pose.meshes[0].shape.normals[1].as_dvec3(), DVec3::Z);
}

#[test]
fn each_use_has_its_own_shape() {
    let mut doc = morphing();
    doc.json["nodes"] = json!([
        { "mesh": 0 }, { "mesh": 0, "weights": [1, 0] }, { "mesh": 0 }, { "mesh": 0, "weights": [1, 0] },
        { "mesh": 0, "weights": [1, 0] },
    ]);
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    animate(&mut doc, 4, "weights", "STEP", &[0.0], &[[0.0], [1.0]]);
    animate(&mut doc, 2, "translation", "STEP", &[0.0], &[[0.0, 1.0, 0.0]]);
    let scene = doc.load();
    let used: Vec<usize> = scene.instances.iter().map(|i| i.mesh).collect();
    assert_eq!(used, [0, 1, 0, 1, 2]);
    let motion = rig(&scene).motion(0).unwrap();
    assert_eq!((motion.instances, motion.meshes), (vec![2], vec![2]));
    check_positions(&mesh(&scene, 0).positions, &morphed(0.0, 0.0));
    check_positions(&mesh(&scene, 1).positions, &morphed(1.0, 0.0));
    check_positions(&pose(&scene, 0.0).meshes[0].shape.positions, &morphed(0.0, 1.0));

    // one mesh on two skeletons
    let mut doc = bound(false);
    doc.push("nodes", json!({ "mesh": 0, "skin": 1 }));
    doc.push("nodes", json!({ "name": "other", "translation": [0, 0, 5] }));
    let skin = json!({ "joints": [4, 4], "inverseBindMatrices": doc.json["skins"][0]["inverseBindMatrices"] });
    doc.push("skins", skin);
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 3, 4]);
    animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    let scene = doc.load();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2));
    assert_eq!(rig(&scene).motion(0).unwrap().meshes, [0]);
    let lifted = |p: &DVec3, bind: f64| *p + DVec3::new(0.0, -bind, 5.0);
    let wanted = closed_form(0.0);
    let wanted = [lifted(&wanted[0], 0.0), lifted(&wanted[1], 0.0), lifted(&wanted[2], 0.75), lifted(&wanted[3], 1.0)];
    check_positions(&mesh(&scene, 1).positions, &wanted);
}

#[test]
fn keys_that_change_nothing_move_nothing() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([
        { "mesh": 0, "translation": [0.1, 0.2, 0.3], "rotation": [0, 0.6, 0, 0.8], "scale": [1, 2, 3] }, { "mesh": 0 },
    ]);
    doc.json["scenes"][0]["nodes"] = json!([0, 1]);
    let zero = [0.0; 3];
    animate(&mut doc, 0, "translation", "LINEAR", &[0.0, 5.0], &[[0.1, 0.2, 0.3]; 2]);
    animate(&mut doc, 0, "rotation", "STEP", &[0.0, 1.0], &[[0.0, -0.6, 0.0, -0.8]; 2]);
    animate(&mut doc, 0, "scale", "CUBICSPLINE", &[0.0], &[zero, [1.0, 2.0, 3.0], zero]);
    let scene = doc.load();
    let mut pose = Pose::default();
    rig(&scene).pose(0, 1.0, Playback::Loop, &mut pose).unwrap();
    // listed, and without an effect
    assert!(rig(&scene).motion(0).unwrap().is_none() && pose.instances.is_empty());
    assert_eq!((rig(&scene).animations().len(), rig(&scene).animations()[0].duration), (1, 5.0));
    animate(&mut doc, 1, "scale", "CUBICSPLINE", &[0.0, 1.0], &[zero, [1.0; 3], zero, [0.1; 3], [1.0; 3], zero]);
    let scene = doc.load();
    assert_eq!(rig(&scene).motion(0).unwrap().instances, [1]);
    assert_eq!(rig(&scene).animations()[0].duration, 5.0);
}

#[test]
fn what_is_scaled_to_nothing_may_grow() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([
        { "mesh": 0, "scale": [0, 0, 0], "translation": [5, 0, 0] },
        { "mesh": 0, "scale": [0, 0, 0] },
        { "mesh": 0, "scale": [2, 2, 0] },
        { "mesh": 0 },
    ]);
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    animate(&mut doc, 0, "scale", "LINEAR", &[0.0, 1.0, 2.0], &[[0.0; 3], [1.0; 3], [2.0, 2.0, 0.0]]);
    animate(&mut doc, 3, "scale", "LINEAR", &[0.0, 1.0], &[[1.0; 3], [0.0; 3]]);
    let scene = doc.load();
    assert_eq!((scene.instances.len(), scene.meshes.len()), (3, 2), "the hidden one is gone, the flat one baked");
    assert_eq!(rig(&scene).motion(0).unwrap().instances, [0, 2]);
    assert!(scene.instances[0].object_to_world.inverse().is_finite());
    for (seconds, first, second) in [(0.0, 0.0, 1.0), (0.25, 0.25, 0.75), (1.0, 1.0, 0.0), (2.0, 2.0, 0.0)] {
        let pose = pose(&scene, seconds);
        for ((_, t), scale) in pose.instances.iter().zip([first, second]) {
            assert!(t.inverse().to_cols_array().iter().all(|x| x.abs() < 1e9), "{seconds} {t:?}");
            near(t.transform_vector3(DVec3::new(1.0, 1.0, 0.0)), DVec3::new(scale, scale, 0.0));
        }
    }
}

/// Meshes and instances that are left out before others: what moves is still called by its name.
#[test]
fn numbers_follow_what_is_left_out() {
    let mut doc = bound(true);
    let flat = doc.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    let good = doc.positions(&TRIANGLE);
    for position in [flat, good] {
        doc.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": position } }] }));
    }
    doc.push("nodes", json!({ "name": "hidden", "mesh": 2, "scale": [0, 0, 0] }));
    doc.push("nodes", json!({ "name": "degenerate", "mesh": 1, "translation": [0, 0, 1] }));
    doc.push("nodes", json!({ "name": "moving", "mesh": 2, "camera": 0 }));
    doc.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    doc.json["scenes"][0]["nodes"] = json!([3, 4, 0, 1, 5]);
    animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    animate(&mut doc, 5, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
    animate(&mut doc, 4, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
    let scene = doc.load();
    let motion = rig(&scene).motion(0).unwrap();
    assert_eq!((scene.instances.len(), scene.meshes.len()), (2, 2));
    assert_eq!(motion.instances.iter().map(|&i| scene.instances[i].name.as_str()).collect::<Vec<_>>(), ["moving"]);
    assert_eq!(motion.meshes.iter().map(|&m| mesh(&scene, m).positions.len()).collect::<Vec<_>>(), [4]);
    let pose = pose(&scene, 1.0);
    near(pose.instances[0].1.translation, DVec3::ONE);
    near(pose.cameras[0].1.translation, DVec3::ONE);
    check_positions(&pose.meshes[0].shape.positions, &closed_form(FRAC_PI_2));
    // a mesh that is a point at rest and grows by its target, on a node that moves, keeps its size
    let mut doc = Doc::new();
    let point = doc.positions(&[[0.0; 3]; 3]);
    let grown = doc.positions(&TRIANGLE);
    doc.primitive(json!({ "attributes": { "POSITION": point }, "targets": [{ "POSITION": grown }] }));
    let other = doc.positions(&TRIANGLE);
    doc.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": other } }] }));
    doc.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 1 }]);
    doc.json["scenes"][0]["nodes"] = json!([0, 1]);
    animate(&mut doc, 0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
    animate(&mut doc, 0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
    let scene = doc.load();
    assert_eq!((scene.triangle_count(), scene.instances[0].object_to_world), (2, DAffine3::IDENTITY));
}

#[test]
fn triangles_that_open_up_are_kept() {
    let mut doc = Doc::new();
    // flat as modelled; the first opens by its target, the second never does, the third names a vertex twice
    let position =
        doc.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [2.0, 0.0, 1.0]]);
    let mut up = [[0.0f32; 3]; 6];
    up[1] = [0.0, 1.0, 0.0];
    let up = doc.positions(&up);
    let indices = doc.accessor(&[0, 1, 2, 3, 4, 5, 0, 0, 4, 0, 3, 5], U8, "SCALAR", 12);
    doc.primitive(
        json!({ "attributes": { "POSITION": position }, "indices": indices, "targets": [{ "POSITION": up }] }),
    );
    animate(&mut doc, 0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
    let scene = doc.load();
    assert_eq!((scene.triangle_count(), scene.report.degenerate_triangles), (2, 2));
    assert_eq!(mesh(&scene, 0).indices[0], [0, 1, 2]);
}

/// Vertices are dropped, copied and put in another order on the way; the corners of triangles end up where they belong.
#[test]
fn mending_keeps_vertices_and_joints_together() {
    for normals in [true, false] {
        let mut doc = bound(normals);
        // the quad's vertices amid many that are not used: its array is compacted
        let offset = 20;
        for (name, width) in [("POSITION", 12), ("NORMAL", 12), ("JOINTS_0", 4), ("WEIGHTS_0", 16)] {
            let Some(accessor) = doc.first()["attributes"][name].as_u64() else { continue };
            let view = doc.json["accessors"][accessor as usize]["bufferView"].as_u64().unwrap() as usize;
            let at = doc.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
            let data = [vec![0; offset * width], doc.bin[at..at + 4 * width].to_vec()].concat();
            doc.json["accessors"][accessor as usize]["bufferView"] = json!(doc.view(&data, None));
            doc.json["accessors"][accessor as usize]["count"] = json!(offset + 4);
        }
        let indices: Vec<u8> = [0, 1, 2, 0, 2, 3].map(|i| i + offset as u8).to_vec();
        doc.first()["indices"] = json!(doc.accessor(&indices, U8, "SCALAR", 6));
        // a normal map without tangents: vertices are split where they disagree
        let image = doc.view(&png(2, 2, [128, 128, 255, 255]), None);
        doc.push("images", json!({ "bufferView": image, "mimeType": "image/png" }));
        doc.push("textures", json!({ "source": 0 }));
        doc.push("materials", json!({ "normalTexture": { "index": 0 } }));
        doc.first()["material"] = json!(0);
        let mut uv = vec![[0.0f32; 2]; offset];
        uv.extend([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.7, 0.1]]);
        doc.first()["attributes"]["TEXCOORD_0"] = json!(doc.accessor(&bytes(&uv), F32, "VEC2", uv.len()));
        animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
        let scene = doc.load();
        let m = mesh(&scene, 0);
        assert!(m.positions.len() > 4 && m.positions.len() < 10, "{}", m.positions.len());
        let wanted = closed_form(FRAC_PI_2);
        let posed = &pose(&scene, 1.0).meshes[0].shape;
        assert_eq!(posed.positions.len(), m.positions.len());
        for (t, corners) in m.indices.iter().zip([[0, 1, 2], [0, 2, 3]]) {
            for (&i, c) in t.iter().zip(corners) {
                near(posed.positions[i as usize].as_dvec3(), wanted[c]);
                near(m.positions[i as usize].as_dvec3(), closed_form(0.0)[c]);
            }
        }
        assert_eq!(m.tangents.len(), m.positions.len());
    }
}

/// The animation is left out, the picture stays.
#[test]
fn broken_channels_are_left_out() {
    let good = || {
        let mut doc = Doc::triangle();
        animate(&mut doc, 0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
        doc
    };
    assert!(good().load().rig.is_some());
    let left_out = |doc: &Doc, says: &str| {
        let scene = doc.load();
        let warnings = scene.report.warnings.join("; ");
        assert!(rig(&scene).motion(0).unwrap().is_none(), "{warnings}");
        assert!(warnings.contains("animation 0 `move`, channel 0"), "{warnings}");
        assert!(warnings.contains(says) && !warnings.contains('\n'), "{says}: {warnings}");
    };
    let change = |path: &str, value: Value| {
        let mut doc = good();
        *doc.json.pointer_mut(path).unwrap() = value;
        doc
    };
    left_out(&change("/animations/0/channels/0/target/node", json!(7)), "node 7 does not exist");
    left_out(&change("/animations/0/channels/0/target/path", json!("colour")), "the path `colour`");
    left_out(&change("/animations/0/channels/0/target/path", json!("weights")), "no mesh with morph targets");
    left_out(&change("/animations/0/channels/0/target/path", json!("rotation")), "accessor 2");
    left_out(&change("/animations/0/channels/0/sampler", json!(3)), "sampler 3 does not exist");
    left_out(&change("/animations/0/samplers/0/interpolation", json!("BOUNCE")), "`BOUNCE`");
    left_out(&change("/animations/0/samplers/0/input", json!(9)), "accessor 9 does not exist");
    left_out(&change("/accessors/2/count", json!(1)), "3 numbers for 2 keys of 3");
    left_out(&change("/accessors/1/count", json!(0)), "no keys");
    left_out(&change("/accessors/1/count", json!(500)), "accessor 1");
    let mut doc = good();
    doc.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    left_out(&doc, "matrix that shears");
    let mut doc = Doc::triangle();
    animate(&mut doc, 0, "translation", "LINEAR", &[f32::NAN, f32::INFINITY], &[[0.0; 3], [1.0; 3]]);
    left_out(&doc, "no keys");
    // a second channel for one target
    let mut doc = good();
    animate(&mut doc, 0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [9.0; 3]]);
    let scene = doc.load();
    assert!(scene.report.warnings[0].contains("channel 1: another channel"), "{:?}", scene.report.warnings);
    near(pose(&scene, 1.0).instances[0].1.translation, DVec3::ONE);
    // KHR_animation_pointer: beside what we play
    let mut doc = good();
    let pointer = json!({ "sampler": 0, "target": { "path": "pointer" } });
    doc.json["animations"][0]["channels"].as_array_mut().unwrap().push(pointer);
    let scene = doc.load();
    assert!(scene.rig.is_some() && scene.report.warnings[0].contains("`pointer`"), "{:?}", scene.report.warnings);
}

/// Not valid and common: played, and said.
#[test]
fn keys_of_careless_exporters_are_played() {
    let two = [[0.0; 3], [1.0; 3]];
    let at = |doc: &Doc, seconds: f64, says: &str| {
        let scene = doc.load();
        let warnings = scene.report.warnings.join("; ");
        assert!(warnings.contains(says), "{says}: {warnings}");
        let mut pose = Pose::default();
        rig(&scene).pose(0, seconds, Playback::Once, &mut pose).unwrap();
        pose.instances.first().map(|i| i.1.translation.x)
    };
    let playing = |times: &[f32], values: &[[f32; 3]]| {
        let mut doc = Doc::triangle();
        animate(&mut doc, 0, "translation", "LINEAR", times, values);
        doc
    };
    // two keys at one time are a jump
    let jump = playing(&[0.0, 1.0, 1.0, 2.0], &[[0.0; 3], [4.0; 3], [6.0; 3], [8.0; 3]]);
    for (seconds, x) in [(0.5, 2.0), (1.0, 6.0), (1.5, 7.0)] {
        assert_eq!(at(&jump, seconds, "more than one key at 1 s"), Some(x));
    }
    assert_eq!(at(&playing(&[2.0, 1.0], &[[3.0; 3], [1.0; 3]]), 1.5, "not in the order"), Some(2.0));
    let three = [[0.0; 3], [9.0; 3], [2.0; 3]];
    assert_eq!(at(&playing(&[0.0, f32::NAN, 2.0], &three), 1.0, "1 keys have a time"), Some(1.0));
    assert_eq!(
        at(&playing(&[0.0, 1.0, 2.0], &[two[0], [f32::NAN; 3], [2.0; 3]]), 1.0, "not finite: left out"),
        Some(1.0)
    );
    // the matrix of a node that is animated is one of a translation, a rotation and a scale
    let mut doc = playing(&[0.0, 1.0], &two);
    doc.json["nodes"][0]["matrix"] = json!([0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 7, 0, 0, 1]);
    let scene = doc.load();
    near(scene.instances[0].object_to_world.transform_vector3(DVec3::X), DVec3::new(0.0, 2.0, 0.0));
    assert_eq!(at(&doc, 0.25, "taken apart"), Some(0.25));
}

/// Geometry that makes no sense is refused, as it is elsewhere.
#[test]
fn broken_skins_and_targets_are_errors() {
    let refused = |doc: &Doc, says: &str| {
        let text = doc.error();
        assert!(text.contains(says), "{says}: {text}");
        assert_eq!(doc.try_load().map(|_| ()).unwrap_err().exit_code(), 3);
    };
    let change = |path: &str, value: Value| {
        let mut doc = bound(false);
        *doc.json.pointer_mut(path).unwrap() = value;
        doc
    };
    refused(&change("/nodes/0/skin", json!(4)), "skin 4 does not exist");
    refused(&change("/skins/0/joints", json!([1, 77])), "skin 0: joint node 77 does not exist");
    refused(&change("/skins/0/joints", json!([])), "no joints");
    refused(&change("/skins/0/joints", json!([1])), "vertex 2 is bound to joint 1 of only 1");
    refused(&change("/skins/0/joints", json!([1, 2, 2])), "2 inverse bind matrices for 3 joints");
    refused(&change("/accessors/1/count", json!(3)), "accessor 1 has 3 elements for 4 vertices");
    refused(&change("/accessors/2/type", json!("VEC3")), "accessor 2");
    refused(&change("/skins/0/inverseBindMatrices", json!(0)), "accessor 0");
    for (weight, at) in [(f32::NAN, 16), (-1.0, 16)] {
        let mut doc = bound(false);
        let start = doc.json["bufferViews"][2]["byteOffset"].as_u64().unwrap() as usize + at;
        doc.bin[start..start + 4].copy_from_slice(&weight.to_le_bytes());
        refused(&doc, "a weight of vertex 1 is not finite, or below zero");
    }
    let mut doc = bound(false);
    let start = doc.json["bufferViews"][4]["byteOffset"].as_u64().unwrap() as usize;
    doc.bin[start..start + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    refused(&doc, "inverse bind matrix 0");

    let mut doc = morphing();
    doc.json["meshes"][0]["weights"] = json!([1, 1]);
    let target = doc.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"].as_u64().unwrap() as usize;
    let mut short = Doc { json: doc.json.clone(), bin: doc.bin.clone() };
    short.json["accessors"][target]["count"] = json!(2);
    refused(&short, "2 elements for 3 vertices");
    let view = doc.json["accessors"][target]["bufferView"].as_u64().unwrap() as usize;
    let start = doc.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    doc.bin[start..start + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    refused(&doc, "morph target 0 is not finite at vertex 0");

    // a mesh without joints on a node with a skin is shown as it is
    let mut doc = bound(false);
    doc.first()["attributes"].as_object_mut().unwrap().remove("JOINTS_0");
    let scene = doc.load();
    assert!(scene.report.warnings[0].contains("no joints and weights"), "{:?}", scene.report.warnings);
    near(scene.instances[0].object_to_world.translation, DVec3::X * 100.0);
}

#[test]
fn models_of_other_scenes_stand_still() {
    let folder = Folder::new();
    let mut doc = bound(false);
    doc.json["nodes"][2]["rotation"] = json!([0, 0, H, H]);
    animate(&mut doc, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    folder.write("model.glb", doc.glb());
    let scene = folder.load("a.brhan", "Model file[model.glb] translate[1 2 3]\n").unwrap();
    assert!(scene.rig.is_none() && scene.report.warnings[0].contains("not played"), "{:?}", scene.report.warnings);
    check_positions(&mesh(&scene, 0).positions, &closed_form(FRAC_PI_2));
    near(scene.instances[0].object_to_world.translation, DVec3::new(1.0, 2.0, 3.0));
}

/// Two scenes play alike, bit by bit.
fn same_animations(a: &Scene, b: &Scene) {
    let (x, y) = (rig(a), rig(b));
    assert_eq!(x.animations().len(), y.animations().len());
    assert_eq!(
        (a.instances.len(), a.meshes.len(), a.cameras.len()),
        (b.instances.len(), b.meshes.len(), b.cameras.len())
    );
    for (p, q) in a.instances.iter().zip(&b.instances) {
        assert_eq!((&p.name, p.mesh, p.object_to_world), (&q.name, q.mesh, q.object_to_world));
    }
    for m in 0..a.meshes.len() {
        assert_eq!((&mesh(a, m).positions, &mesh(a, m).normals), (&mesh(b, m).positions, &mesh(b, m).normals));
        assert_eq!((&mesh(a, m).indices, &mesh(a, m).tangents), (&mesh(b, m).indices, &mesh(b, m).tangents));
    }
    let (mut p, mut q) = (Pose::default(), Pose::default());
    for k in 0..x.animations().len() {
        let (first, second) = (&x.animations()[k], &y.animations()[k]);
        assert_eq!((&first.name, first.duration), (&second.name, second.duration));
        assert_eq!(x.motion(k).unwrap(), y.motion(k).unwrap());
        for step in 0..7 {
            let t = first.duration * f64::from(step) / 6.0 + 0.01;
            x.pose(k, t, Playback::Loop, &mut p).unwrap();
            y.pose(k, t, Playback::Loop, &mut q).unwrap();
            assert_eq!((&p.instances, &p.meshes), (&q.instances, &q.meshes));
            assert_eq!(p.cameras, q.cameras);
        }
    }
}

#[test]
fn animations_round_trip() {
    let folder = Folder::new();
    let mut rich = bound(true);
    // a morphing, skinned mesh of two primitives on a node that moves, beside one that stays under a node that does not
    let up = rich.positions(&[[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 3]]);
    rich.first()["targets"] = json!([{ "POSITION": up }, {}]);
    let other = rich.first().clone();
    rich.primitive(other);
    rich.push(
        "nodes",
        json!({ "name": "group", "children": [4, 5, 6], "matrix": [2,0,0,0, 0,2,0,0, 0,0,2,0, 1,2,3,1] }),
    );
    rich.push("nodes", json!({ "name": "still", "mesh": 1, "rotation": [0.1, 0.2, 0.3, 0.927] }));
    rich.push("nodes", json!({ "name": "moving", "mesh": 1, "camera": 0 }));
    rich.push("nodes", json!({ "name": "still too", "mesh": 1, "children": [7] }));
    rich.push("nodes", json!({ "name": "last", "mesh": 1 }));
    let flat = rich.positions(&TRIANGLE);
    rich.push("meshes", json!({ "name": "flat", "primitives": [{ "attributes": { "POSITION": flat } }] }));
    rich.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    rich.json["scenes"][0]["nodes"] = json!([3, 0, 1]);
    rich.json["nodes"][0]["weights"] = json!([0.5, 0]);
    animate(&mut rich, 0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [0.3]]);
    animate(&mut rich, 5, "translation", "STEP", &[0.0, 1.0], &[[0.1, 0.2, 0.3], [1.0; 3]]);
    animate(
        &mut rich,
        7,
        "scale",
        "CUBICSPLINE",
        &[0.0, 1.0],
        &[[0.0; 3], [0.0; 3], [0.0; 3], [1.0; 3], [0.5; 3], [0.0; 3]],
    );
    animate(&mut rich, 2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(0.0, 0.0, 1.0)]);
    // a channel of which nothing will be left says how long it lasts
    rich.push("nodes", json!({ "name": "nothing" }));
    rich.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(8));
    animate(&mut rich, 8, "translation", "LINEAR", &[0.0, 7.0], &[[0.0; 3], [1.0; 3]]);
    let rich = rich.load();
    assert!(rich.report.warnings.is_empty(), "{:?}", rich.report.warnings);
    assert_eq!((rich.instances.len(), rig(&rich).animations()[0].duration), (6, 7.0));
    let parade = by_name("parade").unwrap();
    for (original, name) in [(rich, "rich"), (parade, "parade")] {
        let mut before = original;
        for extension in ["glb", "gltf"] {
            let path = folder.path(&format!("{name}.{extension}"));
            export_gltf(&before, &path).unwrap();
            let loaded = load(&path).unwrap();
            assert!(loaded.report.warnings.is_empty(), "{name}: {:?}", loaded.report.warnings);
            if name == "rich" || extension == "gltf" {
                same_animations(&before, &loaded);
            }
            before = loaded;
        }
    }
}

/// A light on a node moves and turns with it and what is above it, and with nothing else; exporters keep it there.
#[test]
fn lights_on_animated_nodes() {
    let folder = Folder::new();
    let mut doc = Doc::triangle();
    doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "name": "lamp", "type": "spot", "intensity": 3, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } },
        { "name": "fixed", "type": "point", "intensity": 2 },
    ] } });
    doc.push("nodes", json!({ "name": "arm", "children": [2], "translation": [1, 2, 3] }));
    doc.push(
        "nodes",
        json!({ "name": "lamp", "translation": [0, 1, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    );
    doc.push(
        "nodes",
        json!({ "name": "fixed", "translation": [5, 5, 5], "extensions": { "KHR_lights_punctual": { "light": 1 } } }),
    );
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 3]);
    animate(&mut doc, 1, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, quarter(1.0, 0.0, 0.0)]);
    let mut scene = doc.load();
    for round in 0..3 {
        assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
        assert_eq!(scene.lights.len(), 2);
        let lamp = scene.lights.iter().position(|l| l.name == "lamp").unwrap();
        assert_eq!(rig(&scene).moving_lights(0).unwrap(), [lamp]);
        for (seconds, position, direction) in [
            (0.0, DVec3::new(1.0, 3.0, 3.0), DVec3::NEG_Z),
            // the arm has turned by a quarter about x
            (1.0, DVec3::new(1.0, 2.0, 4.0), DVec3::Y),
        ] {
            let mut posed = scene.clone();
            pose(&scene, seconds).apply(&mut posed);
            let light = &posed.lights[lamp];
            assert!(light.position.abs_diff_eq(position, 1e-6), "{round}: {}", light.position);
            assert!(light.direction.abs_diff_eq(direction, 1e-6), "{round}: {}", light.direction);
            assert_eq!(posed.lights[1 - lamp], scene.lights[1 - lamp]);
        }
        let path = folder.path(&format!("{round}.gltf"));
        export_gltf(&scene, &path).unwrap();
        scene = load(&path).unwrap();
    }
}

/// The built-in parade and the file agree, but for the rounding of angles and inverse bind matrices.
#[test]
fn the_parade_in_its_file() {
    let (ours, file) = (by_name("parade").unwrap(), load(&std::path::PathBuf::from("scenes/parade.glb")).unwrap());
    assert!(file.report.warnings.is_empty() && file.report.degenerate_triangles == 0, "{:?}", file.report);
    assert_eq!(rig(&ours).animations().len(), 2);
    assert_eq!(ours.triangle_count(), file.triangle_count());
    assert!((2000..3000).contains(&ours.triangle_count()), "{}", ours.triangle_count());
    for animation in 0..2 {
        let motion = rig(&ours).motion(animation).unwrap();
        assert_eq!(motion, rig(&file).motion(animation).unwrap());
        let names = |list: &[usize]| list.iter().map(|&i| ours.instances[i].name.as_str()).collect::<Vec<_>>();
        let all = ["slider", "rider", "axle", "arm", "arm", "arm", "ball"];
        assert_eq!(names(&motion.instances), if animation == 0 { &all[..] } else { &[] });
        let meshes: Vec<&str> = motion.meshes.iter().map(|&m| ours.meshes[m].name.as_str()).collect();
        assert_eq!(meshes, if animation == 0 { &["column", "ball"][..] } else { &["column"] });
        assert_eq!(rig(&ours).moving_cameras(animation).unwrap(), if animation == 0 { &[1][..] } else { &[] });
        let (mut p, mut q, mut seam) = (Pose::default(), Pose::default(), Pose::default());
        for step in 0..10 {
            let t = 0.23 * f64::from(step);
            rig(&ours).pose(animation, t, Playback::Loop, &mut p).unwrap();
            rig(&file).pose(animation, t, Playback::Loop, &mut q).unwrap();
            assert!(p.instances.iter().zip(&q.instances).all(|(a, b)| a.0 == b.0 && a.1.abs_diff_eq(b.1, 1e-6)));
            for (a, b) in p.meshes.iter().zip(&q.meshes) {
                assert!(a.shape.positions.iter().zip(&b.shape.positions).all(|(a, b)| a.abs_diff_eq(*b, 1e-6)));
                assert!(a.shape.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6));
            }
        }
        // the end is the beginning
        rig(&ours).pose(animation, 0.0, Playback::Once, &mut p).unwrap();
        rig(&ours).pose(animation, 2.0, Playback::Once, &mut seam).unwrap();
        assert!(p.instances.iter().zip(&seam.instances).all(|(a, b)| a.1.abs_diff_eq(b.1, 1e-6)));
        assert!(p.cameras.iter().zip(&seam.cameras).all(|(a, b)| a.1.abs_diff_eq(b.1, 1e-6)));
        for (a, b) in p.meshes.iter().zip(&seam.meshes) {
            assert!(a.shape.positions.iter().zip(&b.shape.positions).all(|(a, b)| a.abs_diff_eq(*b, 1e-5)));
        }
    }
    // a pose that is applied is the scene
    let mut p = Pose::default();
    rig(&ours).pose(0, 0.7, Playback::Loop, &mut p).unwrap();
    let mut posed = ours.clone();
    p.apply(&mut posed);
    for (i, t) in &p.instances {
        assert_eq!(posed.instances[*i].object_to_world, *t);
    }
    for m in &p.meshes {
        assert_eq!(mesh(&posed, m.mesh).positions, m.shape.positions);
    }
}
