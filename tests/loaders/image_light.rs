//! `EXT_lights_image_based`: the environment of a scene.

use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use skylit::integrators::lighting::LightingSettings;
use skylit::scene::{Environment, EnvironmentMap, Scene};

use crate::build::*;

/// A document whose scene has an image-based light with these faces, in the order of the specification.
fn lit(faces: &[Vec<u8>], light: Value) -> Doc {
    let mut doc = Doc::triangle();
    for face in faces {
        let uri = format!("data:image/png;base64,{}", base64(face));
        doc.push("images", json!({ "uri": uri }));
    }
    let mut all = json!({ "irradianceCoefficients": [], "specularImages": [], "specularImageSize": 4 });
    if !faces.is_empty() {
        all["specularImages"] = json!([(0..faces.len()).collect::<Vec<_>>()]);
    }
    light.as_object().unwrap().iter().for_each(|(key, value)| all[key] = value.clone());
    doc.json["extensionsUsed"] = json!(["EXT_lights_image_based"]);
    doc.json["extensions"] = json!({ "EXT_lights_image_based": { "lights": [all] } });
    doc.json["scenes"][0]["extensions"] = json!({ "EXT_lights_image_based": { "light": 0 } });
    doc
}

fn map(scene: &Scene) -> &EnvironmentMap {
    match &scene.environment {
        Environment::Map(map) => map,
        other => panic!("{other:?}: {:?}", scene.report.warnings),
    }
}

/// Radiance from a direction of the world.
fn radiance(map: &EnvironmentMap, direction: DVec3) -> Vec3 {
    let d = map.to_map * direction;
    let (u, v) = (0.5 + d.x.atan2(-d.z) / std::f64::consts::TAU, d.y.clamp(-1.0, 1.0).acos() / std::f64::consts::PI);
    let pixel = |x: f64, n: u32| ((x * f64::from(n)) as u32).min(n - 1);
    map.factor * map.radiance[(pixel(v, map.height) * map.width + pixel(u, map.width)) as usize]
}

const AXES: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];

/// Six faces of one colour each: 1 and 0 are the same in sRGB and linear.
fn faces() -> (Vec<Vec<u8>>, Vec<Vec3>) {
    let colours = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [255, 0, 255], [0, 255, 255]];
    let face = |[r, g, b]: [u8; 3]| png(4, 4, [r, g, b, 255]);
    (colours.map(face).to_vec(), colours.map(|c| Vec3::from(c.map(|v| f32::from(v) / 255.0))).to_vec())
}

#[test]
fn faces_lie_where_they_belong() {
    let (faces, colours) = faces();
    let scene = lit(&faces, json!({ "intensity": 3 })).load();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    for (axis, colour) in AXES.iter().zip(&colours) {
        assert_eq!(radiance(map(&scene), *axis), *colour * 3.0, "{axis}");
    }
    // a face is a sixth of the sphere: the mean over solid angle is that of the faces
    let map = map(&scene);
    let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
    for y in 0..map.height {
        let w = (std::f32::consts::PI * (y as f32 + 0.5) / map.height as f32).sin();
        for x in 0..map.width {
            sum += w * map.radiance[(y * map.width + x) as usize];
            weight += w;
        }
    }
    assert!((sum / weight - Vec3::splat(0.5)).abs().max_element() < 0.01, "{}", sum / weight);
}

#[test]
fn it_is_turned_and_replaced() {
    let (faces, colours) = faces();
    let h = std::f64::consts::FRAC_1_SQRT_2;
    // a quarter turn about y takes +x to -z, and +z to +x
    let mut scene = lit(&faces, json!({ "rotation": [0, h, 0, h] })).load();
    assert_eq!(radiance(map(&scene), DVec3::NEG_Z), colours[0]);
    assert_eq!(radiance(map(&scene), DVec3::X), colours[4]);
    assert_eq!(radiance(map(&scene), DVec3::Y), colours[2]);
    let settings = LightingSettings { environment: Some("0.5,0.5,0.5".into()), ..LightingSettings::default() };
    settings.apply(&mut scene).unwrap();
    assert_eq!(scene.environment, Environment::Uniform(Vec3::splat(0.5)));
}

/// Alpha of a PNG divides its colours, which are sRGB (RGBD).
#[test]
fn alpha_divides() {
    let scene = lit(&vec![png(2, 2, [188, 255, 0, 51]); 6], json!({})).load();
    let got = radiance(map(&scene), DVec3::X);
    // sRGB 188 is 0.5029 linear, and 51 of 255 a fifth
    assert!((got - Vec3::new(5.0 * 0.502_886_5, 5.0, 0.0)).abs().max_element() < 1e-4, "{got}");
}

/// Without images the coefficients are the environment: constant irradiance of pi is a radiance of 1.
#[test]
fn coefficients_stand_in() {
    let mut coefficients = vec![[0.0; 3]; 9];
    coefficients[0] = [2.0 * std::f64::consts::PI.powf(1.5); 3];
    let (faces, _) = faces();
    for (faces, said) in [
        (vec![], "has no specular images: its irradiance coefficients are the environment"),
        (faces[..5].to_vec(), "its first level has 5 images, not 6"),
        (
            vec![png(2, 2, [255; 4]), png(4, 4, [255; 4]), vec![1, 2, 3], vec![], vec![], vec![]],
            "image 1 is 4x4: all must be square and of one size",
        ),
    ] {
        let scene = lit(&faces, json!({ "irradianceCoefficients": coefficients, "intensity": 2 })).load();
        assert!(scene.report.warnings.iter().any(|w| w.contains(said)), "{said}: {:?}", scene.report.warnings);
        for axis in AXES {
            assert!((radiance(map(&scene), axis) - 2.0).abs().max_element() < 1e-5);
        }
    }
}

#[test]
fn what_is_broken_is_said() {
    let dark = |doc: Doc, text: &str| {
        let scene = doc.load();
        assert_eq!(scene.environment, Environment::Black);
        assert!(scene.report.warnings.iter().any(|w| w.contains(text)), "{:?}", scene.report.warnings);
    };
    let (faces, _) = faces();
    dark(lit(&[], json!({})), "EXT_lights_image_based: has 0 irradiance coefficients, not 9: ignored");
    dark(lit(&faces, json!({ "intensity": -1 })), "an intensity of -1: ignored");
    dark(lit(&faces, json!({ "specularImages": "all" })), "EXT_lights_image_based: ");
    let mut doc = lit(&faces, json!({}));
    doc.json["scenes"][0]["extensions"]["EXT_lights_image_based"]["light"] = json!(1);
    dark(doc, "light 1 does not exist (the file has 1): ignored");
    // a light that the scene does not name is none
    let mut doc = lit(&faces, json!({}));
    doc.json["scenes"][0].as_object_mut().unwrap().remove("extensions");
    let scene = doc.load();
    assert!(scene.environment == Environment::Black && scene.report.warnings.is_empty());
}
