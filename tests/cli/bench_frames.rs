//! `skylit bench frames` from outside: what it measures and writes of tiny scenes, and what it refuses.
use std::process::Output;

use crate::common::command::{device, fails, json, skylit, stderr};
use serde_json::Value;

use super::bench_path::Place;

const TINY: [&str; 6] = ["--quick", "--size", "64x36", "--frames", "12", "--quiet"];

fn run(args: &[&str]) -> Output {
    skylit(&[&["bench", "frames"], args].concat()).output().unwrap()
}

fn record(args: &[&str]) -> Value {
    json(&run(&[&TINY[..], args, &["--json"]].concat()))
}

#[test]
fn wrong_usage() {
    fails(&run(&["--presets", "magic"]), 64, &["magic", "balanced"]);
    fails(&run(&["--presets", "larsen"]), 64, &["--presets larsen", "--integrator ao"]);
    fails(&run(&["--parts", "all"]), 64, &["all", "bounces"]);
    fails(&run(&["--integrator", "normals"]), 64, &["normals", "no frames in real time"]);
    fails(&run(&["--frames", "1"]), 64, &["--frames"]);
    fails(&run(&["--reference-paths", "1"]), 64, &["--reference-paths"]);
    fails(&run(&["--peers", "/nonexistent.toml"]), 3, &["/nonexistent.toml"]);
    fails(&run(&["builtin:nothing"]), 64, &["nothing"]);
    fails(&run(&["no-such-scene.glb"]), 3, &["no such file"]);
}

/// A peer renders paths in the time of the frames, and is held against its own reference; one that fails is left out with a note, and one without anything to show is not asked.
#[test]
fn gpu_peers_beside_a_still_camera() {
    if !device() {
        return;
    }
    let run = |place: &Place, args: &[&str]| {
        let peers = place.at("peers.toml");
        let of = ["builtin:cornell-box", "--presets", "fast", "--peers", peers.to_str().unwrap()];
        record(&[&of[..], args].concat())
    };
    let place = Place::new("", 64 * 36);
    let beside = run(&place, &["--parts", "still"]);
    assert_eq!(beside["peers"], serde_json::json!(["Fake"]));
    let still = &beside["views"][0]["still"][0];
    let peers = still["peers"].as_array().unwrap();
    assert_eq!(peers.iter().map(|p| p["peer"].as_str().unwrap()).collect::<Vec<_>>(), ["fake k", "fake l"]);
    for peer in peers {
        assert_eq!(peer["reference_rmse"], 0.0, "its images are all the same");
        // half a second an image, however many paths
        let ms = ["ms_per_image", "ms_per_path"].map(|name| peer[name].as_f64().unwrap());
        assert!((ms[0] + ms[1] - 500.0).abs() < 1e-6, "{peer}");
        let points = peer["points"].as_array().unwrap();
        assert_eq!(points.iter().map(|p| p["frame"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 4, 8, 12]);
        assert!(points.iter().all(|p| p["paths"].as_u64().unwrap() >= 1 && p["errors"]["rmse"] == 0.0), "{points:?}");
    }
    let dies = run(&Place::new("render", 64 * 36), &["--parts", "still"]);
    assert_eq!(dies["views"][0]["still"][0]["peers"], serde_json::json!([]));
    assert!(dies["notes"].to_string().contains("peer 'fake' left out"), "{}", dies["notes"]);
    let others = run(&place, &["--integrator", "direct", "--parts", "still"]);
    assert_eq!(others["peers"], serde_json::json!([]));
}

/// Everything that a scene can do: numbers where there must be some, a row a result, and files that are whole and are read again.
#[test]
fn gpu_a_scene_at_rest_in_motion_and_changing() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (csv, plot, json) = (at("a.csv"), at("a.svg"), at("a.json"));
    let files = ["--csv", &csv, "--plot", &plot, "--json", &json];
    let out = run(&[&["builtin:parade", "--presets", "balanced", "--peers", "none"], &TINY[..5], &files].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for word in ["builtin:parade", "over plain", "balanced, orbit: ", "balanced: flicker after 8 frames", "turn: 2,304 pixels"]
    {
        assert!(text.contains(word), "{word}: {text}");
    }
    let record: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!((record["benchmark"].as_str(), record["integrator"].as_str()), (Some("frames"), Some("path")));
    let view = &record["views"][0];
    let still = &view["still"][0];
    let curve = still["curve"].as_array().unwrap();
    assert_eq!(curve.iter().map(|p| p["frame"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 4, 8, 12]);
    let rmse = |errors: &Value| errors["rmse"].as_f64().unwrap();
    assert!(rmse(&curve[4]["errors"]) < 0.7 * rmse(&curve[0]["errors"]), "{curve:?}");
    // more time, more paths, less error
    let plain = |k: usize| &curve[k]["plain"];
    assert!(plain(4)["paths"].as_u64() > plain(0)["paths"].as_u64());
    assert!(rmse(&plain(4)["errors"]) < rmse(&plain(0)["errors"]), "{curve:?}");
    for number in ["rmse_corrected", "rel_mse", "bias", "flip"] {
        assert!(curve[4]["errors"][number].is_f64(), "{number}");
    }
    let passes = |cost: &Value| -> Vec<String> {
        cost["passes"].as_array().unwrap().iter().map(|p| p["pass"].as_str().unwrap().to_owned()).collect()
    };
    // surfaces are known from the first frame
    let at_rest = passes(&still["cost"]);
    assert!(at_rest.iter().any(|p| p == "path_camera") && !at_rest.iter().any(|p| p == "path_surface"), "{at_rest:?}");
    assert!(still["cost"]["rays"].as_f64().unwrap() > 0.0 && view["ms_per_path"].as_f64().unwrap() > 0.0);
    let flicker = still["flicker"]["rms"].as_f64().unwrap();
    assert!(flicker > 0.0 && flicker < 0.05, "{flicker}");
    let motions = view["motions"].as_array().unwrap();
    assert_eq!(motions.iter().map(|m| m["motion"].as_str().unwrap()).collect::<Vec<_>>(), ["orbit", "sun", "animation"]);
    let in_motion = passes(&motions[0]["results"][0]["cost"]);
    assert!(in_motion.iter().any(|p| p == "path_surface"), "{in_motion:?}");
    let ratio = |m: &Value| {
        let r = &m["results"][0];
        let corrected = |e: &Value| e["rmse_corrected"].as_f64().unwrap();
        corrected(&r["errors"]) / corrected(&r["plain"]["errors"])
    };
    // by the clock of a machine that does other work, too
    let ratios: Vec<f64> = motions.iter().map(ratio).collect();
    assert!(ratios.iter().any(|r| *r < 1.0) && ratios.iter().all(|r| *r > 0.05 && *r < 2.0), "{ratios:?}");
    let turn = view["changes"].as_array().unwrap().iter().find(|c| c["change"] == "turn").unwrap();
    let result = &turn["results"][0];
    let (residuals, errors) = (result["residuals"].as_array().unwrap(), result["rmse"].as_array().unwrap());
    assert!(residuals[0].as_f64().unwrap() > residuals[7].as_f64().unwrap(), "{residuals:?}");
    assert!(errors[0].as_f64() > errors[7].as_f64(), "{errors:?}");
    let mut rows = csv::Reader::from_path(&csv).unwrap();
    let head = rows.headers().unwrap().clone();
    let column = |name: &str| head.iter().position(|h| h == name).unwrap();
    let (part, pass) = (column("part"), column("pass"));
    let rows: Vec<_> = rows.records().map(Result::unwrap).collect();
    let count = |name: &str| rows.iter().filter(|r| &r[part] == name && r[pass].is_empty()).count();
    assert_eq!(["still", "orbit", "sun", "animation"].map(count), [5, 1, 1, 1]);
    assert!(std::fs::read_to_string(&plot).unwrap().contains("plain accumulation"));
    // the record is read again, and is no worse than itself
    let report = skylit(&["bench", "report", &json, "--baseline", &json]).output().unwrap();
    assert!(report.status.success(), "{}", stderr(&report));
    assert!(String::from_utf8(report.stdout).unwrap().contains("balanced, orbit: "));
}

/// Times by number of bounces, beside published ones.
#[test]
fn gpu_bounces() {
    if !device() {
        return;
    }
    let record = record(&["--parts", "bounces", "--presets", "fast"]);
    let scenes = record["bounces"].as_array().unwrap();
    assert_eq!(scenes.iter().map(|b| b["primitives"].as_u64().unwrap()).collect::<Vec<_>>(), [10, 34]);
    for scene in scenes {
        let points = scene["points"].as_array().unwrap();
        assert_eq!(points.iter().map(|p| p["bounces"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 3, 4]);
        let rays: Vec<f64> = points.iter().map(|p| p["cost"]["rays"].as_f64().unwrap()).collect();
        assert!(rays.windows(2).all(|r| r[0] < r[1]), "{rays:?}");
        assert!(points.iter().all(|p| p["coello_fps"].as_f64().unwrap() > 100.0));
    }
    assert!(record["views"].as_array().unwrap().is_empty());
}

/// The same code measures ambient occlusion, whose presets are more.
#[test]
fn gpu_ambient_occlusion() {
    if !device() {
        return;
    }
    let args = ["builtin:stairs", "--integrator", "ao", "--presets", "larsen,balanced", "--parts", "still,moving,sun"];
    let record = record(&args);
    let view = &record["views"][0];
    let names: Vec<_> = view["still"].as_array().unwrap().iter().map(|r| r["preset"].as_str().unwrap()).collect();
    assert_eq!(names, ["larsen", "balanced"]);
    // occlusion does not depend on where the sun is
    assert_eq!(view["motions"].as_array().unwrap().len(), 1);
    let errors = &view["motions"][0]["results"][1]["errors"];
    assert!((0.0..0.2).contains(&errors["rmse"].as_f64().unwrap()), "{errors}");
}
