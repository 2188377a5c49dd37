//! `skylit bench frames` from outside: what it measures and writes of tiny scenes, and what it refuses.
use std::process::Output;

use crate::common::command::{device, fails, json, skylit, stderr};
use serde_json::Value;

use super::bench_path::Place;
use super::measured::{contestants, curve, find, of_part, scenes, value};

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
    let part = "still, other renderers";
    let names = ["fake k in the time of fast", "fake l in the time of fast"];
    assert_eq!(contestants(&beside, "builtin:cornell-box", part), names);
    for name in names {
        let of = |quantity: &str| value(&beside, ["builtin:cornell-box", part, name, quantity]);
        assert_eq!(of("reference's RMSE"), 0.0, "its images are all the same");
        // half a second an image, however many paths
        assert!((of("image") + of("path") - 500.0).abs() < 1e-6);
        let curve = |quantity: &str| curve(&beside, ["builtin:cornell-box", part, name, quantity]);
        assert_eq!(curve("RMSE"), [1.0, 2.0, 4.0, 8.0, 12.0].map(|frame| (frame, 0.0)));
        assert!(curve("paths").iter().all(|p| p.1 >= 1.0));
    }
    let dies = run(&Place::new("render", 64 * 36), &["--parts", "still"]);
    assert!(of_part(&dies, "", part).is_empty() && !of_part(&dies, "", "still").is_empty());
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
    for word in ["builtin:parade", "over plain", "balanced, orbit: ", "balanced: flicker after 8 frames", "turn  "] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let record: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(
        (record["benchmark"].as_str(), record["settings"]["integrator"].as_str()),
        (Some("frames"), Some("path"))
    );
    let scene = "builtin:parade";
    let of = |part: &str, quantity: &str| value(&record, [scene, part, "balanced", quantity]);
    let along = |part: &str, quantity: &str| curve(&record, [scene, part, "balanced", quantity]);
    let errors = along("still", "RMSE");
    assert_eq!(errors.iter().map(|p| p.0).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 8.0, 12.0]);
    assert!(errors[4].1 < 0.7 * errors[0].1, "{errors:?}");
    // more time, more paths, less error
    let (paths, plain) = (along("still", "plain paths"), along("still", "plain RMSE"));
    assert!(paths[4].1 > paths[0].1 && plain[4].1 < plain[0].1, "{paths:?} {plain:?}");
    for quantity in ["corrected RMSE", "rel MSE", "bias", "FLIP"] {
        assert!(of("still", quantity).is_finite(), "{quantity}");
    }
    let passes = |part: &str| -> Vec<&str> {
        of_part(&record, scene, part).iter().map(|m| m["quantity"].as_str().unwrap()).collect()
    };
    // surfaces are known from the first frame
    let at_rest = passes("still, passes");
    assert!(at_rest.contains(&"path_camera") && !at_rest.contains(&"path_surface"), "{at_rest:?}");
    assert!(of("still", "rays") > 0.0 && of("still", "time") > 0.0);
    let flicker = of("still", "flicker");
    assert!(flicker > 0.0 && flicker < 0.05, "{flicker}");
    let in_motion = passes("orbit, passes");
    assert!(in_motion.contains(&"path_surface"), "{in_motion:?}");
    // by the clock of a machine that does other work, too
    let ratios = ["orbit", "sun", "animation"].map(|motion| of(motion, "over plain"));
    assert!(ratios.iter().any(|r| *r < 1.0) && ratios.iter().all(|r| *r > 0.05 && *r < 2.0), "{ratios:?}");
    assert!(of("animation", "update") > 0.0 && of("animation", "ghosting") >= 0.0);
    let errors = along("turn", "RMSE");
    assert!(of("turn", "left") > 0.0 && errors[0].1 > errors[7].1, "{errors:?}");
    let left = along("turn", "left");
    assert!(left.len() == errors.len() && left[0].1 > left[7].1, "{left:?}");
    assert!(
        of("sidestep", "recovered").is_finite() && find(&record, [scene, "sidestep", "balanced", "left"]).is_none()
    );
    let mut rows = csv::Reader::from_path(&csv).unwrap();
    let head = rows.headers().unwrap().clone();
    let column = |name: &str| head.iter().position(|h| h == name).unwrap();
    let (part, quantity) = (column("part"), column("quantity"));
    let rows: Vec<_> = rows.records().map(Result::unwrap).collect();
    let count = |name: &str| rows.iter().filter(|r| &r[part] == name && &r[quantity] == "corrected RMSE").count();
    // the still camera has a curve and its end
    assert_eq!(["still", "orbit", "sun", "animation"].map(count), [6, 1, 1, 1]);
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
    assert_eq!(scenes(&record), ["builtin:coello:1", "builtin:coello:2"]);
    for scene in scenes(&record) {
        let along = |quantity: &str| curve(&record, [scene, "bounces", "fast", quantity]);
        let rays = along("rays");
        assert_eq!(rays.iter().map(|p| p.0).collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0]);
        assert!(rays.windows(2).all(|r| r[0].1 < r[1].1), "{rays:?}");
        let published = along("Coello (2024), 1920x1080");
        assert!(published.len() == 4 && published.iter().all(|p| p.1 < 10.0), "{published:?}");
    }
}
