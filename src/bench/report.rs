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
    before_help = "Examples:\n  skylit bench report rays.json ao.json --html report\n  skylit bench report ao.json --baseline before.json"
)]
pub struct BenchReportArgs {
    /// JSON records of benchmarks, in any order
    #[arg(required = true, value_name = "RECORD.json", value_hint = ValueHint::FilePath)]
    pub records: Vec<PathBuf>,
    /// Compare with an earlier JSON record of the same benchmark; once for each benchmark. Anything that is worse beyond noise is named and fails
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub baseline: Vec<PathBuf>,
    /// Outputs
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
    args.outputs.check(&args.records, &args.baseline)?;
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
