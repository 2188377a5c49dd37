//! Frames of light in real time, and stills of a time line, from the command line.

use crate::common::command::{device, json, place, refuses, run};

#[test]
fn gpu_frames_of_light_have_colours() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, apng) = (at("a.##.exr"), at("a.apng"));
    let base =
        ["render", "builtin:cornell-box", "--integrator", "path", "--size", "64x48", "--frames", "0..2", "--json"];
    let extra = ["--preset", "fast", "--tone-map", "agx", "--validation", "--no-config", "-o", &exr, "-o", &apng];
    let record = json(&run(&[&base[..], &extra].concat()));
    assert_eq!(record["integrator"], "path");
    assert!(record["passes"]["antialias"].is_object() && record["mean"].as_f64().unwrap() > 0.01, "{record}");
    let image = skylit::output::load(at("a.01.exr").as_ref()).unwrap();
    assert!(["R", "G", "B", "A", "samples"].iter().all(|name| image.f32(name).is_some()) && image.f32("Y").is_none());
    let of = |key: &str| image.metadata.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str());
    assert_eq!([of("integrator"), of("pixel_filter"), of("max_depth")], [Some("path"), Some("box"), Some("unlimited")]);
    // one red wall and one green one
    let [red, green] = ["R", "G"].map(|c| image.f32(c).unwrap().iter().sum::<f32>());
    assert!(red > 0.0 && green > 0.0 && red != green);
}

#[test]
fn gpu_stills_of_a_time_line_go_on_after_an_end() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, png) = (at("a.#.exr"), at("a.#.png"));
    let base =
        ["render", "builtin:parade", "--integrator", "direct", "--size", "48x27", "--frames", "3..6", "--animate"];
    let extra = ["--fps", "10", "--spp", "2", "--json", "--no-config", "-o", &exr, "-o", &png];
    let args = [&base[..], &extra].concat();
    let numbers = |record: &serde_json::Value| -> Vec<u64> {
        record["stills"].as_array().unwrap().iter().map(|s| s["frame"].as_u64().unwrap()).collect()
    };
    assert_eq!(numbers(&json(&run(&args))), [3, 4, 5]);
    let bytes = |k: u32| std::fs::read(at(&format!("a.{k}.exr"))).unwrap();
    let first = [3, 4, 5].map(bytes);
    assert!(first[0] != first[1] && first[1] != first[2], "nothing moves");
    std::fs::remove_file(at("a.4.png")).unwrap();
    let record = json(&run(&[&args[..], &["--continue"]].concat()));
    assert_eq!((numbers(&record), record["finished_before"].as_u64()), (vec![4], Some(2)));
    assert!([3, 4, 5].map(bytes) == first, "the frame that was rendered again differs");
    // other settings make other frames
    let record = json(&run(&[&args[..], &["--continue", "--seed", "1"]].concat()));
    assert_eq!(numbers(&record), [3, 4, 5]);
}

#[test]
fn frames_that_cannot_be_are_refused() {
    let base = ["render", "builtin:parade", "-o", "a.#.png", "--frames", "0..2"];
    let refused = |args: &[&str], says: &str| refuses(&[&base[..], args].concat(), 64, says);
    refused(&["--integrator", "normals"], "--integrator normals has no frames in real time: add --spp N");
    refused(&["--integrator", "path", "--technique", "gtao"], "--technique gtao is for ambient occlusion");
    refused(&["--integrator", "path", "--preset", "larsen"], "--preset larsen is for ambient occlusion");
    refused(&["--integrator", "path", "--show", "rays"], "--show rays is for ambient occlusion");
    refused(&["--continue"], "--continue is for stills of several frames");
    refused(&["--spp", "2", "-o", "a.apng"], "stills need numbered files");
    refused(&["--spp", "2", "--resumable"], "--resumable");
}
