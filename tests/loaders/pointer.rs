//! `KHR_animation_pointer`: values at times between keys, against values by hand.

use glam::{DQuat, DVec3, Vec3, Vec4};
use serde_json::{Value, json};
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::material::AlphaMode;
use skylit::scene::{LightKind, Projection, Scene, SceneSettings};

use crate::build::*;

/// Adds a channel with a pointer to animation 0, which is made when it is not there. `shape`: the component type of the values, whether they are normalized, and their type.
fn animate(doc: &mut Doc, pointer: &str, keys: (&str, &[f32]), values: &[u8], shape: (u32, bool, &str), count: usize) {
    let (interpolation, times) = keys;
    let input = doc.accessor(&bytes(&times.iter().map(|t| [*t]).collect::<Vec<_>>()), F32, "SCALAR", times.len());
    let output = doc.accessor(values, shape.0, shape.2, count);
    if shape.1 {
        doc.json["accessors"][output]["normalized"] = json!(true);
    }
    if doc.json["animations"].is_null() {
        doc.push("animations", json!({ "samplers": [], "channels": [] }));
    }
    let animation = &mut doc.json["animations"][0];
    let samplers = animation["samplers"].as_array_mut().unwrap();
    samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
    let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
    let channel = json!({ "sampler": samplers.len() - 1, "target": target });
    animation["channels"].as_array_mut().unwrap().push(channel);
}

/// As [`animate`], from one value at 1 s to another at 3 s, in floats.
fn linear<const N: usize>(doc: &mut Doc, pointer: &str, from: [f32; N], to: [f32; N]) {
    let shape = (F32, false, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1]);
    animate(doc, pointer, ("LINEAR", &[1.0, 3.0]), &bytes(&[from, to]), shape, 2);
}

/// The scene as it is so many seconds after the beginning.
fn posed(scene: &Scene, seconds: f64) -> Scene {
    let rig = scene.rig.as_ref().unwrap_or_else(|| panic!("no rig: {:?}", scene.report.warnings));
    let mut pose = Pose::default();
    // a pose is overwritten, whatever it held
    rig.pose(0, 2.9, Playback::Once, &mut pose).unwrap();
    rig.pose(0, seconds, Playback::Once, &mut pose).unwrap();
    let mut posed = scene.clone();
    pose.apply(&mut posed);
    posed
}

fn with_material(material: Value) -> Doc {
    let mut doc = Doc::triangle();
    doc.json["extensionsUsed"] = json!(["KHR_animation_pointer"]);
    doc.push("materials", material);
    doc.first()["material"] = json!(0);
    doc
}

fn assert_near(a: &[f32], b: &[f32]) {
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
}

#[test]
fn materials_change() {
    let mut doc = with_material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] },
        "emissiveFactor": [0.5, 0.25, 0],
        "alphaMode": "MASK",
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 2 }, "KHR_materials_sheen": {} },
    }));
    linear(&mut doc, "/materials/0/pbrMetallicRoughness/baseColorFactor", [1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.5, 0.0]);
    linear(&mut doc, "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength", [2.0], [6.0]);
    linear(&mut doc, "/materials/0/alphaCutoff", [0.5], [0.9]);
    // out of range at the end: the nearest value that is possible
    linear(&mut doc, "/materials/0/pbrMetallicRoughness/metallicFactor", [0.0], [2.0]);
    // normalized bytes
    let sheen = "/materials/0/extensions/KHR_materials_sheen/sheenColorFactor";
    let colours = [0, 255, 51, 0, 255, 51, 51, 0, 0, 255, 51, 0];
    animate(&mut doc, sheen, ("STEP", &[0.0, 1.0, 2.0, 3.0]), &colours, (U8, true, "VEC3"), 4);
    // a spline: the values of `cubic_by_hand` of src/scene/animation/sampler.rs, over ten
    let spline = [0.9, 0.2, 0.1, -0.2, 0.5, 0.9].map(|v: f32| [v]);
    let roughness = "/materials/0/pbrMetallicRoughness/roughnessFactor";
    animate(&mut doc, roughness, ("CUBICSPLINE", &[1.0, 3.0]), &bytes(&spline), (F32, false, "SCALAR"), 6);
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!(scene.rig.as_ref().unwrap().animations()[0].duration, 3.0);
    assert_eq!(scene.materials[0].emissive, Vec3::new(1.0, 0.5, 0.0));

    let at = |seconds| posed(&scene, seconds).materials[0].clone();
    let m = at(1.5);
    assert_near(&m.base_color.to_array(), &[0.75, 0.25, 0.125, 0.75]);
    assert_near(&m.emissive.to_array(), &[1.5, 0.75, 0.0]);
    assert_near(&[m.metallic, m.roughness], &[0.5, 0.293_75]);
    assert_eq!(m.alpha_mode, AlphaMode::Mask { cutoff: 0.6 });
    assert_near(&m.sheen.color.to_array(), &[0.0, 1.0, 0.2]);
    let m = at(2.5);
    assert_near(&m.base_color.to_array(), &[0.25, 0.75, 0.375, 0.25]);
    assert_eq!(m.metallic, 1.0);
    assert_near(&m.sheen.color.to_array(), &[0.2, 0.0, 0.0]);
    assert_eq!(at(9.0).base_color, Vec4::new(0.0, 1.0, 0.5, 0.0));
    assert_eq!((at(0.5).sheen.color.y, at(0.0).roughness), (1.0, 0.2));

    // what tracers are told of: the ends of all ranges
    let motion = scene.rig.as_ref().unwrap().motion(0).unwrap();
    let states = &motion.materials[&0];
    assert!(motion.is_none() && motion.lights.is_empty());
    assert!(states.iter().any(|m| m.base_color.w == 0.0) && states.iter().any(|m| m.base_color.w == 1.0));
    assert!(states.iter().all(|m| m.roughness <= 0.2) && states.iter().any(|m| m.emissive.x == 3.0), "{states:?}");
}

#[test]
fn texture_coordinates_are_transformed() {
    let mut doc = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0,
        "extensions": { "KHR_texture_transform": { "offset": [0.5, 0], "scale": [2, 4] } } } } }));
    doc.push("textures", json!({ "source": 0 }));
    let uri = format!("data:image/png;base64,{}", base64(&png(1, 1, [255; 4])));
    doc.push("images", json!({ "uri": uri }));
    let transform = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform";
    linear(&mut doc, &format!("{transform}/offset"), [0.5, 0.0], [1.5, 1.0]);
    linear(&mut doc, &format!("{transform}/rotation"), [0.0], [std::f32::consts::PI]);
    let scene = doc.load();
    // half way it has turned by a quarter: u points to where -v was
    let slot = posed(&scene, 2.0).materials[0].base_color_texture.unwrap();
    for (uv, expected) in [([1.0, 0.0], [1.0, 0.5 - 2.0]), ([0.0, 1.0], [1.0 + 4.0, 0.5])] {
        let got = slot.transform.transform_point2(uv.into());
        assert_near(&got.to_array(), &expected);
    }
}

#[test]
fn lights_cameras_and_nodes_change() {
    let mut doc = Doc::triangle();
    doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "intensity": 3, "color": [1, 0.5, 0], "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } },
        { "type": "point", "intensity": 2 },
    ] } });
    doc.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    doc.push(
        "cameras",
        json!({ "type": "orthographic", "orthographic": { "xmag": 2, "ymag": 1, "znear": 0.1, "zfar": 9 } }),
    );
    let light = |k: usize| json!({ "KHR_lights_punctual": { "light": k } });
    // one light on two nodes, one of which turns
    doc.push("nodes", json!({ "extensions": light(0), "translation": [1, 0, 0], "camera": 0 }));
    doc.push("nodes", json!({ "extensions": light(0), "translation": [2, 0, 0], "camera": 1 }));
    doc.push("nodes", json!({ "extensions": light(1) }));
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let spot = "/extensions/KHR_lights_punctual/lights/0";
    linear(&mut doc, &format!("{spot}/intensity"), [3.0], [5.0]);
    linear(&mut doc, &format!("{spot}/color"), [1.0, 0.5, 0.0], [0.0, 0.5, 1.0]);
    linear(&mut doc, &format!("{spot}/spot/outerConeAngle"), [0.5], [0.05]);
    linear(&mut doc, "/cameras/0/perspective/yfov", [0.7], [0.9]);
    linear(&mut doc, "/cameras/1/orthographic/ymag", [1.0], [4.0]);
    linear(&mut doc, "/cameras/1/orthographic/xmag", [1.0], [4.0]);
    linear(&mut doc, "/nodes/1/translation", [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]);
    let h = std::f32::consts::FRAC_1_SQRT_2;
    // not of unit length: rotations are normalised
    linear(&mut doc, "/nodes/2/rotation", [0.0, 0.0, 0.0, 2.0], [h, 0.0, 0.0, h]);
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);

    let rig = scene.rig.as_ref().unwrap();
    assert_eq!(rig.motion(0).unwrap().lights, [0, 1]);
    assert_eq!((rig.moving_lights(0).unwrap(), rig.moving_cameras(0).unwrap()), (vec![0, 1], vec![0, 1]));
    assert!(rig.changes_light(0).unwrap());
    let at = posed(&scene, 2.0);
    for light in &at.lights[..2] {
        assert_near(&light.intensity.to_array(), &[2.0, 2.0, 2.0]);
        assert!(
            matches!(light.kind, LightKind::Spot { inner_angle: 0.1, outer_angle } if (outer_angle - 0.275).abs() < 1e-6)
        );
    }
    assert_eq!(at.lights[2], scene.lights[2]);
    assert!((at.lights[0].position - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-6);
    let turned = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_4) * DVec3::NEG_Z;
    assert!((at.lights[1].direction - turned).length() < 1e-6, "{}", at.lights[1].direction);
    // the inner angle never exceeds the outer one
    let end = posed(&scene, 3.0);
    assert_eq!(end.lights[0].kind, LightKind::Spot { inner_angle: 0.05, outer_angle: 0.05 });
    assert!(matches!(at.cameras[0].projection, Projection::Perspective { fov_y } if (fov_y - 0.8).abs() < 1e-6));
    assert!(
        matches!(at.cameras[1].projection, Projection::Orthographic { half_height } if (half_height - 2.5).abs() < 1e-6)
    );
    assert_eq!(at.cameras[1].clip, scene.cameras[1].clip);
}

#[test]
fn nodes_are_hidden_and_shown() {
    let mut doc = Doc::triangle();
    doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 2 }] } });
    let visible = |visible: bool| json!({ "KHR_node_visibility": { "visible": visible } });
    // node 1, hidden at rest, above node 2 with mesh and light; node 3 is hidden and stays so; node 0 always shown
    doc.push("nodes", json!({ "children": [2], "extensions": visible(false) }));
    doc.push(
        "nodes",
        json!({ "mesh": 0, "translation": [5, 0, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    );
    doc.push("nodes", json!({ "mesh": 0, "extensions": visible(false) }));
    doc.json["scenes"][0]["nodes"] = json!([0, 1, 3]);
    let pointer = "/nodes/1/extensions/KHR_node_visibility/visible";
    animate(&mut doc, pointer, ("STEP", &[0.0, 1.0, 2.0]), &[0, 1, 0], (U8, false, "SCALAR"), 3);
    let scene = doc.load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!((scene.instances.len(), scene.lights.len()), (2, 1));
    let hidden = |scene: &Scene| scene.hidden.iter().copied().collect::<Vec<_>>();
    let light = |scene: &Scene| scene.lights[0].intensity.x;
    let child = scene.instances.iter().position(|i| i.object_to_world.translation.x == 5.0).unwrap();
    assert_eq!((hidden(&scene), light(&scene)), (vec![child], 0.0));
    for (seconds, shown) in [(0.5, false), (1.0, true), (1.9, true), (2.0, false), (9.0, false)] {
        let at = posed(&scene, seconds);
        assert_eq!((hidden(&at).is_empty(), light(&at) > 0.0), (shown, shown), "{seconds}");
    }
    let motion = scene.rig.as_ref().unwrap().motion(0).unwrap();
    assert_eq!((motion.instances, motion.lights), (vec![child], vec![0]));
}

/// Copies of a material change with it: those for other sets of texture coordinates, and what a variant chooses.
#[test]
fn copies_of_materials_change() {
    let mut doc = with_material(json!({}));
    doc.push("materials", json!({ "name": "other" }));
    doc.json["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "a" }, { "name": "b" }] } });
    let mappings = json!([{ "material": 1, "variants": [1] }]);
    doc.first()["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
    linear(&mut doc, "/materials/1/pbrMetallicRoughness/roughnessFactor", [0.0], [1.0]);
    let mut scene = doc.load();
    let shown = |scene: &Scene| scene.materials[scene.meshes[0].material].roughness;
    for (variant, expected) in [(None, 1.0), (Some("b"), 0.5), (Some("a"), 1.0)] {
        let settings = SceneSettings { variant: variant.map(str::to_owned), ..SceneSettings::default() };
        settings.apply(&mut scene).unwrap();
        let at = posed(&scene, 2.0);
        assert_eq!(shown(&at), expected, "{variant:?}");
        // it is still the material that a setting may choose anew
        assert_eq!(at.materials[scene.meshes[0].material].variants, scene.materials[scene.meshes[0].material].variants);
        let motion = scene.rig.as_ref().unwrap().motion(0).unwrap();
        assert_eq!(motion.materials.contains_key(&scene.meshes[0].material), variant == Some("b"));
    }
}

#[test]
fn unknown_pointers_are_named_and_the_rest_plays() {
    let mut doc = with_material(json!({}));
    linear(&mut doc, "/materials/0/pbrMetallicRoughness/roughnessFactor", [0.0], [1.0]);
    for pointer in [
        "/materials/0/extensions/KHR_materials_dispersion/dispersion",
        "/materials/7/alphaCutoff",
        "/meshes/0/weights",
        "/nodes/9/translation",
    ] {
        linear(&mut doc, pointer, [0.0], [1.0]);
    }
    // twice the same, and a boolean between two values
    linear(&mut doc, "/materials/0/pbrMetallicRoughness/roughnessFactor", [0.0], [0.1]);
    linear(&mut doc, "/nodes/0/extensions/KHR_node_visibility/visible", [0.0], [1.0]);
    let scene = doc.load();
    let expected = [
        "channel 1: the pointer `/materials/0/extensions/KHR_materials_dispersion/dispersion` names nothing that skylit animates: left out",
        "channel 2: material 7 does not exist (the file has 1): left out",
        "channel 3: the pointer `/meshes/0/weights` names nothing",
        "channel 4: node 9 does not exist: left out",
        "channel 5: another channel has the same target: left out",
        "channel 6: the pointer `/nodes/0/extensions/KHR_node_visibility/visible` needs the interpolation STEP: left out",
    ];
    let warnings = &scene.report.warnings;
    assert_eq!(warnings.len(), expected.len(), "{warnings:?}");
    for (warning, text) in warnings.iter().zip(expected) {
        assert!(warning.contains(text), "{warning}");
    }
    assert_eq!(posed(&scene, 2.0).materials[0].roughness, 0.5);
}
