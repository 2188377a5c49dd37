//! Records as a page of a report: tables, charts, host, notes, and how they compare with their baselines.

use super::baseline::BaselineReport;
use super::plot::axis::LogAxis;
use super::plot::panel::{Mark, Panel, Point, Series};
use super::plot::{self};
use super::record::ao::AoBenchmark;
use super::record::frames::FramesBenchmark;
use super::record::path::PathBenchmark;
use super::record::rays::RayBenchmark;
use super::record::saved::SavedRecord;
use super::record::{BenchKind, HostInfo};
use super::report::ReportedRecord;
use super::table::Block;
use super::{ao, frames, path, rays};
use crate::report::{self, Axis, Cell, Chart, Page, Part, Row, Scale, Section, Status, Table};

/// A page of records. `command`: the command line that asked for it.
pub fn page(reported: &[ReportedRecord], command: &str) -> Page {
    let kinds: Vec<BenchKind> = reported.iter().map(|r| r.record.kind()).collect();
    let several = kinds.len() > 1;
    let mut sections = Vec::new();
    for r in reported {
        // a page of several benchmarks says which one a section is of
        let prefix = if several { format!("{}: ", title(r.record.kind())) } else { String::new() };
        let mut own: Vec<Section> = r.baseline.iter().map(baseline).collect();
        own.extend(match &r.record {
            SavedRecord::Ao(record) => ao_sections(record),
            SavedRecord::Path(record) => path_sections(record),
            SavedRecord::Frames(record) => frames_sections(record),
            SavedRecord::Rays(record) => rays_sections(record),
        });
        own.extend(notes(&r.record));
        if several {
            own.iter_mut().for_each(|s| s.title = format!("{prefix}{}", s.title));
            if let Some(first) = own.first_mut() {
                first.parts.insert(0, Part::Text(format!("{} on {}.", r.file.display(), plot::host_line(r.record.host()))));
            }
        }
        sections.extend(own);
    }
    Page {
        title: if several { "Benchmarks".to_owned() } else { kinds.first().map_or_else(String::new, |k| title(*k).to_owned()) },
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
        BenchKind::Ao => "Real-time ambient occlusion",
        BenchKind::Path => "Path tracing",
        BenchKind::Frames => "Frames in real time",
    }
}

/// What the page answers, and what became of the baselines.
fn summary(reported: &[ReportedRecord]) -> String {
    let of = |r: &ReportedRecord| match r.record.kind() {
        BenchKind::Rays => "How many rays a second each tracer traces.",
        BenchKind::Ao => "What a frame of each preset costs, and how far it is from the ground truth.",
        BenchKind::Path => "How the error of path-traced images falls with time.",
        BenchKind::Frames => {
            "What a frame of each preset costs, and how far it is from converged images, beside plain accumulation at equal time."
        }
    };
    let judged = reported.iter().filter_map(|r| r.baseline.as_ref()).map(|b| match b.regressions.len() {
        0 => format!("Nothing is worse than in {} beyond noise.", b.file),
        1 => format!("One result is worse than in {} beyond noise.", b.file),
        n => format!("{n} results are worse than in {} beyond noise.", b.file),
    });
    let mut sentences: Vec<String> = reported.iter().map(|r| of(r).to_owned()).collect();
    sentences.dedup();
    sentences.into_iter().chain(judged).collect::<Vec<_>>().join(" ")
}

/// What all records have in common.
fn facts(reported: &[ReportedRecord]) -> Vec<(String, String)> {
    let value = |name: &str, of: &dyn Fn(&HostInfo) -> String| {
        let mut values: Vec<String> = reported.iter().map(|r| of(r.record.host())).filter(|v| !v.is_empty()).collect();
        values.dedup();
        (values.len() == 1).then(|| (name.to_owned(), values.remove(0)))
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
    let parts = parts(&report.blocks());
    Section { status: Some(status), ..Section::new(format!("Compared with {}", report.file), parts) }
}

fn ao_sections(record: &AoBenchmark) -> Vec<Section> {
    let views = record.views.iter().map(|view| {
        let charts = plot::ao::view_panels(view, record.frames);
        Section::new(format!("{}, {}", view.scene, view.view), with_charts(&charts, &ao::table::view(view)))
    });
    let changes = record.changes.iter().map(|change| {
        let charts: Vec<Panel> = plot::ao::change(change).into_iter().collect();
        Section::new(format!("{}: {}", change.scene, change.change), with_charts(&charts, &ao::table::change(change)))
    });
    let structures = (!record.structures.is_empty())
        .then(|| Section::new("Updates of acceleration structures", parts(&ao::table::structures(&record.structures))));
    let series = record.series.iter().map(|series| {
        Section::new(
            format!("Series: {}, {}", series.series, series.scene),
            with_charts(&plot::ao::series(series), &ao::table::series(series)),
        )
    });
    views.chain(changes).chain(structures).chain(series).collect()
}

fn path_sections(record: &PathBenchmark) -> Vec<Section> {
    let section = |scene| {
        let charts: Vec<Panel> = plot::path::scene(scene).into_iter().collect();
        with_charts(&charts, &path::table::scene(scene))
    };
    record.scenes.iter().map(|s| Section::new(s.scene.clone(), section(s))).collect()
}

fn frames_sections(record: &FramesBenchmark) -> Vec<Section> {
    let views = record.views.iter().map(|view| {
        let charts = plot::frames::view(view, record.frames);
        Section::new(view.scene.clone(), with_charts(&charts, &frames::table::view(view)))
    });
    let bounces = (!record.bounces.is_empty()).then(|| {
        let charts: Vec<Panel> = plot::frames::bounces(&record.bounces).into_iter().collect();
        Section::new("Bounces and time", with_charts(&charts, &frames::table::bounces(&record.bounces)))
    });
    views.chain(bounces).collect()
}

fn rays_sections(record: &RayBenchmark) -> Vec<Section> {
    let charts: Vec<Panel> = plot::rays::plot(record).groups.into_iter().flatten().collect();
    let rates = Section::new("Rate against scene size", with_charts(&charts, &rays::table::scaling(record)));
    let scenes = record.scenes.iter().map(|s| {
        // tables that one looks up
        Section { folded: true, ..Section::new(s.scene.clone(), parts(&rays::table::scene(s, &record.baselines))) }
    });
    [rates].into_iter().chain(scenes).collect()
}

/// What was left out, and why.
fn notes(record: &SavedRecord) -> Option<Section> {
    let completeness = record.completeness();
    let early = completeness.stopped_early.then(|| Part::Text("The time limit ended the run early.".to_owned()));
    let notes: Vec<Part> = early.into_iter().chain(completeness.notes.iter().cloned().map(Part::Text)).collect();
    (!notes.is_empty()).then(|| Section { folded: true, ..Section::new("Notes", notes) })
}

fn with_charts(panels: &[Panel], blocks: &[Block]) -> Vec<Part> {
    panels.iter().map(|p| Part::Chart(chart(p))).chain(parts(blocks)).collect()
}

/// Text and tables of the terminal.
fn parts(blocks: &[Block]) -> Vec<Part> {
    let of = |block: &Block| match block {
        Block::Line(text) => (!text.trim().is_empty()).then(|| Part::Text(text.trim().to_owned())),
        Block::Table { title, rows, .. } => table(rows).map(|t| Part::Table(t.titled(*title))),
    };
    blocks.iter().filter_map(of).collect()
}

/// A table; `None` for one without rows. The first column's title says what the table is about.
fn table(rows: &[Vec<String>]) -> Option<Table> {
    let (head, body) = rows.split_first()?;
    let titles: Vec<&str> = head.iter().map(String::as_str).collect();
    let row = |cells: &Vec<String>| {
        // a row may end early
        let missing = head.len().saturating_sub(cells.len());
        Row::new(cells.iter().map(|c| cell(c)).chain((0..missing).map(|_| Cell::from(""))))
    };
    (!body.is_empty()).then(|| body.iter().fold(Table::new(&titles), |table, cells| table.row(row(cells))))
}

/// A cell that is sorted by the number that it begins with: `1,234`, `12.5..14.0`, `~3.1`, `0.5 %`.
fn cell(text: &str) -> Cell {
    let digits = text.trim_start_matches(['~', '<', '+']).replace(',', "");
    let first = digits.split("..").next().unwrap_or_default();
    let first = first.trim_end_matches(['?', '%', ' ']);
    match first.parse::<f64>() {
        Ok(value) if value.is_finite() => Cell::number(value, text),
        _ => Cell::from(text),
    }
}

/// A panel as a chart of the page, which has colours of its own for either theme.
pub fn chart(panel: &Panel) -> Chart {
    let points = || panel.series.iter().flat_map(Series::placed);
    let bars = |of: fn(&Point) -> Option<[f64; 2]>| points().filter_map(of).flatten();
    let x = LogAxis::of(points().map(|p| p.x).chain(bars(|p| p.x_bar)));
    let y = LogAxis::of(points().map(|p| p.y).chain(bars(|p| p.y_bar)));
    let axis = |label: &str, axis: Option<LogAxis>| Axis {
        label: label.to_owned(),
        scale: Scale::Logarithmic,
        range: axis.map(|a| a.ends()),
    };
    let ends = [x, y].map(|a| a.map_or([1.0; 2], |a| a.ends()));
    let series = panel.series.iter().filter(|s| s.placed().next().is_some());
    Chart {
        title: panel.title.clone(),
        caption: panel.caption.clone(),
        x: axis(&panel.x, x),
        y: axis(&panel.y, y),
        series: series.map(|s| chart_series(s, ends)).collect(),
    }
}

fn chart_series(series: &Series, [x, y]: [[f64; 2]; 2]) -> report::Series {
    let point = |p: &Point| report::Point {
        x: p.x,
        y: p.y,
        x_bar: p.x_bar,
        y_bar: p.y_bar,
        name: p.label.clone(),
        label: String::new(),
        is_muted: p.is_dominated,
    };
    let points: Vec<report::Point> = match series.mark {
        Mark::Front => front(series, [x[1], y[1]]).into_iter().map(report::Point::from).collect(),
        Mark::Level => series.placed().take(1).flat_map(|p| x.map(|x| report::Point::from((x, p.y)))).collect(),
        _ => series.placed().map(point).collect(),
    };
    let mark = match series.mark {
        Mark::Discs | Mark::Triangles | Mark::Crosses => report::Mark::LineAndPoints,
        Mark::Circles | Mark::Labelled => report::Mark::Points,
        Mark::Front => report::Mark::Border,
        Mark::Guide | Mark::Level => report::Mark::Dashed,
    };
    report::Series { name: series.name.clone(), mark, points }
}

/// Corners of the border of what is dominated, from the upper end of the chart to its right end.
fn front(series: &Series, [right, top]: [f64; 2]) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = series.placed().map(|p| (p.x, p.y)).collect();
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let steps = points.windows(2).flat_map(|w| [(w[1].0, w[0].1), w[1]]);
    [(first.0, top), *first].into_iter().chain(steps).chain([(right, last.1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_sorted_by_their_numbers() {
        let value = |text: &str| cell(text).value;
        let numbers = ["1,234", "12.5..14.0", "~3.1", "0.5 %", "1.2e-3?", "+0.01", "-0.5"].map(value);
        assert_eq!(numbers, [1234.0, 12.5, 3.1, 0.5, 1.2e-3, 0.01, -0.5].map(Some));
        assert_eq!(["fast", "-", "", "inf", "NaN", "3 frames", "2 in 5"].map(value), [None; 7]);
        assert_eq!(cell("12.5..14.0").text, "12.5..14.0");
    }

    #[test]
    fn panels_become_charts() {
        let mut panel = Panel { title: "t".into(), x: "ms".into(), ..Panel::default() };
        let named = |name: &str, x: f64, y: f64| (name.to_owned(), Point::from((x, y)));
        panel.add_pareto(vec![named("a", 1.0, 3.0), named("b", 2.0, 1.0), named("c", 3.0, 3.0)]);
        let chart = chart(&panel);
        let names: Vec<_> = chart.series.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["Pareto front", "a", "b", "c"]);
        let ([right, top], front) = ([chart.x.range.unwrap()[1], chart.y.range.unwrap()[1]], &chart.series[0].points);
        let corners: Vec<_> = front.iter().map(|p| (p.x, p.y)).collect();
        assert_eq!(corners, [(1.0, top), (1.0, 3.0), (2.0, 3.0), (2.0, 1.0), (right, 1.0)]);
        assert!(chart.series[3].points[0].is_muted && !chart.series[2].points[0].is_muted);
    }

    #[test]
    fn tables_keep_their_titles() {
        let rows =
            [vec!["preset", "ms"], vec!["fast", "3.5"], vec!["none"]].map(|r| r.into_iter().map(str::to_owned).collect());
        let table = table(&rows).unwrap();
        assert_eq!((table.columns[1].title.as_str(), table.rows.len(), table.rows[1].cells.len()), ("ms", 2, 2));
        assert!(super::table(&rows[..1]).is_none());
    }
}
