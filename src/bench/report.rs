//! `skylit bench report`: saved records, shown, plotted and compared again without measuring anything.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde::Serialize;

use super::ao;
use super::baseline::{Baseline, BaselineReport};
use super::common::OutputArgs;
use super::frames;
use super::path;
use super::rays;
use super::record::saved::SavedRecord;
use super::record::{BenchKind, Completeness};
use super::table::{self, Block};
use crate::error::{Error, Result};
use crate::terminal::console::{Console, Failure};

/// `skylit bench report`.
#[derive(Clone, Debug, Args)]
#[command(
    before_help = "Examples:\n  skylit bench report rays.json ao.json --html report\n  skylit bench report ao.json --baseline before.json",
    mut_arg("json", |json| json.require_equals(true))
)]
pub struct BenchReportArgs {
    /// JSON records of benchmarks, in any order
    #[arg(required = true, value_name = "RECORD.json", value_hint = ValueHint::FilePath)]
    pub records: Vec<PathBuf>,
    /// Compare with an earlier JSON record of the same benchmark; once for each benchmark. Anything that is worse beyond noise is named and fails
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub baseline: Vec<PathBuf>,
    /// Outputs. What follows a bare `--json` is a record to read, so a file needs an `=` here.
    #[command(flatten)]
    pub outputs: OutputArgs,
}

/// A record with the file that it was read from, and how it compares with a baseline.
pub struct ReportedRecord {
    /// The file.
    pub file: PathBuf,
    /// What was measured.
    pub record: SavedRecord,
    /// The comparison, if a baseline of this benchmark is given.
    pub baseline: Option<BaselineReport>,
}

#[derive(Serialize)]
struct ReportJson<'a> {
    records: Vec<ReportedJson<'a>>,
    /// Address of the page.
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<String>,
}

#[derive(Serialize)]
struct ReportedJson<'a> {
    file: String,
    benchmark: BenchKind,
    baseline: Option<&'a BaselineReport>,
}

/// Shows, plots and compares.
///
/// # Errors
/// [`Error::Input`] for a file that is no record; [`Error::Usage`] for a baseline of a benchmark that is not reported; [`Error::CheckFailed`] for results that are
/// worse than a baseline's.
pub fn run(args: &BenchReportArgs) -> Result<(), Failure> {
    let console = args.outputs.console();
    let _plan = args.outputs.check(&args.records, &args.baseline)?;
    let mut reported = Vec::new();
    for file in &args.records {
        reported.push(ReportedRecord { file: file.clone(), record: SavedRecord::read(file)?, baseline: None });
    }
    for file in &args.baseline {
        compare(&Baseline::read(file)?, &mut reported)?;
    }
    for r in &reported {
        let baseline = r.baseline.as_ref().map_or_else(Vec::new, BaselineReport::blocks);
        table::lines(&[blocks(&r.record), baseline].concat()).iter().try_for_each(|line| console.line(line))?;
        if let Some(baseline) = &r.baseline {
            baseline.warnings.iter().for_each(|w| console.warning(w));
        }
    }
    let records = reported.iter().map(|r| ReportedJson {
        file: r.file.display().to_string(),
        benchmark: r.record.kind(),
        baseline: r.baseline.as_ref(),
    });
    let pictures = args.outputs.write_pictures(&reported);
    let (address, drawn) = show_address(pictures, console);
    let json = ReportJson { records: records.collect(), report: address };
    let written = drawn.and(args.outputs.write_json(&json));
    let holds = reported.iter().filter_map(|r| r.baseline.as_ref()).try_for_each(BaselineReport::verdict);
    console.close(&json, written.and(holds))
}

/// Prints the address of a page, if one was written. Returns it, and what went wrong.
pub fn show_address(pictures: Result<Option<String>>, console: Console) -> (Option<String>, Result<()>) {
    match pictures {
        Ok(address) => {
            let shown = address.as_ref().map_or(Ok(()), |a| console.line(&format!("report: {a}")));
            (address, shown)
        }
        Err(e) => (None, Err(e)),
    }
}

/// Compares the records of the baseline's benchmark with it.
fn compare(baseline: &Baseline, reported: &mut [ReportedRecord]) -> Result<()> {
    let mut is_used = false;
    for r in reported.iter_mut().filter(|r| r.record.kind() == baseline.kind()) {
        let now = r.record.snapshot();
        baseline.check(&now)?;
        r.baseline = Some(baseline.compare(&now));
        is_used = true;
    }
    if is_used {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "--baseline {}: it is a record of `skylit bench {}`, and none of the records is",
        baseline.file().display(),
        baseline.kind().name()
    )))
}

/// The tables of a record, as its benchmark printed them, and its notes.
fn blocks(record: &SavedRecord) -> Vec<Block> {
    let mut blocks = match record {
        SavedRecord::Rays(r) => rays::table::blocks(r),
        SavedRecord::Ao(r) => ao::table::blocks(r),
        SavedRecord::Path(r) => path::table::blocks(r),
        SavedRecord::Frames(r) => frames::table::blocks(r),
    };
    let Completeness { stopped_early, notes } = record.completeness();
    blocks.extend(stopped_early.then(|| Block::line("the time limit ended it early")));
    blocks.extend(notes.iter().map(|n| Block::line(format!("note: {n}"))));
    blocks
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::bench::page::page;
    use crate::bench::plot::{self, picture};

    /// A record of each benchmark with something in each of its lists.
    fn records() -> [Value; 4] {
        let times = json!({ "median": 2.0, "p5": 1.9, "p25": 1.95, "p75": 2.1, "p95": 2.3, "count": 8 });
        let summary = json!({ "median": 2.0, "min": 1.5, "max": 2.5 });
        let pass = json!({ "pass": "gather", "ms": times });
        let cost = json!({ "passes": [pass], "device_ms": times, "wall_ms": times, "camera_rays": 7.0, "rays": 9.0, "skipped_rays": 1.0 });
        let errors = json!({ "rmse": 0.1, "rmse_corrected": 0.09, "rel_mse": 0.2, "bias": -0.01, "flip": 0.05, "tanimoto": 0.9, "minimum_ratio": 0.9 });
        let host = json!({ "version": "0.1.0", "device": "a device", "driver": "a driver", "cpu": "a processor", "threads": 2, "size": [64, 36], "frames": 4, "repeats": 3 });
        let with_host = |mut record: Value| {
            for (key, value) in host.as_object().unwrap() {
                record[key] = value.clone();
            }
            record
        };
        let point = json!({ "frame": 4, "rays": 40, "camera_rays": 7, "errors": errors, "unfiltered": errors });
        let still =
            json!({ "cost": cost, "moving_cost": cost, "curve": [point], "rmse": [0.4, 0.2, 0.1], "rays": [10, 20, 40] });
        let moving = json!({ "degrees_per_frame": 1.0, "cost": cost, "frames": [3], "errors": errors, "unfiltered": errors, "reference_rmse": 0.01 });
        let rest = json!({ "frames": 9, "cost": cost, "errors": errors });
        let result = json!({ "preset": "fast", "technique": "traced", "primary": "traced", "rays_per_pixel": 1, "still": still, "rest": rest, "moving": moving });
        let verdict = json!({ "rays_ratio": 0.5, "rmse_ratio": 0.5, "frames_to_reach": 3, "rays_to_reach": 30, "rays_to_reach_ratio": 0.5, "filter_raises": [] });
        let view = json!({ "scene": "a", "view": "near", "primitives": 12, "reach": 1.5, "eye": [0.5, 1.0, 2.0], "towards": [0.0, 0.0, 1.0], "covered": 900, "reference_rmse": 0.01, "results": [result], "verdict": verdict });
        let changed = json!({ "preset": "fast", "residuals": [1.0, 0.5], "memory": [0.9, 0.4], "memory_half_life": 2.0, "half_life": 2.0, "fitted_half_life": 2.0, "gone": 3, "ghosting": 0.1, "times_as_quick": 2.0, "rmse": [0.2, 0.1], "recovery": 3, "recovery_to_larsen": 3, "stale_pixels": 4, "stale_pixels_by_chance": 1, "errors": errors, "cost": cost, "update_ms": times, "plain": [{ "frame": 1, "rmse": 0.1 }, { "frame": 2, "rmse": 0.1 }] });
        let change =
            json!({ "scene": "a", "change": "appear", "frames": 2, "pixels": 9, "reference_rmse": 0.01, "results": [changed] });
        let structure = json!({ "scene": "a", "primitives": 12, "stored": 12, "meshes": 1, "instances": 1, "build_ms": 2.0, "upload_ms": 1.0, "top": times, "top_rebuilt": true, "mesh_triangles": 12, "refit": times, "rebuild": times });
        let line = json!({ "name": "fast", "points": [
            { "scene": "a", "x": 10.0, "cost": cost, "rmse": 0.1, "unfiltered_rmse": 0.2, "equal_time_rmse": 0.1 },
            { "scene": "b", "x": 100.0, "cost": cost, "rmse": 0.05, "unfiltered_rmse": 0.2, "equal_time_rmse": 0.1 }
        ]});
        let series = json!({ "series": "triangles", "scene": "several", "lines": [line] });
        let ao = with_host(
            json!({ "benchmark": "ao", "reference_rays": 64, "views": [view], "changes": [change], "structures": [structure], "series": [series] }),
        );

        let plain = json!({ "paths": 4, "ms": 2.0, "errors": errors });
        let curve = json!([{ "frame": 1, "errors": errors, "plain": plain }, { "frame": 4, "errors": errors, "plain": plain }]);
        let peer = json!({ "peer": "another", "reference_rmse": 0.01, "ms_per_image": 1.0, "ms_per_path": 0.5, "points": [{ "frame": 4, "paths": 4, "errors": errors }] });
        let still = json!({ "preset": "fast", "rays_per_pixel": 1, "cost": cost, "curve": curve, "flicker": { "after": 64, "rms": 0.001, "greatest": 0.002 }, "denoised": plain, "peers": [peer] });
        let motion = json!({ "motion": "orbit", "frames": [3], "reference_rmse": 0.01, "results": [{ "preset": "fast", "cost": cost, "errors": errors, "plain": plain, "denoised": plain }] });
        let view = json!({ "scene": "a", "primitives": 12, "light": "a sun", "ms_per_path": 0.5, "ms_per_image": 1.0, "reference_rmse": 0.01, "still": [still], "motions": [motion], "changes": [change] });
        let bounces = json!({ "scene": "a", "preset": "fast", "points": [{ "bounces": 1, "cost": cost }, { "bounces": 4, "cost": cost }] });
        let frames = with_host(
            json!({ "benchmark": "frames", "seed": 0, "runs": 1, "reference_paths": 64, "views": [view], "bounces": [bounces] }),
        );

        let run = json!({ "contestant": "wide", "rays": 1000, "hit_share": 0.5, "device": summary, "wall": summary, "seconds": [0.1, 0.2], "ratios": [{ "to": "bvh2", "ratio": 1.5 }], "nodes_per_ray": 9.5, "leaves_per_ray": 1.5 });
        let build = json!({ "contestant": "wide", "build_seconds": 0.1, "upload_seconds": 0.1, "bytes_per_primitive": 60.0, "sah_cost": 30.0 });
        let check = json!({ "contestant": "wide", "reference": "bvh2", "stream": "primary", "rays": 100, "agree": 98, "ties": 1, "unexplained": 1, "reference_unexplained": 0, "strict": false, "examples": [] });
        let scene = |name: &str, triangles: u64| json!({ "scene": name, "triangles": triangles, "spheres": 1, "instances": 1, "stored_primitives": 1000, "ao_radius": 0.5, "light": [0.0, 1.0, 0.0], "builds": [build], "checks": [check], "streams": [{ "stream": "primary", "rays": 1000, "results": [run] }] });
        let rays = with_host(
            json!({ "benchmark": "rays", "build": "default", "baselines": ["bvh2"], "scenes": [scene("terrain:1000", 1000), scene("terrain:9000", 9000)], "scaling": [] }),
        );

        let point = |spp: u32, rmse: f64| json!({ "spp": spp, "seconds": summary, "repeats": [0.1, 0.2], "rmse": rmse, "rmse_repeats": [rmse, rmse], "unsure": false, "bad_pixels": 0.1 });
        let contestant = json!({ "name": "mis", "engine": "skylit", "points": [point(1, 0.2), point(4, 0.1)], "bias_sigmas": 0.5, "mpaths": 1.0, "mrays": 3.0, "efficiency": 10.0, "longest_launch": 0.5, "seconds_to_target": { "seconds": 1.0, "how": "between" } });
        let reference = json!({ "engine": "skylit", "spp": 4096, "seconds": 10.0, "rmse": 0.004, "mean": 0.5 });
        let difference = json!({ "engine": "another", "mean_ratio": 1.0, "rmse": 0.01, "explained": 0.01 });
        let scene = json!({ "scene": "a", "size": [64, 64], "triangles": 36, "spheres": 1, "lights": 1, "references": [reference], "differences": [difference], "target": { "rmse": 0.1, "set_by": "mis" }, "results": [contestant] });
        let path = with_host(json!({ "benchmark": "path", "scenes": [scene] }));
        [ao, frames, rays, path]
    }

    /// Names of the fields that are numbers, or lists of them.
    fn numbers(value: &Value, names: &mut std::collections::BTreeSet<String>) {
        for (name, v) in value.as_object().into_iter().flatten() {
            if v.is_number() || v.as_array().is_some_and(|all| all.iter().any(Value::is_number)) {
                names.insert(name.clone());
            }
            numbers(v, names);
        }
        value.as_array().into_iter().flatten().for_each(|v| numbers(v, names));
    }

    /// Gives every number of this name another value.
    fn replace(value: &mut Value, name: &str, number: &Value) {
        for (key, v) in value.as_object_mut().into_iter().flatten() {
            match v {
                Value::Number(_) if key == name => *v = number.clone(),
                Value::Array(all) if key == name => all.iter_mut().filter(|v| v.is_number()).for_each(|v| *v = number.clone()),
                _ => replace(v, name, number),
            }
        }
        value.as_array_mut().into_iter().flatten().for_each(|v| replace(v, name, number));
    }

    /// Whether an attribute of a page or drawing is numbers, and one of them is none.
    fn has_broken_numbers(text: &str) -> bool {
        text.split("=\"").skip(1).filter_map(|rest| rest.split('"').next()).any(|value| {
            let numbers = value.split([' ', ',']).map(|word| word.parse::<f64>().ok()).collect::<Option<Vec<f64>>>();
            numbers.is_some_and(|all| !all.iter().all(|n| n.is_finite()))
        })
    }

    #[test]
    fn no_number_of_a_record_breaks_a_report() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a.json");
        let extremes = ["0", "-1", "5e-324", "-1e-320", "1e-100", "1e100", "-1e100", "1e308", "null"];
        let counts = ["4294967295", "9007199254740992", "18446744073709551615"];
        let (mut shown, mut refused) = (0, 0);
        for record in records() {
            let mut names = std::collections::BTreeSet::new();
            numbers(&record, &mut names);
            for (name, number) in names.iter().flat_map(|name| extremes.iter().chain(&counts).map(move |n| (name, n))) {
                let mut changed = record.clone();
                replace(&mut changed, name, &serde_json::from_str(number).unwrap());
                std::fs::write(&file, changed.to_string()).unwrap();
                let record = match SavedRecord::read(&file) {
                    Ok(record) => record,
                    Err(e) => {
                        assert!(e.exit_code() == 3 && e.to_string().lines().count() == 1, "{name} {number}: {e}");
                        refused += 1;
                        continue;
                    }
                };
                assert!(!table::lines(&blocks(&record)).is_empty());
                let baseline = Baseline::read(&file).unwrap();
                let now = record.snapshot();
                let compared = baseline.compare(&now);
                let reported = [ReportedRecord { file: file.clone(), record, baseline: Some(compared) }];
                let index = crate::report::write(&dir.path().join("page"), &page(&reported, "skylit")).unwrap();
                // with all numbers beyond what a plot can show there is none
                let svg = picture::svg(&plot::of_all(&reported)).unwrap_or_default();
                for text in [std::fs::read_to_string(index).unwrap(), svg] {
                    assert!(!has_broken_numbers(&text), "{name} {number}");
                }
                shown += 1;
            }
        }
        assert!(shown > 500 && refused > 200, "{shown} {refused}");
    }
}
