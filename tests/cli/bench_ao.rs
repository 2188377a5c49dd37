//! `skylit bench ao` from outside: what it measures and writes of tiny scenes, and what it refuses.
use std::process::{Command, Output, Stdio};

use crate::common::command::{device, fails, json, skylit, stderr};
use serde_json::Value;

const TINY: [&str; 8] = ["--quick", "--size", "48x27", "--frames", "8", "--reference-rays", "16", "--quiet"];

fn command(args: &[&str]) -> Command {
    let mut command = skylit(&["bench", "ao"]);
    command.args(args);
    command
}

fn run(args: &[&str]) -> Output {
    command(args).output().unwrap()
}

fn record(args: &[&str]) -> Value {
    json(&run(&[&TINY[..], args, &["--json"]].concat()))
}

#[test]
fn wrong_usage() {
    fails(&run(&["--presets", "magic"]), 64, &["magic", "larsen-fixed"]);
    fails(&run(&["--parts", "all"]), 64, &["all", "equal-time"]);
    fails(&run(&["--series", "time"]), 64, &["time", "triangles"]);
    fails(&run(&["--series", "rays", "--parts", "rest"]), 64, &["--series", "--parts"]);
    fails(&run(&["--frames", "1"]), 64, &["--frames"]);
    fails(&run(&["--reference-rays", "1"]), 64, &["--reference-rays"]);
    fails(&run(&["--size", "big"]), 64, &["--size"]);
    fails(&run(&["--plot", "a.pdf"]), 64, &[".png", ".svg"]);
    fails(&run(&["--baseline", "/nonexistent.json"]), 3, &["/nonexistent.json", "no such file"]);
    fails(&run(&["--csv", "/nonexistent/a.csv"]), 4, &["folder does not exist"]);
    fails(&run(&["builtin:nothing"]), 64, &["nothing"]);
    fails(&run(&["no-such-scene.glb"]), 3, &["no such file"]);
}

/// Both views of a scene: numbers where there must be some, a row a result, and files that are whole.
#[test]
fn gpu_views_of_a_scene() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (csv, plot, json) = (at("a.csv"), at("a.png"), at("a.json"));
    let files = ["--csv", csv.to_str().unwrap(), "--plot", plot.to_str().unwrap(), "--json", json.to_str().unwrap()];
    let out = run(&[&["builtin:stairs", "--presets", "larsen,balanced,gtao"], &TINY[..7], &files].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for word in ["builtin:stairs, near", "builtin:stairs, far", "balanced over larsen", "unfiltered"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let record: Value = serde_json::from_slice(&std::fs::read(at("a.json")).unwrap()).unwrap();
    let views = record["views"].as_array().unwrap();
    assert_eq!(views.iter().map(|v| v["view"].as_str().unwrap()).collect::<Vec<_>>(), ["near", "far"]);
    // where one ray a pixel takes longer than larsen's frame, there is none
    let has_equal_time = views.iter().any(|v| v["verdict"]["equal_time"].is_object());
    assert_eq!(text.contains("  equal time: balanced with"), has_equal_time, "{text}");
    for view in views {
        assert!(view["covered"].as_u64().unwrap() > 50 && view["reference_rmse"].as_f64().unwrap() > 0.0);
        let names: Vec<_> = view["results"].as_array().unwrap().iter().map(|r| r["preset"].as_str().unwrap()).collect();
        assert_eq!(names, ["larsen", "balanced", "gtao"]);
        let [larsen, balanced, gtao] = [0, 1, 2].map(|k| &view["results"][k]);
        let covered = view["covered"].as_f64().unwrap();
        // each pixel that shows something gets its ray, and none where nothing is
        assert_eq!(balanced["still"]["cost"]["rays"].as_f64(), Some(covered));
        assert!(larsen["still"]["cost"]["rays"].as_f64().unwrap() > 8.0 * covered);
        assert_eq!(gtao["still"]["cost"]["rays"].as_f64(), Some(0.0));
        assert_eq!(larsen["still"]["cost"]["camera_rays"].as_f64(), Some(48.0 * 27.0));
        assert_eq!(balanced["still"]["cost"]["camera_rays"].as_f64(), Some(0.0));
        let curve = balanced["still"]["curve"].as_array().unwrap();
        assert_eq!(curve.iter().map(|p| p["frame"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 4, 8]);
        let rmse = |k: usize| curve[k]["errors"]["rmse"].as_f64().unwrap();
        assert!(rmse(3) < rmse(0) && rmse(3) > 0.0, "{curve:?}");
        for number in ["bias", "flip", "tanimoto", "minimum_ratio", "rmse_corrected"] {
            assert!(curve[3]["errors"][number].is_f64(), "{number}");
        }
        assert!(curve[3]["unfiltered"]["rmse"].as_f64().unwrap() > 0.0);
        assert_eq!(balanced["rest"]["cost"]["rays"].as_f64(), Some(0.0));
        assert!(larsen["rest"].is_null());
        assert_eq!(balanced["moving"]["frames"].as_array().unwrap().len(), 4);
        let passes = balanced["still"]["moving_cost"]["passes"].as_array().unwrap();
        assert!(passes.iter().any(|p| p["pass"] == "gbuffer"), "{passes:?}");
        let ratio = view["verdict"]["rays_ratio"].as_f64().unwrap();
        assert!((0.04..0.1).contains(&ratio), "{ratio}");
    }
    let mut rows = csv::Reader::from_path(&csv).unwrap();
    let head = rows.headers().unwrap().clone();
    let part = head.iter().position(|h| h == "part").unwrap();
    let pass = head.iter().position(|h| h == "pass").unwrap();
    let rows: Vec<_> = rows.records().map(Result::unwrap).collect();
    let count = |name: &str| rows.iter().filter(|r| &r[part] == name && r[pass].is_empty()).count();
    // two views; three presets with four frames each; two of these three never rest
    assert_eq!([count("still"), count("still, camera rays"), count("moving"), count("rest")], [24, 6, 6, 2]);
    let image = skylit::output::load(&plot).unwrap();
    assert!(image.width > 500 && image.height > 300);
    assert_eq!(record["benchmark"], "ao");
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.len() == 3, "{left:?}");
}

/// The same run again: times have noise, but errors are the same, and exit code and record agree on what is worse.
#[test]
fn gpu_a_baseline() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let before = dir.path().join("before.json");
    let args = [&["builtin:stairs", "--presets", "fast", "--parts", "still,moving"], &TINY[..]].concat();
    assert!(run(&[&args[..], &["--json", before.to_str().unwrap()]].concat()).status.success());
    let compared = [&args[..], &["--json", "--baseline", before.to_str().unwrap()]].concat();
    let out = run(&compared);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    let baseline = &record["baseline"];
    // two views: three times and two errors each
    assert_eq!(
        (baseline["compared"].as_u64(), baseline["missing"].as_array().map(Vec::len)),
        (Some(10), Some(0)),
        "{baseline}"
    );
    let regressions = baseline["regressions"].as_array().unwrap();
    assert!(regressions.iter().all(|r| r["quantity"].as_str().unwrap().starts_with("ms")), "{regressions:?}");
    assert_eq!(out.status.code(), Some(i32::from(!regressions.is_empty())), "{}", stderr(&out));
    // with other settings nothing is measured
    fails(&run(&[&compared[..], &["--ao-falloff", "binary"]].concat()), 64, &["its falloff is exponential, not binary"]);
}

/// The plain blend forgets half in a frame, whatever else is wrong with it.
#[test]
fn gpu_changes() {
    if !device() {
        return;
    }
    let out = run(&[
        "--quick",
        "--size",
        "96x54",
        "--frames",
        "16",
        "--parts",
        "changes",
        "--presets",
        "larsen,fast",
        "--json",
        "--quiet",
    ]);
    assert!(out.status.success(), "{}", stderr(&out));
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    let changes = record["changes"].as_array().unwrap();
    let names: Vec<_> = changes.iter().map(|c| c["change"].as_str().unwrap()).collect();
    assert_eq!(names, ["appear", "slide", "sidestep", "animated"]);
    let [larsen, fast] = [0, 1].map(|k| &changes[0]["results"][k]);
    let half_life = larsen["memory_half_life"].as_f64().unwrap();
    assert!((half_life - 1.0).abs() < 0.1, "{half_life}");
    let left = |r: &Value| r["memory"][0].as_f64().unwrap();
    assert!(left(fast).abs() < 0.3 && left(fast) < left(larsen), "{} {}", left(fast), left(larsen));
    for r in [larsen, fast] {
        assert!(r["stale_pixels"].is_u64() && r["ghosting"].as_f64().unwrap() >= 0.0, "{r}");
    }
    assert!(changes[1]["results"][1]["update_ms"]["median"].as_f64().unwrap() > 0.0);
    assert!(changes[2]["pixels"].as_u64().unwrap() > 10 && changes[2]["results"][0]["recovery"].is_u64());
    assert!(changes[3]["results"][1]["errors"]["rmse"].as_f64().unwrap() < 0.2);
}

#[test]
fn gpu_structures_and_series() {
    if !device() {
        return;
    }
    let structures = record(&["--parts", "structures"]);
    let first = &structures["structures"][0];
    assert_eq!((first["meshes"].as_u64(), first["instances"].as_u64()), (Some(15), Some(125)));
    for number in ["top", "refit"] {
        assert!(first[number]["median"].as_f64().unwrap() > 0.0, "{number}: {first}");
    }
    let args = ["builtin:stairs", "--frames", "4", "--series", "triangles,rays,resolution,sampling"];
    let out = run(&[&["--quick", "--size", "48x27", "--reference-rays", "8", "--json", "--quiet"], &args[..]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let all: Value = serde_json::from_slice(&out.stdout).unwrap();
    let series = all["series"].as_array().unwrap();
    let names: Vec<_> = series.iter().map(|s| s["series"].as_str().unwrap()).collect();
    assert_eq!(names, ["triangles", "rays", "resolution", "sampling"]);
    assert_eq!(series[0]["lines"].as_array().unwrap().len(), 2);
    assert_eq!(series[3]["lines"].as_array().unwrap().len(), 5);
    let last = |line: &Value| line["points"].as_array().unwrap().last().unwrap().clone();
    let last: Vec<_> = series[3]["lines"].as_array().unwrap().iter().map(last).collect();
    assert!(last.iter().all(|p| p["unfiltered_rmse"].as_f64().unwrap() > 0.0));
    // the fastest has all its frames when it is done; of another the first may take longer than that, on a machine that stumbles
    let at_equal_time: Vec<_> = last.iter().filter_map(|p| p["equal_time_rmse"].as_f64()).collect();
    assert!(!at_equal_time.is_empty() && at_equal_time.iter().all(|&rmse| rmse > 0.0));
    assert!(all["views"].as_array().unwrap().is_empty());
}

/// What was measured until the time was over is there, and said to be not all.
#[test]
fn gpu_time_limit() {
    if !device() {
        return;
    }
    let record = record(&["builtin:plane", "builtin:stairs", "--time-limit", "0.000001"]);
    assert_eq!(record["stopped_early"], true);
    assert_eq!(record["views"].as_array().unwrap().len(), 1);
    assert_eq!(record["views"][0]["results"].as_array().unwrap().len(), 1);
    assert!(record["notes"].to_string().contains("builtin:stairs: left out"), "{}", record["notes"]);
}

/// Interrupted: one record of what there is, how it ended, and no file but whole ones.
#[test]
fn gpu_interruption() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let csv = dir.path().join("a.csv");
    // hours, if it were not
    let args = ["builtin:stairs", "--size", "320x180", "--frames", "10000", "--json", "--csv", csv.to_str().unwrap()];
    let child = command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(5));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let out = child.wait_with_output().unwrap();
    fails(&out, 130, &["interrupted"]);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(record["exit_code"], 130);
    let written = csv.exists();
    assert_eq!(written, !record["views"].as_array().unwrap().is_empty());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), usize::from(written));
}

/// A scene that fails costs neither the others nor what is written, and the run still fails.
#[test]
fn gpu_a_scene_that_fails_leaves_the_rest() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let broken = dir.path().join("broken.glb");
    std::fs::write(&broken, "no glTF").unwrap();
    let scenes = [broken.to_str().unwrap(), "builtin:plane", "--presets", "fast", "--parts", "still", "--json"];
    let out = run(&[&scenes[..], &TINY[..7]].concat());
    fails(&out, 3, &["broken.glb"]);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((record["views"].as_array().unwrap().len(), record["exit_code"].as_u64()), (2, Some(3)));
}
