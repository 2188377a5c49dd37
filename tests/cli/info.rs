//! `skylit info`: what is in a scene, and how to begin with it.

use crate::common::command::{device, json, refuses, run};

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
