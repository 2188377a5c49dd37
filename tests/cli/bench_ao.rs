//! `skylit bench ao`, which is `bench frames` of ambient occlusion, from outside: what it measures and writes of tiny scenes, and what it refuses.
use std::process::{Command, Output, Stdio};

use crate::common::command::{device, fails, json, skylit, stderr};
use serde_json::Value;

use super::measured::{contestants, curve, find, of_part, scenes, value};

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
    fails(&run(&["--reference-rays", "1"]), 64, &["--reference-paths"]);
    fails(&run(&["--size", "big"]), 64, &["--size"]);
    fails(&run(&["--plot", "a.pdf"]), 64, &["must end in .svg"]);
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
    let (csv, plot, json) = (at("a.csv"), at("a.svg"), at("a.json"));
    let files = ["--csv", csv.to_str().unwrap(), "--plot", plot.to_str().unwrap(), "--json", json.to_str().unwrap()];
    let out = run(&[&["builtin:stairs", "--presets", "larsen,balanced,gtao"], &TINY[..7], &files].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for word in ["builtin:stairs, near", "builtin:stairs, far", "balanced over larsen", "unfiltered RMSE"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let record: Value = serde_json::from_slice(&std::fs::read(at("a.json")).unwrap()).unwrap();
    let views = ["builtin:stairs, near", "builtin:stairs, far"];
    assert_eq!(scenes(&record), views);
    // where one ray a pixel takes longer than larsen's frame, there is none
    let has_equal_time = !of_part(&record, "", "equal time").is_empty();
    assert_eq!(text.contains("  equal time: balanced with"), has_equal_time, "{text}");
    for view in views {
        assert_eq!(contestants(&record, view, "still"), ["larsen", "balanced", "gtao", "reference"]);
        let of = |preset: &str, quantity: &str| value(&record, [view, "still", preset, quantity]);
        let covered = of("reference", "pixels");
        assert!(covered > 50.0 && of("reference", "RMSE") > 0.0);
        // each pixel that shows something gets its ray, and none where nothing is
        assert_eq!(of("balanced", "rays"), covered);
        assert!(of("larsen", "rays") > 8.0 * covered);
        assert_eq!(of("gtao", "rays"), 0.0);
        assert_eq!((of("larsen", "camera rays"), of("balanced", "camera rays")), (48.0 * 27.0, 0.0));
        let errors = curve(&record, [view, "still", "balanced", "RMSE"]);
        assert_eq!(errors.iter().map(|p| p.0).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 8.0]);
        assert!(errors[3].1 < errors[0].1 && errors[3].1 > 0.0, "{errors:?}");
        for quantity in ["bias", "FLIP", "Tanimoto", "minimum ratio", "corrected RMSE"] {
            assert!(of("balanced", quantity).is_finite(), "{quantity}");
        }
        for preset in ["larsen", "balanced"] {
            assert!(of(preset, "unfiltered RMSE") > 0.0, "{preset}");
        }
        assert_eq!(value(&record, [view, "rest", "balanced", "rays"]), 0.0);
        assert_eq!(contestants(&record, view, "rest"), ["balanced"]);
        assert!(value(&record, [view, "orbit", "balanced", "unfiltered RMSE"]) > 0.0);
        assert!(find(&record, [view, "still, camera rays, passes", "balanced", "gbuffer"]).is_some());
        let ratio = of("balanced", "rays") / of("larsen", "rays");
        assert!((0.04..0.1).contains(&ratio), "{ratio}");
    }
    let mut rows = csv::Reader::from_path(&csv).unwrap();
    assert_eq!(rows.records().map(Result::unwrap).count(), record["measurements"].as_array().unwrap().len());
    let drawn = std::fs::read_to_string(&plot).unwrap();
    for part in [
        "builtin:stairs, near, still: time against error",
        "Pareto front",
        "error over time",
        "reference&#x27;s own error",
    ] {
        assert!(drawn.contains(part), "{part}");
    }
    let of_what = (record["benchmark"].as_str(), record["settings"]["integrator"].as_str());
    assert_eq!(of_what, (Some("frames"), Some("ao")));
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
    let args = [&["builtin:stairs", "--presets", "fast", "--parts", "still,moving,sun"], &TINY[..]].concat();
    assert!(run(&[&args[..], &["--json", before.to_str().unwrap()]].concat()).status.success());
    let compared = [&args[..], &["--json", "--baseline", before.to_str().unwrap()]].concat();
    let out = run(&compared);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    // occlusion does not depend on where the sun is
    assert!(of_part(&record, "", "sun").is_empty());
    let baseline = &record["baseline"];
    // two views: three times, two errors and flicker each
    assert_eq!(
        (baseline["compared"].as_u64(), baseline["missing"].as_array().map(Vec::len)),
        (Some(12), Some(0)),
        "{baseline}"
    );
    let regressions = baseline["regressions"].as_array().unwrap();
    assert!(regressions.iter().all(|r| r["quantity"].as_str().unwrap().ends_with(", ms")), "{regressions:?}");
    assert_eq!(out.status.code(), Some(i32::from(!regressions.is_empty())), "{}", stderr(&out));
    // with other settings nothing is measured
    fails(
        &run(&[&compared[..], &["--ao-falloff", "binary"]].concat()),
        64,
        &["its falloff is exponential, not binary"],
    );
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
        "80x45",
        "--frames",
        "16",
        "--parts",
        "change,animation",
        "--views",
        "near",
        "--presets",
        "larsen,fast",
        "room",
        "--json",
        "--quiet",
    ]);
    assert!(out.status.success(), "{}", stderr(&out));
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(scenes(&record), ["room"]);
    let of = |part: &str, preset: &str, quantity: &str| value(&record, ["room", part, preset, quantity]);
    let half_life = of("appear", "larsen", "half-life of memory");
    assert!((half_life - 1.0).abs() < 0.1, "{half_life}");
    let [larsen, fast] = ["larsen", "fast"].map(|preset| of("appear", preset, "memory"));
    assert!(fast.abs() < 0.3 && fast < larsen, "{fast} {larsen}");
    for preset in ["larsen", "fast"] {
        assert!(of("appear", preset, "stale pixels") >= 0.0 && of("appear", preset, "ghosting") >= 0.0, "{preset}");
    }
    assert!(of("slide", "fast", "update") > 0.0 && of("slide", "fast", "ghosting") >= 0.0);
    assert!(of("sidestep", "reference", "pixels") > 10.0 && of("sidestep", "larsen", "recovered").is_finite());
}

#[test]
fn gpu_structures_and_series() {
    if !device() {
        return;
    }
    let structures = record(&["--parts", "structures"]);
    assert!(
        structures["scenes"][0]["about"].as_str().unwrap().contains("in 125 instances"),
        "{}",
        structures["scenes"]
    );
    let names = contestants(&structures, "builtin:instances:25000", "structures");
    assert!(
        names[0] == "first build" && names[1].starts_with("top level, ") && names[2] == "mesh, refitted",
        "{names:?}"
    );
    for name in &names[1..3] {
        assert!(value(&structures, ["builtin:instances:25000", "structures", name, "update"]) > 0.0, "{name}");
    }
    let args = ["builtin:stairs", "--frames", "4", "--series", "triangles,rays,resolution,sampling"];
    let out = run(&[&["--quick", "--size", "48x27", "--reference-rays", "8", "--json", "--quiet"], &args[..]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let all: Value = serde_json::from_slice(&out.stdout).unwrap();
    let scene = "builtin:stairs, near";
    assert_eq!(contestants(&all, scene, "by triangles"), ["balanced", "larsen"]);
    assert!(value(&all, [scene, "by triangles", "larsen", "time"]) > 0.0);
    assert_eq!(curve(&all, [scene, "by rays", "balanced", "time"]).len(), 2);
    assert_eq!(curve(&all, [scene, "by resolution", "fast", "time"]).len(), 2);
    let sequences = contestants(&all, scene, "by sequence");
    assert_eq!(sequences, ["sobol", "blue"]);
    for sequence in &sequences {
        let unfiltered = curve(&all, [scene, "by sequence", sequence, "unfiltered RMSE"]);
        assert!(unfiltered.last().unwrap().1 > 0.0, "{sequence}");
    }
    // the fastest has all its frames when it is done; of another the first may take longer than that, on a machine that stumbles
    let done: Vec<_> =
        of_part(&all, scene, "by sequence").into_iter().filter(|m| m["quantity"] == "equal-time RMSE").collect();
    assert!(!done.is_empty() && done.iter().all(|m| m["values"].as_f64().unwrap() > 0.0));
    assert!(of_part(&all, "", "still").is_empty());
}

/// What was measured until the time was over is there, and said to be not all.
#[test]
fn gpu_time_limit() {
    if !device() {
        return;
    }
    let record = record(&["builtin:plane", "builtin:stairs", "--time-limit", "0.000001"]);
    assert_eq!(record["stopped_early"], true);
    assert_eq!(scenes(&record), ["builtin:plane, near"]);
    assert_eq!(contestants(&record, "builtin:plane, near", "still"), ["larsen", "reference"]);
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
    assert_eq!(written, !record["measurements"].as_array().unwrap().is_empty());
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
    let args = [broken.to_str().unwrap(), "builtin:plane", "--presets", "fast", "--parts", "still", "--json"];
    let out = run(&[&args[..], &TINY[..7]].concat());
    fails(&out, 3, &["broken.glb"]);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(scenes(&record), ["builtin:plane, near", "builtin:plane, far"]);
    assert_eq!(record["exit_code"], 3);
}
