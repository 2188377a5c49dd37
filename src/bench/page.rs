//! Records as a page and as a plot: tables, charts, host, notes, and comparisons with baselines.

use std::path::{Path, PathBuf};

use super::baseline::BaselineReport;
use super::record::{BenchKind, HostInfo, Record};
use super::{chart, table};
use crate::error::Result;
use crate::report::{self, Chart, Page, Part, Section, Status};

/// A record with the file that it was read from, and how it compares with a baseline.
pub struct ReportedRecord {
    pub file: PathBuf,
    pub record: Record,
    /// The comparison, if a baseline of this benchmark is given.
    pub baseline: Option<BaselineReport>,
}

/// A page of records. `command`: the command line that asked for it.
pub fn page(reported: &[ReportedRecord], command: &str) -> Page {
    let several = reported.len() > 1;
    let mut sections = Vec::new();
    for r in reported {
        let mut own: Vec<Section> = r.baseline.iter().map(baseline).collect();
        own.extend(record_sections(&r.record));
        // a page of several benchmarks says which one a section is of
        if several {
            own.iter_mut().for_each(|s| s.title = format!("{}: {}", title(r.record.benchmark), s.title));
            if let Some(first) = own.first_mut() {
                first.parts.insert(0, Part::Text(format!("{} on {}.", r.file.display(), r.record.host.line())));
            }
        }
        sections.extend(own);
    }
    let only = reported.first().map_or("", |r| title(r.record.benchmark));
    Page {
        title: if several { "Benchmarks" } else { only }.to_owned(),
        summary: summary(reported),
        command: command.to_owned(),
        facts: facts(reported),
        warnings: reported.iter().filter_map(|r| r.baseline.as_ref()).flat_map(|b| b.warnings.clone()).collect(),
        sections,
    }
}

fn title(kind: BenchKind) -> &'static str {
    match kind {
        BenchKind::Rays => "Ray tracing",
        BenchKind::Path => "Path tracing",
        BenchKind::Frames => "Frames in real time",
        BenchKind::Builders => "Builders of hierarchies",
    }
}

/// The questions that the page answers, and the outcome of baselines.
fn summary(reported: &[ReportedRecord]) -> String {
    let question = |r: &ReportedRecord| match r.record.benchmark {
        BenchKind::Rays => "How many rays a second each tracer traces.",
        BenchKind::Path => "How the error of path-traced images falls with time.",
        BenchKind::Builders => "What rays cost in trees that were built for them.",
        BenchKind::Frames => {
            "What a frame of each preset costs, and how far it is from converged images, beside plain accumulation at equal time."
        }
    };
    let judged = reported.iter().filter_map(|r| r.baseline.as_ref()).map(|b| match b.regressions.len() {
        0 => format!("Nothing is worse than in {} beyond noise.", b.file),
        1 => format!("One result is worse than in {} beyond noise.", b.file),
        n => format!("{n} results are worse than in {} beyond noise.", b.file),
    });
    let questions = chart::distinct(reported.iter().map(question)).into_iter().map(str::to_owned);
    questions.chain(judged).collect::<Vec<_>>().join(" ")
}

/// The facts that all records have in common.
fn facts(reported: &[ReportedRecord]) -> Vec<(String, String)> {
    let value = |name: &str, of_host: &dyn Fn(&HostInfo) -> String| {
        let values = chart::distinct(reported.iter().map(|r| of_host(&r.record.host)).filter(|v| !v.is_empty()));
        (values.len() == 1).then(|| (name.to_owned(), values[0].clone()))
    };
    let all = [
        value("device", &|h| h.device.clone()),
        value("driver", &|h| h.driver.clone()),
        value("processor", &|h| h.cpu.clone()),
        value("threads", &|h| h.threads.to_string()),
        value("skylit", &|h| h.version.clone()),
    ];
    all.into_iter().flatten().collect()
}

fn baseline(report: &BaselineReport) -> Section {
    let status = if report.regressions.is_empty() { Status::Good } else { Status::Bad };
    Section { status: Some(status), ..Section::new(format!("Compared with {}", report.file), report.parts()) }
}

/// Charts over all scenes, each scene, and what was left out.
fn record_sections(record: &Record) -> Vec<Section> {
    let mut sections = Vec::new();
    let over_sizes: Vec<Part> = chart::size_charts(record).into_iter().map(Part::Chart).collect();
    sections.extend((!over_sizes.is_empty()).then(|| Section::new("By the size of scenes", over_sizes)));
    for scene in table::scene_names(record) {
        let charts = chart::scene_charts(record, scene).into_iter().map(Part::Chart);
        sections.push(Section::new(scene, charts.chain(table::scene_parts(record, scene)).collect()));
    }
    let early = record.stopped_early.then(|| Part::Text("The time limit ended the run early.".to_owned()));
    let notes: Vec<Part> = early.into_iter().chain(record.notes.iter().cloned().map(Part::Text)).collect();
    sections.extend((!notes.is_empty()).then(|| Section { folded: true, ..Section::new("Notes", notes) }));
    sections
}

/// Writes all charts of records into one SVG.
pub fn write_plot(path: &Path, reported: &[ReportedRecord]) -> Result<()> {
    let charts = |r: &ReportedRecord| -> Vec<Chart> {
        let scenes = table::scene_names(&r.record);
        let of_scenes = scenes.into_iter().flat_map(|scene| chart::scene_charts(&r.record, scene));
        chart::size_charts(&r.record).into_iter().chain(of_scenes).collect()
    };
    let titles = chart::distinct(reported.iter().map(|r| title(r.record.benchmark)));
    let hosts = chart::distinct(reported.iter().map(|r| r.record.host.line()));
    let charts: Vec<Chart> = reported.iter().flat_map(charts).collect();
    report::write_svg(path, &titles.join(", "), &hosts.join("; "), &charts)
}
