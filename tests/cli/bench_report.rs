//! `skylit bench report` and `--baseline` from outside, with records that are made by hand: no device.
use std::path::Path;
use std::process::Output;

use crate::common::command::{assert_refusal, fails, json, place, run, stderr};
use serde_json::{Value, json};

/// Median and percentiles of repeats that spread by a few per cent.
fn times(ms: f64) -> Value {
    json!({ "median": ms, "p5": 0.96 * ms, "p25": 0.98 * ms, "p75": 1.02 * ms, "p95": 1.08 * ms, "count": 32 })
}

fn errors(rmse: f64) -> Value {
    json!({ "rmse": rmse, "rmse_corrected": 0.9 * rmse, "bias": 0.0, "flip": 0.01, "tanimoto": 0.9, "minimum_ratio": 0.9 })
}

fn preset(name: &str, ms: f64, rmse: f64) -> Value {
    let cost = json!({ "passes": [], "device_ms": times(ms), "wall_ms": times(ms), "camera_rays": 0, "rays": 1000, "skipped_rays": 0 });
    let curve = json!([{ "frame": 4, "rays": 4000, "camera_rays": 0, "errors": errors(rmse), "unfiltered": null }]);
    let still = json!({
        "cost": cost, "moving_cost": cost, "curve": curve,
        "rmse": [4.0 * rmse, 2.0 * rmse, 1.1 * rmse, rmse], "rays": [1000, 2000, 3000, 4000]
    });
    json!({ "preset": name, "technique": "traced", "primary": "traced", "rays_per_pixel": 1, "still": still, "rest": null, "moving": null })
}

/// A record of `bench ao`; times of `fast` are multiplied by `slower`.
fn ao(slower: f64, presets: &[&str]) -> Value {
    let all = [("larsen", 40.0, 0.2), ("fast", 5.0 * slower, 0.1), ("quality", 20.0, 0.05)];
    let results: Vec<Value> = all.iter().filter(|p| presets.contains(&p.0)).map(|p| preset(p.0, p.1, p.2)).collect();
    let view = json!({
        "scene": "builtin:stairs", "view": "near", "primitives": 12, "reach": 1.5, "eye": [0, 0, 0], "towards": [0, 0, 1],
        "covered": 1000, "reference_rmse": 0.01, "results": results, "verdict": {"filter_raises": []}
    });
    json!({
        "benchmark": "ao", "version": "0.1.0", "device": "a device", "driver": "a driver", "cpu": "a processor", "threads": 2,
        "tracer": "compute", "size": [64, 36], "frames": 4, "reference_rays": 64, "falloff": "exponential",
        "views": [view], "changes": [], "structures": [], "series": [], "stopped_early": false, "notes": ["a note"]
    })
}

/// A record of `bench rays`, whose repeats take these seconds; as versions without `--baseline` wrote it.
fn rays(seconds: [f64; 5]) -> Value {
    let rate = 1e6 / seconds[2] / 1e6;
    let run = json!({
        "contestant": "wide", "rays": 1_000_000, "hit_share": 0.5, "device": {"median": rate, "min": 0.9 * rate, "max": 1.1 * rate}, "wall": null,
        "seconds": seconds, "ratios": [], "nodes_per_ray": 9.5, "leaves_per_ray": 1.5
    });
    let build = json!({ "contestant": "wide", "build_seconds": 0.1, "upload_seconds": 0.1, "bytes_per_primitive": 60.0, "sah_cost": null });
    let scene = json!({
        "scene": "builtin:terrain:1000", "triangles": 1000, "spheres": 0, "instances": 1, "stored_primitives": 1000, "ao_radius": null,
        "light": [0, 1, 0], "builds": [build], "checks": [],
        "streams": [{ "stream": "primary", "rays": 1_000_000, "results": [run] }]
    });
    json!({
        "version": "0.1.0", "device": "a device", "driver": "a driver", "threads": 2, "repeats": 5, "build": "default", "peers": [],
        "baselines": [], "scenes": [scene], "scaling": [], "stopped_early": false, "notes": []
    })
}

/// A record of `bench path`.
fn path() -> Value {
    let point = |spp: u32, t: f64, rmse: f64| {
        json!({
            "spp": spp, "seconds": {"median": t, "min": 0.95 * t, "max": 1.1 * t}, "repeats": [0.95 * t, t, 1.1 * t], "rmse": rmse,
            "rmse_repeats": [0.97 * rmse, rmse, 1.02 * rmse, rmse], "unsure": false, "bad_pixels": 0.0
        })
    };
    let result = |name: &str, k: f64| {
        json!({
            "name": name, "engine": "skylit", "points": [point(1, 0.1, k), point(4, 0.4, 0.5 * k)], "bias_sigmas": null, "mpaths": 1.0, "mrays": 3.0,
            "efficiency": 10.0, "longest_launch": null, "seconds_to_target": null
        })
    };
    let references = json!([{ "engine": "skylit", "spp": 4096, "seconds": 10.0, "rmse": 0.004, "mean": 0.5 }]);
    let scene = json!({
        "scene": "cornell", "size": [64, 64], "triangles": 36, "spheres": 0, "lights": 1, "environment": "none", "references": references,
        "differences": [], "target": null, "results": [result("mis", 0.1), result("uniform", 0.8)]
    });
    json!({
        "benchmark": "path", "version": "0.1.0", "device": "a device", "driver": "a driver", "cpu": "", "threads": 2, "tracer": "compute",
        "repeats": 3, "peers": [], "scenes": [scene], "stopped_early": false, "notes": []
    })
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
    let file = records.with("ao.json", &ao(1.0, &ALL));
    fails(&report(&[]), 64, &["RECORD.json"]);
    fails(&report(&["/nonexistent.json"]), 3, &["/nonexistent.json", "no such file"]);
    let broken = records.with("broken.json", &json!({"scenes": 3}));
    fails(&report(&[&broken]), 3, &["broken.json", "is no record of `skylit bench`"]);
    fails(&report(&[&file, "--plot", "a.pdf"]), 64, &[".png or .svg"]);
    let other = records.with("path.json", &path());
    fails(&report(&[&file, "--baseline", &other]), 64, &["path.json", "`skylit bench path`"]);
}

/// A name that ends in .json is never taken for a scene, and never read to the end of a run to find that out.
#[test]
fn a_json_file_is_no_scene() {
    let records = Records::new();
    let file = records.with("a.json", &json!({}));
    for benchmark in ["ao", "rays", "path"] {
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
    let files =
        [("ao.json", ao(1.0, &ALL)), ("rays.json", rays([0.1; 5])), ("path.json", path())].map(|(n, r)| records.with(n, &r));
    let (svg, png) = (records.at("a.svg"), records.at("a.png"));
    let out = report(&[&files[0], &files[1], &files[2], "--plot", &svg]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for part in ["builtin:stairs, near", "builtin:terrain:1000: 1,000 triangles", "cornell: 64x64", "note: a note"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let drawn = std::fs::read_to_string(&svg).unwrap();
    assert!(drawn.starts_with("<svg") && drawn.trim_end().ends_with("</svg>"));
    for part in
        ["still camera", "error against time", "quality", "larsen", "Pareto front", "dominated", "primary", "cornell, 64x64"]
    {
        assert!(drawn.contains(part), "{part}");
    }
    // presets of which nothing was measured have no place in the legend
    assert!(!drawn.contains("balanced"));
    assert!(report(&[&files[0], "--plot", &png, "--quiet"]).status.success());
    let image = skylit::output::load(Path::new(&png)).unwrap();
    assert!(image.width > 1000 && image.height > 600);
}

#[test]
fn a_page_has_everything() {
    let records = Records::new();
    let files =
        [("ao.json", ao(1.2, &ALL)), ("rays.json", rays([0.1; 5])), ("path.json", path())].map(|(n, r)| records.with(n, &r));
    let before = records.with("before.json", &ao(1.0, &ALL));
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
        "Real-time ambient occlusion: builtin:stairs, near",
        "Path tracing: cornell",
        "Ray tracing: builtin:terrain:1000",
        "2 results are worse than in",
        "Worse beyond noise",
        "builtin:stairs, near, fast",
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
    let before = records.with("before.json", &ao(1.0, &ALL));
    let noisy = records.with("noisy.json", &ao(1.03, &ALL));
    let slower = records.with("slower.json", &ao(1.2, &ALL));

    let out = report(&[&noisy, "--baseline", &before]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.contains("9 results compared, 0 worse, 0 better beyond noise"), "{text}");

    let out = report(&[&slower, "--baseline", &before]);
    fails(&out, 1, &["2 results are worse than in", "builtin:stairs, near, fast", "20.0 % worse"]);
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.contains("ms a frame with camera rays") && text.contains("4 standard errors"), "{text}");

    let record = serde_json::from_slice::<Value>(&report(&[&slower, "--baseline", &before, "--json"]).stdout).unwrap();
    assert_eq!((record["exit_code"].as_u64(), record["records"][0]["benchmark"].as_str()), (Some(1), Some("ao")));
    let regressions = record["records"][0]["baseline"]["regressions"].as_array().unwrap();
    assert_eq!(regressions.len(), 2);
    for r in regressions {
        assert_eq!(
            (r["row"].as_str(), r["before"].as_f64(), r["now"].as_f64()),
            (Some("builtin:stairs, near, fast"), Some(5.0), Some(6.0))
        );
        assert!((r["worse_by"].as_f64().unwrap() - 0.2).abs() < 1e-9 && r["noise"].as_f64().unwrap() < 0.1);
    }
    // and the other way round it is better
    let better = json(&report(&[&before, "--baseline", &slower, "--json"]));
    assert_eq!(better["records"][0]["baseline"]["improvements"].as_array().unwrap().len(), 2);
}

#[test]
fn rates_of_records_without_quartiles_are_judged_by_their_repeats() {
    let records = Records::new();
    let before = records.with("before.json", &rays([0.100, 0.101, 0.099, 0.102, 0.098]));
    let slower = records.with("slower.json", &rays([0.125, 0.126, 0.124, 0.127, 0.123]));
    let wild = records.with("wild.json", &rays([0.09, 0.2, 0.101, 0.08, 0.15]));
    fails(
        &report(&[&slower, "--baseline", &before]),
        1,
        &["1 result is worse", "builtin:terrain:1000, primary, wide, Mrays/s"],
    );
    assert!(report(&[&wild, "--baseline", &before]).status.success());
}

#[test]
fn what_is_missing_is_named_and_another_machine_is_a_warning() {
    let records = Records::new();
    let before = records.with("before.json", &ao(1.0, &ALL));
    let mut fewer = ao(1.0, &["larsen", "fast"]);
    fewer["cpu"] = json!("another processor");
    let fewer = records.with("fewer.json", &fewer);
    let out = report(&[&fewer, "--baseline", &before]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(
        text.contains("in the baseline, but not in this run (3)") && text.contains("builtin:stairs, near, quality: RMSE"),
        "{text}"
    );
    assert!(stderr(&out).contains("its processor is 'a processor', not 'another processor'"), "{}", stderr(&out));

    let mut larger = ao(1.0, &ALL);
    larger["size"] = json!([128, 72]);
    let larger = records.with("larger.json", &larger);
    fails(&report(&[&larger, "--baseline", &before]), 64, &["its size is 64x36, not 128x72"]);
}
