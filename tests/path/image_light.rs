//! The image-based light of a glTF file (EXT_lights_image_based) as paths see it.

use super::*;
use serde_json::json;
use skylit::scene::load::load;

/// A file whose faces have one grey each, and a triangle far below.
fn lit_scene(folder: &std::path::Path, greys: [u8; 6], intensity: f64) -> Scene {
    let mut images = Vec::new();
    for (k, grey) in greys.into_iter().enumerate() {
        let name = format!("face{k}.png");
        image::RgbImage::from_pixel(64, 64, image::Rgb([grey; 3])).save(folder.join(&name)).unwrap();
        images.push(json!({ "uri": name }));
    }
    let corners = [[-1.0f32, -1e3, 0.0], [1.0, -1e3, 0.0], [0.0, -1e3, 1.0]];
    let bin: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(folder.join("triangle.bin"), &bin).unwrap();
    let light = json!({
        "intensity": intensity,
        "irradianceCoefficients": vec![[0; 3]; 9],
        "specularImages": [[0, 1, 2, 3, 4, 5]],
        "specularImageSize": 64,
    });
    let doc = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["EXT_lights_image_based"],
        "extensions": { "EXT_lights_image_based": { "lights": [light] } },
        "scene": 0,
        "scenes": [{ "nodes": [0], "extensions": { "EXT_lights_image_based": { "light": 0 } } }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
            "min": [-1, -1000, 0], "max": [1, -1000, 1] }],
        "bufferViews": [{ "buffer": 0, "byteLength": bin.len() }],
        "buffers": [{ "uri": "triangle.bin", "byteLength": bin.len() }],
        "images": images,
    });
    let path = folder.join("lit.gltf");
    std::fs::write(&path, doc.to_string()).unwrap();
    load(path.to_str().unwrap()).unwrap()
}

/// A camera of 90 degrees that looks along an axis sees the face there, whose radiance is its sRGB colour, decoded, times the intensity.
#[test]
fn gpu_image_based_light_is_the_environment() {
    let device = device();
    let folder = tempfile::tempdir().unwrap();
    let greys = [255, 188, 137, 99, 71, 50];
    let mut scene = lit_scene(folder.path(), greys, 3.0);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let options = PathOptions { samples: SampleSettings::new([32, 32], 16, 3), ..Default::default() };
    for (axis, grey) in axes.into_iter().zip(greys) {
        let mut camera = Camera::look_at(DVec3::ZERO, axis, DVec3::Y, std::f64::consts::FRAC_PI_2);
        // beside the triangle, which would be a point
        camera.camera_to_world = DAffine3::from_translation(DVec3::X * 50.0) * camera.camera_to_world;
        scene.cameras = vec![camera];
        let expected = 3.0 * f64::from(skylit::colour::srgb_decode(f32::from(grey) / 255.0));
        for kind in picked(&device) {
            let flat = FlatScene::for_paths(&scene);
            let image = render(&tracer(&device, kind, &flat), &flat, &options).image.film.mean;
            // away from the edges, where faces are interpolated
            for (x, y) in (8..24).flat_map(|y| (8..24).map(move |x| (x, y))) {
                let value = f64::from(image[3 * (32 * y + x)]);
                assert!((value / expected - 1.0).abs() < 1e-3, "{kind} {axis}, {x} {y}: {value} for {expected}");
            }
        }
    }
    assert_validation_clean(&device);
}
