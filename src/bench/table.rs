//! Measurements as tables, one for each part of a scene, with a row a contestant.

use super::chart::distinct;
use super::record::{BenchKind, Measurement, Record};
use crate::measure::regression::Values;
use crate::report::{Cell, Part, Row, Table, format_number};

/// Columns of a table at most; what has more goes on below.
const MAX_COLUMNS: usize = 9;
/// Places along an axis that a table shows at most.
const MAX_PLACES: usize = 8;

/// Device, settings and peers.
pub fn title(record: &Record) -> String {
    let settings = record.settings.iter().map(|(name, value)| format!(", {name} {value}")).collect::<String>();
    let peers = record.peers.iter().map(|p| format!("; beside {p}")).collect::<String>();
    let name = match record.benchmark {
        BenchKind::Builders => "docs/reference/bvh.md",
        _ => "docs/reference/benchmarks.md",
    };
    format!("{}{settings}{peers}; {name} explains the columns", record.host.line())
}

/// The description of a scene, its tables, and remarks on them.
pub fn scene_parts(record: &Record, scene: &str) -> Vec<Part> {
    let here: Vec<&Measurement> = record.measurements.iter().filter(|m| m.scene == scene).collect();
    let described = record.scenes.iter().find(|s| s.scene == scene);
    let about = described.map(|s| &s.about).filter(|about| !about.is_empty());
    let mut parts: Vec<Part> = about.map(|about| Part::Text(about.clone())).into_iter().collect();
    for part in distinct(here.iter().map(|m| m.part.as_str())) {
        let (curves, singles): (Vec<&Measurement>, Vec<&Measurement>) =
            here.iter().copied().filter(|m| m.part == part).partition(|m| m.along().is_some());
        let columns = distinct(singles.iter().map(|m| m.title()));
        for titles in columns.chunks(MAX_COLUMNS) {
            parts.push(table(part, titles, &singles, |m| m.title()));
        }
        for (title, axis) in distinct(curves.iter().filter_map(|m| Some((m.title(), m.along()?.axis.as_str())))) {
            let own: Vec<&Measurement> = curves
                .iter()
                .copied()
                .filter(|m| m.title() == title && m.along().is_some_and(|at| at.axis == axis))
                .collect();
            let place = |m: &Measurement| m.along().map_or_else(String::new, |at| at.value.to_string());
            let places = thinned(distinct(own.iter().map(|m| place(m))));
            parts.push(table(&format!("{part}: {title} by {axis}"), &places, &own, place));
        }
    }
    parts.extend(described.iter().flat_map(|s| &s.remarks).map(|line| Part::Text(line.clone())));
    parts
}

/// As many values as a table has columns for, the first and the last among them.
fn thinned(values: Vec<String>) -> Vec<String> {
    let last = values.len().saturating_sub(1);
    if last < MAX_PLACES {
        return values;
    }
    let kept: Vec<usize> = (0..MAX_PLACES).map(|k| k * last / (MAX_PLACES - 1)).collect();
    values.into_iter().enumerate().filter(|(k, _)| kept.contains(k)).map(|(_, v)| v).collect()
}

/// A row for each contestant that has any of the columns.
fn table(title: &str, titles: &[String], all: &[&Measurement], column_of: impl Fn(&Measurement) -> String) -> Part {
    let heads: Vec<&str> = std::iter::once(title).chain(titles.iter().map(String::as_str)).collect();
    let mut table = Table::new(&heads).titled(title);
    for contestant in distinct(all.iter().map(|m| m.contestant.as_str())) {
        let find = |title: &String| all.iter().find(|m| m.contestant == contestant && column_of(m) == *title);
        let found: Vec<Option<&&Measurement>> = titles.iter().map(find).collect();
        if found.iter().all(Option::is_none) {
            continue;
        }
        let cells = found.into_iter().map(|m| m.map_or_else(|| Cell::from("-"), |m| cell(&m.values)));
        table = table.row(Row::new(std::iter::once(Cell::from(contestant)).chain(cells)));
    }
    Part::Table(table)
}

/// A number; of repeated measurements the median and the 95th percentile.
fn cell(values: &Values) -> Cell {
    let middle = values.middle();
    if !middle.is_finite() {
        return Cell::from("-");
    }
    match values {
        Values::Repeated(p) if p.count > 1 => {
            Cell::number(middle, format!("{}..{}", format_number(middle), format_number(p.p95)))
        }
        _ => Cell::number(middle, format_number(middle)),
    }
}

/// Parts as lines of text; charts have none.
pub fn lines(parts: &[Part]) -> Vec<String> {
    let lines_of = |part: &Part| match part {
        Part::Text(text) => vec![format!("  {text}")],
        Part::Table(table) => {
            table.lines().into_iter().map(|line| format!("  {line}")).chain([String::new()]).collect()
        }
        Part::Chart(_) | Part::Images(_) => Vec::new(),
    };
    parts.iter().flat_map(lines_of).collect()
}

/// A scene with its name above, as lines of text.
pub fn scene_lines(record: &Record, scene: &str) -> Vec<String> {
    [vec![String::new(), format!("{scene}:")], lines(&scene_parts(record, scene))].concat()
}

/// All of a record, as lines of text.
pub fn record_lines(record: &Record) -> Vec<String> {
    let mut all = vec![title(record)];
    all.extend(scene_names(record).into_iter().flat_map(|scene| scene_lines(record, scene)));
    all.extend(record.stopped_early.then(|| "the time limit ended it early".to_owned()));
    all.extend(record.notes.iter().map(|note| format!("note: {note}")));
    all
}

/// Scenes in the order in which they were measured.
pub fn scene_names(record: &Record) -> Vec<&str> {
    let described = record.scenes.iter().map(|s| s.scene.as_str());
    distinct(described.chain(record.measurements.iter().map(|m| m.scene.as_str())))
}

#[cfg(test)]
mod tests {
    use super::super::record::{FRAME, quantity};
    use super::*;
    use crate::measure::stats::Percentiles;

    #[test]
    fn a_table_has_a_row_a_contestant_and_a_column_a_quantity() {
        let mut record = Record::default();
        record.row("a", "still", "fast").repeated(quantity::FRAME_TIME, Percentiles::from_values(&[1.0, 2.0, 4.0]));
        let mut row = record.row("a", "still", "quality");
        row.exact(quantity::RMSE, 0.25).exact(quantity::FLICKER, f64::INFINITY);
        (1..=20).for_each(|k| {
            row.at(FRAME, f64::from(k)).exact(quantity::RMSE, 1.0 / f64::from(k));
        });
        record.scene("a").about = "12 primitives".into();
        record.scene("a").remarks.push("quality is exact: yes".into());
        let lines = scene_lines(&record, "a");
        assert_eq!(lines[..3], ["", "a:", "  12 primitives"]);
        assert_eq!(lines[3], "  still        time, ms    RMSE  flicker");
        assert_eq!(lines[4], "  fast     2.000..4.000       -        -");
        assert_eq!(lines[5], "  quality             -  0.2500        -");
        assert!(lines[7].starts_with("  still: RMSE by frame") && lines[7].ends_with("20"), "{lines:?}");
        assert_eq!(lines[8].split_whitespace().count(), 1 + MAX_PLACES);
        assert_eq!(lines.last().unwrap(), "  quality is exact: yes");
        assert_eq!(scene_names(&record), ["a"]);
    }

    #[test]
    fn wide_tables_go_on_below() {
        let mut record = Record::default();
        let names: Vec<String> = (0..12).map(|k| format!("q{k}")).collect();
        for name in &names {
            record.row("a", "p", "c").exact(super::super::record::plain(name, ""), 1.0);
        }
        let parts = scene_parts(&record, "a");
        let width = |p: &Part| if let Part::Table(t) = p { t.columns.len() } else { 0 };
        assert_eq!(parts.iter().map(width).collect::<Vec<_>>(), [1 + MAX_COLUMNS, 1 + 3]);
    }
}
