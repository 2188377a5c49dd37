//! `skylit info`: what is in a scene, and how to begin with it.

use serde_json::Value;

use crate::common::command::{device, fails, json, place, refuses, run, stderr};
use crate::compare::write;

#[test]
fn files_are_described_without_a_device() {
    let text = String::from_utf8(run(&["info", "builtin:cornell-box", "--no-device"]).stdout).unwrap();
    for expected in ["scene       cornell-box, built-in", "triangles", "1 emitting instances", "environment: none"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let record = json(&run(&["info", "scenes/parade.glb", "--no-device", "--json"]));
    assert_eq!((record["format"].as_str(), record["unit"].as_str()), (Some("glTF 2.0, binary"), Some("metre")));
    assert!(!record["inventory"]["animations"].as_array().unwrap().is_empty(), "{record}");
    assert!(record["device"].is_null() && record["suggestions"].is_null());
    // the names are those that options take
    let names = |key: &str| -> Vec<&str> {
        record["inventory"][key].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
    };
    let (object, material) = (names("objects")[0], names("material_names")[0]);
    let edit = format!("{material} roughness=0.5");
    let args = ["info", "scenes/parade.glb", "--no-device", "--only", object, "--material", &edit];
    let text = String::from_utf8(run(&args).stdout).unwrap();
    for name in [object, material] {
        assert!(text.contains(name), "{name}: {text}");
    }
    assert!(text.contains(" (--hide, --only)") && text.contains(" (--material)"), "{text}");
    // groups of a file are named, and leave out what is below them
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let runs = ["o car\ng wheel", "g door", "o house\ng door", "g roof"].map(|s| format!("{s}\nf 1 2 3\n"));
    std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", runs.concat())).unwrap();
    let path = path.to_str().unwrap();
    let text = String::from_utf8(run(&["info", path, "--no-device", "--hide", "car"]).stdout).unwrap();
    assert!(text.contains("nodes       car, house (--hide, --only: with all below)"), "{text}");
    let record = json(&run(&["info", path, "--no-device", "--json"]));
    assert_eq!(record["inventory"]["nodes"], serde_json::json!(["car", "house"]));
    refuses(&["info", path, "--hide", "boat"], 64, "--hide boat: the scene has no such object or node");
    refuses(&["info", "nowhere.glb"], 3, "nowhere.glb");
    refuses(&["info", "builtin:nothing"], 64, "no built-in scene");
}

#[test]
fn gpu_a_camera_a_radius_and_an_exposure_are_suggested() {
    if !device() {
        return;
    }
    let record = json(&run(&["info", "builtin:closed-box", "--json"]));
    let (suggestions, device) = (&record["suggestions"], &record["device"]);
    assert_eq!(suggestions["ao_mean"].as_f64(), Some(0.0));
    let radius = suggestions["ao_radius"].as_f64().unwrap();
    assert!(radius > 0.0 && radius < record["inventory"]["diagonal"].as_f64().unwrap(), "{record}");
    assert!(
        suggestions["exposure"].is_number() && suggestions["camera"].as_str().unwrap().contains("--camera 0"),
        "{record}"
    );
    assert!(device["frame_ms"].as_f64().unwrap() > 0.0 && device["structure_bytes"].as_u64().unwrap() > 0, "{record}");
}

/// Of the warnings about a file `info` lists all, `render` the first and how many more there are; records have all.
#[test]
fn gpu_warnings_about_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let scene = place(&folder, "a.obj");
    std::fs::write(&scene, "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nwibble\nusemtl m\nf 1 2 3\nf 1 1 2\n")
        .unwrap();
    let warnings = |args: &[&str]| {
        let out = run(args);
        assert!(out.status.success(), "{}", stderr(&out));
        stderr(&out).lines().filter(|l| l.starts_with("skylit: warning: ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let listed = warnings(&["info", &scene, "--no-device"]);
    for (warning, says) in listed.iter().zip(["l (1)", "`wibble` (line 6)", "`gone.mtl`", "1 degenerate triangles"]) {
        assert!(warning.contains(says), "{says}: {listed:?}");
    }
    assert_eq!(listed.len(), 4, "{listed:?}");
    refuses(&["info", &scene, "--no-device", "--normals", "rough"], 64, "0 to 180 degrees");
    refuses(&["info", &scene, "--no-device", "--uv", "flat"], 64, "spherical");
    let out = run(&["info", &scene, "--no-device", "--normals", "30"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(text.contains("normals of 1 mesh: computed from triangles (--normals)"), "{text}");
    if !device() {
        return;
    }
    let image = place(&folder, "a.png");
    let render = ["render", &scene, "-o", &image, "--size", "8x8", "--spp", "1"];
    let shown = warnings(&render);
    let about_file: Vec<_> = shown.iter().filter(|w| listed.iter().any(|l| w.starts_with(l.as_str()))).collect();
    assert_eq!(about_file.len(), 1, "{shown:?}");
    assert!(
        about_file[0].starts_with(&listed[0]) && about_file[0].contains("(and 3 more about the file: `skylit info")
    );
    let record = json(&run(&[&render[..], &["--json"]].concat()));
    assert!(record["warnings"].as_array().unwrap().len() >= 4, "{record}");
}

/// Of an image: each channel with its values and with what is not finite, and the metadata.
#[test]
fn images_are_described() {
    let dir = tempfile::tempdir().unwrap();
    let values = |k: usize| [0.25, 1.0, f32::NAN, f32::INFINITY][k % 4];
    let path = write(&dir, "a.exr", &[("Y", &values), ("depth.Z", &|_| 3.0)], &[("skylit.spp", "16")]);
    let out = run(&["info", &path]);
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.starts_with(&format!("{path}: 8 x 4 pixels, 2 channels\n")), "{text}");
    assert!(text.contains("0.25 to 1, mean 0.625, 8 NaN, 8 infinite"), "{text}");
    assert!(text.contains("skylit.spp: 16"), "{text}");

    let record = json(&run(&["info", &path, "--json"]));
    assert_eq!((&record["size"][0], &record["metadata"]["skylit.spp"]), (&Value::from(8), &Value::from("16")));
    let depth = record["channels"].as_array().unwrap().iter().find(|c| c["name"] == "depth.Z").unwrap();
    assert_eq!((depth["min"].as_f64(), depth["mean"].as_f64()), (Some(3.0), Some(3.0)));
    fails(&run(&["info", &path, "--size", "8x8"]), 64, &["--size is for scenes"]);
    fails(&run(&["info", "nowhere.exr"]), 3, &["nowhere.exr"]);
}
