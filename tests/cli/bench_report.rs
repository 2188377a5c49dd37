//! `skylit bench report` and `--baseline` from outside, with records that are made by hand: no device.
use std::path::Path;
use std::process::Output;

use crate::common::command::{assert_refusal, fails, json, place, run, stderr};
use serde_json::{Value, json};

/// Median and percentiles of repeats that spread by a few per cent.
fn times(median: f64) -> Value {
    json!({ "median": median, "p5": 0.96 * median, "p25": 0.98 * median, "p75": 1.02 * median, "p95": 1.08 * median, "count": 32 })
}

fn measured([scene, part, contestant]: [&str; 3], [quantity, unit, better]: [&str; 3], values: &Value) -> Value {
    json!({ "scene": scene, "part": part, "contestant": contestant, "quantity": quantity, "unit": unit, "better": better, "values": values })
}

fn along(mut m: Value, axis: &str, at: f64) -> Value {
    m["at"] = json!({ "axis": axis, "value": at });
    m
}

fn record(benchmark: &str, settings: &Value, measurements: &[Value]) -> Value {
    json!({
        "benchmark": benchmark, "version": "0.1.0", "device": "a device", "driver": "a driver", "cpu": "a processor", "threads": 2,
        "settings": settings, "measurements": measurements, "notes": ["a note"]
    })
}

/// A record of `bench frames`; times of `fast` are multiplied by `slower`.
fn frames(slower: f64, presets: &[&str]) -> Value {
    let mut all = Vec::new();
    for (preset, ms, rmse) in [("larsen", 40.0, 0.2), ("fast", 5.0 * slower, 0.1), ("quality", 20.0, 0.05)] {
        let row = ["builtin:stairs, near", "still", preset];
        let mut own = vec![
            measured(row, ["time", "ms", "less"], &times(ms)),
            measured(["builtin:stairs, near", "still, camera rays", preset], ["time", "ms", "less"], &times(ms)),
            measured(row, ["RMSE", "", "less"], &json!(rmse)),
            measured(row, ["corrected RMSE", "", "neither"], &json!(0.9 * rmse)),
        ];
        let frame = |k: f64| along(measured(row, ["RMSE", "", "neither"], &json!(4.0 * rmse / k)), "frame", k);
        own.extend([frame(1.0), frame(4.0)]);
        all.extend(own.into_iter().filter(|_| presets.contains(&preset)));
    }
    all.push(measured(["builtin:stairs, near", "still", "reference"], ["RMSE", "", "neither"], &json!(0.01)));
    let mut record = record("frames", &json!({ "tracer": "compute", "size": "64x36", "frames": "4" }), &all);
    record["scenes"] = json!([{ "scene": "builtin:stairs, near", "about": "12 primitives", "remarks": [] }]);
    record
}

/// A record of `bench rays`, whose rates have these quartiles.
fn rays([p25, median, p75]: [f64; 3]) -> Value {
    let rates = json!({ "median": median, "p5": p25, "p25": p25, "p75": p75, "p95": p75, "count": 5 });
    let rate = |scene: &str, size: f64| {
        along(measured([scene, "primary", "wide"], ["rate", "Mrays/s", "more"], &rates), "triangles and spheres", size)
    };
    let all = [rate("builtin:terrain:1000", 1000.0), rate("builtin:terrain:9000", 9000.0)];
    record("rays", &json!({ "rays": "64x36", "build": "default" }), &all)
}

/// A record of `bench path`.
fn path() -> Value {
    let mut all = Vec::new();
    for (name, k) in [("mis", 0.1), ("uniform", 0.8)] {
        for (spp, t, rmse) in [(1.0, 0.1, k), (4.0, 0.4, 0.5 * k)] {
            let row = ["cornell", "images", name];
            all.push(along(measured(row, ["time", "s", "less"], &times(t)), "samples per pixel", spp));
            all.push(along(measured(row, ["RMSE", "", "less"], &times(rmse)), "samples per pixel", spp));
        }
    }
    record("path", &json!({ "tracer": "compute", "size": "64x64" }), &all)
}

struct Records {
    dir: tempfile::TempDir,
}

impl Records {
    fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap() }
    }

    fn at(&self, name: &str) -> String {
        place(&self.dir, name)
    }

    /// Writes a record and returns its path.
    fn with(&self, name: &str, record: &Value) -> String {
        std::fs::write(self.at(name), serde_json::to_string(record).unwrap()).unwrap();
        self.at(name)
    }
}

fn report(args: &[&str]) -> Output {
    run(&[&["bench", "report"], args].concat())
}

const ALL: [&str; 3] = ["larsen", "fast", "quality"];

#[test]
fn wrong_usage() {
    let records = Records::new();
    let file = records.with("frames.json", &frames(1.0, &ALL));
    fails(&report(&[]), 64, &["RECORD.json"]);
    fails(&report(&["/nonexistent.json"]), 3, &["/nonexistent.json", "no such file"]);
    let broken = records.with("broken.json", &json!({"benchmark": 3, "measurements": 3}));
    fails(&report(&[&broken]), 3, &["broken.json", "is no record of `skylit bench`"]);
    fails(&report(&[&file, "--plot", "a.png"]), 64, &["must end in .svg"]);
    let old = records.with("old.json", &json!({"benchmark": "ao", "views": []}));
    fails(&report(&[&old]), 3, &["old.json", "is a record of an earlier version of `skylit bench`", "measure again"]);
    let other = records.with("path.json", &path());
    fails(&report(&[&file, "--baseline", &other]), 64, &["path.json", "`skylit bench path`"]);
}

/// A name that ends in .json is never taken for a scene, and never read to the end of a run to find that out.
#[test]
fn a_json_file_is_no_scene() {
    let records = Records::new();
    let file = records.with("a.json", &json!({}));
    for benchmark in ["ao", "frames", "rays", "path"] {
        fails(&run(&["bench", benchmark, &file]), 64, &["a JSON file is no scene", &format!("--json={file}")]);
        // behind --json it is the file: what is wrong is the scene
        let out = run(&["bench", benchmark, "--json", &file, "builtin:nothing"]);
        assert_refusal(&out, 64, "nothing", &[]);
    }
    let nowhere = run(&["bench", "ao", "builtin:plane", "--json", "/nonexistent/a.json"]);
    fails(&nowhere, 4, &["/nonexistent/a.json", "folder does not exist"]);
}

#[test]
fn saved_records_are_shown_and_plotted() {
    let records = Records::new();
    let files = [("frames.json", frames(1.0, &ALL)), ("rays.json", rays([9.9, 10.0, 10.1])), ("path.json", path())]
        .map(|(n, r)| records.with(n, &r));
    let svg = records.at("a.svg");
    let out = report(&[&files[0], &files[1], &files[2], "--plot", &svg]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for part in ["builtin:stairs, near:\n  12 primitives", "rate, Mrays/s", "cornell:", "note: a note"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let drawn = std::fs::read_to_string(&svg).unwrap();
    assert!(drawn.starts_with("<svg") && drawn.trim_end().ends_with("</svg>"));
    for part in [
        "still: time against error",
        "error over time",
        "quality",
        "larsen",
        "Pareto front",
        "primary",
        "cornell, images",
    ] {
        assert!(drawn.contains(part), "{part}");
    }
    // presets of which nothing was measured have no place in the legend
    assert!(!drawn.contains("balanced"));
}

#[test]
fn a_page_has_everything() {
    let records = Records::new();
    let files = [("frames.json", frames(1.2, &ALL)), ("rays.json", rays([9.9, 10.0, 10.1])), ("path.json", path())]
        .map(|(n, r)| records.with(n, &r));
    let before = records.with("before.json", &frames(1.0, &ALL));
    let dir = records.at("page");
    let out = report(&[&files[0], &files[1], &files[2], "--baseline", &before, "--html", &dir]);
    // written although something is worse
    fails(&out, 1, &["2 results are worse"]);
    let text = String::from_utf8(out.stdout).unwrap();
    let address = text.lines().last().unwrap();
    assert!(address.starts_with("report: file://") && address.ends_with("page/index.html"), "{address}");
    let page = std::fs::read_to_string(Path::new(&dir).join("index.html")).unwrap();
    for part in [
        "a processor",
        "Frames in real time: builtin:stairs, near",
        "Path tracing: cornell",
        "Ray tracing: builtin:terrain:1000",
        "2 results are worse than in",
        "Worse beyond noise",
        "builtin:stairs, near, still, fast",
        "Pareto front",
        "a note",
        "skylit bench report",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let one = report(&[&files[2], "--html", &dir, "--json"]);
    assert!(json(&one)["report"].as_str().unwrap().ends_with("page/index.html"));
    let page = std::fs::read_to_string(Path::new(&dir).join("index.html")).unwrap();
    assert!(page.contains("<title>Path tracing</title>") && !page.contains("builtin:stairs"));
}

#[test]
fn noise_is_no_regression_and_a_slowdown_is() {
    let records = Records::new();
    let before = records.with("before.json", &frames(1.0, &ALL));
    let noisy = records.with("noisy.json", &frames(1.03, &ALL));
    let slower = records.with("slower.json", &frames(1.2, &ALL));

    let out = report(&[&noisy, "--baseline", &before]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.contains("9 results compared, 0 worse, 0 better beyond noise"), "{text}");

    let out = report(&[&slower, "--baseline", &before]);
    fails(&out, 1, &["2 results are worse than in", "builtin:stairs, near, still", "20.0 % worse"]);
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.contains("still, camera rays, fast") && text.contains("4 standard errors"), "{text}");

    let record = serde_json::from_slice::<Value>(&report(&[&slower, "--baseline", &before, "--json"]).stdout).unwrap();
    assert_eq!((record["exit_code"].as_u64(), record["records"][0]["benchmark"].as_str()), (Some(1), Some("frames")));
    let regressions = record["records"][0]["baseline"]["regressions"].as_array().unwrap();
    assert_eq!(regressions.len(), 2);
    for r in regressions {
        assert_eq!(
            (r["quantity"].as_str(), r["before"].as_f64(), r["now"].as_f64()),
            (Some("time, ms"), Some(5.0), Some(6.0))
        );
        assert!((r["worse_by"].as_f64().unwrap() - 0.2).abs() < 1e-9 && r["noise"].as_f64().unwrap() < 0.1);
    }
    // and the other way round it is better
    let better = json(&report(&[&before, "--baseline", &slower, "--json"]));
    assert_eq!(better["records"][0]["baseline"]["improvements"].as_array().unwrap().len(), 2);
}

#[test]
fn rates_are_worse_where_they_are_less() {
    let records = Records::new();
    let before = records.with("before.json", &rays([9.9, 10.0, 10.1]));
    let slower = records.with("slower.json", &rays([7.9, 8.0, 8.1]));
    let wild = records.with("wild.json", &rays([6.0, 8.0, 12.0]));
    let worst = "builtin:terrain:1000, primary, wide, rate, Mrays/s";
    fails(&report(&[&slower, "--baseline", &before]), 1, &["2 results are worse", worst]);
    assert!(report(&[&wild, "--baseline", &before]).status.success());
    assert!(report(&[&before, "--baseline", &slower]).status.success());
}

#[test]
fn what_is_missing_is_named_and_another_machine_is_a_warning() {
    let records = Records::new();
    let before = records.with("before.json", &frames(1.0, &ALL));
    let mut fewer = frames(1.0, &["larsen", "fast"]);
    fewer["cpu"] = json!("another processor");
    let fewer = records.with("fewer.json", &fewer);
    let out = report(&[&fewer, "--baseline", &before]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(
        text.contains("in the baseline, but not in this run (3)")
            && text.contains("builtin:stairs, near, still, quality: RMSE"),
        "{text}"
    );
    assert!(stderr(&out).contains("its processor is 'a processor', not 'another processor'"), "{}", stderr(&out));

    let mut larger = frames(1.0, &ALL);
    larger["settings"]["size"] = json!("128x72");
    let larger = records.with("larger.json", &larger);
    fails(&report(&[&larger, "--baseline", &before]), 64, &["its size is 64x36, not 128x72"]);
}
