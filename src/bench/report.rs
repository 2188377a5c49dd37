//! `skylit bench report`: saved records, shown, plotted and compared again without measuring.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde::Serialize;

use super::baseline::{Baseline, BaselineReport};
use super::common::{OutputArgs, show_address};
use super::page::ReportedRecord;
use super::record::{BenchKind, Record};
use super::table;
use crate::error::{Error, Result};
use crate::terminal::console::Failure;

/// `skylit bench report`.
#[derive(Clone, Debug, Args)]
#[command(
    before_help = "Examples:\n  skylit bench report rays.json frames.json --html report\n  skylit bench report frames.json --baseline before.json",
    mut_arg("json", |json| json.require_equals(true))
)]
pub struct BenchReportArgs {
    /// JSON records of benchmarks, in any order
    #[arg(required = true, value_name = "RECORD.json", value_hint = ValueHint::FilePath)]
    pub records: Vec<PathBuf>,
    /// Compare with an earlier JSON record, and fail if anything is worse beyond noise
    ///
    /// It may be given once for each benchmark.
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub baseline: Vec<PathBuf>,
    /// Outputs. What follows a bare `--json` is a record to read, so a file needs an `=` here.
    #[command(flatten)]
    pub outputs: OutputArgs,
}

#[derive(Serialize)]
struct ReportJson<'a> {
    records: Vec<ReportedJson<'a>>,
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
/// [`Error::Input`] for a file that is no record; [`Error::Usage`] for a baseline of another
/// benchmark; [`Error::CheckFailed`] for worse results.
pub fn run(args: &BenchReportArgs) -> Result<(), Failure> {
    let console = args.outputs.console();
    let _plan = args.outputs.check(&args.records, &args.baseline)?;
    let mut reported = Vec::new();
    for file in &args.records {
        reported.push(ReportedRecord { file: file.clone(), record: Record::read(file)?, baseline: None });
    }
    for file in &args.baseline {
        compare(&Baseline::read(file)?, &mut reported)?;
    }
    for r in &reported {
        let compared = r.baseline.as_ref().map_or_else(Vec::new, BaselineReport::parts);
        let lines = [table::record_lines(&r.record), table::lines(&compared)].concat();
        lines.iter().try_for_each(|line| console.line(line))?;
        if let Some(baseline) = &r.baseline {
            baseline.warnings.iter().for_each(|w| console.warning(w));
        }
    }
    let records = reported.iter().map(|r| ReportedJson {
        file: r.file.display().to_string(),
        benchmark: r.record.benchmark,
        baseline: r.baseline.as_ref(),
    });
    let pictures = args.outputs.write_pictures(&reported);
    let (address, drawn) = show_address(pictures, console);
    let json = ReportJson { records: records.collect(), report: address };
    let written = drawn.and(args.outputs.write_json(&json));
    let holds = reported.iter().filter_map(|r| r.baseline.as_ref()).try_for_each(BaselineReport::verdict);
    console.close(&json, written.and(holds))
}

/// Compares the records of the baseline's benchmark with it.
fn compare(baseline: &Baseline, reported: &mut [ReportedRecord]) -> Result<()> {
    let mut is_used = false;
    for r in reported.iter_mut().filter(|r| r.record.benchmark == baseline.kind()) {
        baseline.check(&r.record)?;
        r.baseline = Some(baseline.compare(&r.record));
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

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::bench::page::{page, write_plot};
    use crate::bench::record::{FRAME, HostInfo, REFERENCE, SIZE, SceneRecord, quantity};
    use crate::measure::stats::Percentiles;

    /// A record with every kind of result.
    fn record() -> Value {
        let [device, driver, cpu] = ["a device", "a driver", "a processor"].map(str::to_owned);
        let host = HostInfo { version: "0.1.0".into(), device, driver, cpu, threads: 2 };
        let settings = [("size".to_owned(), "64x36".to_owned())].into();
        let mut record = Record { benchmark: BenchKind::Frames, host, settings, ..Record::default() };
        let times = Percentiles { median: 2.0, p5: 1.9, p25: 1.95, p75: 2.1, p95: 2.3, count: 8 };
        for preset in ["fast", "quality"] {
            let mut row = record.row("a", "still", preset);
            row.repeated(quantity::FRAME_TIME, times).exact(quantity::RMSE, 0.1);
            row.exact(quantity::CORRECTED, 0.1).exact(quantity::PLAIN_CORRECTED, 0.1);
            for frame in [1.0, 4.0] {
                record.row("a", "still", preset).at(FRAME, frame).exact(quantity::RMSE.not_compared(), 0.2);
                let mut images = record.row("a", "images", preset);
                images.at("spp", frame).repeated(quantity::IMAGE_TIME, times).repeated(quantity::RMSE, times);
                record.row("a", "turn", preset).at("change", frame).exact(quantity::RMSE, 0.2);
            }
        }
        record.row("a", "still", REFERENCE).exact(quantity::RMSE.not_compared(), 0.01);
        for (scene, size) in [("b:10", 10.0), ("b:100", 100.0)] {
            record.row(scene, "primary", "wide").at(SIZE, size).repeated(quantity::RATE, times);
        }
        *record.scene("a") = SceneRecord { scene: "a".into(), about: "small".into(), remarks: vec!["good".into()] };
        serde_json::to_value(&record).unwrap()
    }

    /// Numbers of a value, each with the names and places that lead to it.
    fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
        match value {
            Value::Number(_) => found.push(path.to_owned()),
            Value::Array(all) => all.iter().enumerate().for_each(|(k, v)| numbers(v, &format!("{path}/{k}"), found)),
            Value::Object(map) => map.iter().for_each(|(k, v)| numbers(v, &format!("{path}/{k}"), found)),
            _ => {}
        }
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
        let whole = record();
        let mut places = Vec::new();
        numbers(&whole, "", &mut places);
        let (mut shown, mut refused) = (0, 0);
        for (place, number) in places.iter().flat_map(|p| extremes.iter().chain(&counts).map(move |n| (p, n))) {
            let mut changed = whole.clone();
            *changed.pointer_mut(place).unwrap() = serde_json::from_str(number).unwrap();
            std::fs::write(&file, changed.to_string()).unwrap();
            let record = match Record::read(&file) {
                Ok(record) => record,
                Err(e) => {
                    assert!(e.exit_code() == 3 && e.to_string().lines().count() == 1, "{place} {number}: {e}");
                    refused += 1;
                    continue;
                }
            };
            assert!(!table::record_lines(&record).is_empty());
            let compared = Baseline::read(&file).unwrap().compare(&record);
            let reported = [ReportedRecord { file: file.clone(), record, baseline: Some(compared) }];
            let index = crate::report::write(&dir.path().join("page"), &page(&reported, "skylit")).unwrap();
            let svg = dir.path().join("a.svg");
            write_plot(&svg, &reported).unwrap();
            for path in [index, svg] {
                assert!(!has_broken_numbers(&std::fs::read_to_string(path).unwrap()), "{place} {number}");
            }
            shown += 1;
        }
        assert!(shown > 500 && refused > 200, "{shown} {refused}");
    }
}
