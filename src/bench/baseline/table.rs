//! The comparison with a baseline as text and tables.

use super::{BaselineReport, Change};
use crate::measure::regression::RULE;
use crate::report::{Cell, Part, Row, Table, format_number};

/// Names of missing results that are printed; the record has all.
const MAX_NAMES: usize = 12;

pub fn parts(report: &BaselineReport) -> Vec<Part> {
    let single = match report.not_judged {
        0 => String::new(),
        n => format!("; {n} of single measurements are not judged"),
    };
    let head = format!(
        "baseline {} (skylit {}): {} results compared, {} worse, {} better beyond noise{single}",
        report.file,
        report.version,
        report.compared,
        report.regressions.len(),
        report.improvements.len()
    );
    let mut parts = vec![Part::Text(head), Part::Text(RULE.to_owned())];
    if let Some(typical) = report.typical_change {
        parts.push(Part::Text(format!("repeated results are typically {}", relative(typical))));
    }
    for (title, changes) in [
        ("Worse beyond noise", &report.regressions),
        ("Worse beyond noise, of peers", &report.worse_peers),
        ("Better beyond noise", &report.improvements),
    ] {
        parts.extend((!changes.is_empty()).then(|| Part::Table(table(title, changes))));
    }
    if !report.missing.is_empty() {
        parts.push(Part::Text(format!("in the baseline, but not in this run ({}):", report.missing.len())));
        parts.extend(report.missing.iter().take(MAX_NAMES).map(|name| Part::Text(format!("  {name}"))));
        if report.missing.len() > MAX_NAMES {
            parts.push(Part::Text(format!("  and {} more (--json names all)", report.missing.len() - MAX_NAMES)));
        }
    }
    if report.new > 0 {
        parts.push(Part::Text(format!("{} results are not in the baseline", report.new)));
    }
    parts
}

fn table(title: &str, changes: &[Change]) -> Table {
    let head = Table::new(&[title, "quantity", "baseline", "now", "change", "noise"]).titled(title);
    changes.iter().fold(head, |table, c| {
        let [row, quantity] = [&c.row, &c.quantity].map(|text| Cell::from(text.as_str()));
        let [before, now] = [c.before, c.now].map(|value| finite_cell(value, format_number(value)));
        let change = finite_cell(c.worse_by, relative(c.worse_by));
        let noise = finite_cell(c.noise, format!("{:.1} %", 100.0 * c.noise));
        table.row(Row::new([row, quantity, before, now, change, noise]))
    })
}

/// A cell that is sorted by its number, where that is one.
fn finite_cell(value: f64, text: String) -> Cell {
    if value.is_finite() { Cell::number(value, text) } else { Cell::from(text) }
}

/// Before, now, and by how much.
pub fn change_text(c: &Change) -> String {
    format!("{}, before {}: {}", format_number(c.now), format_number(c.before), relative(c.worse_by))
}

fn relative(worse_by: f64) -> String {
    let size = 100.0 * worse_by.abs();
    let direction = if worse_by < 0.0 { "better" } else { "worse" };
    if size.is_finite() { format!("{size:.1} % {direction}") } else { direction.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_changed() {
        let change = |row: &str, worse_by| Change {
            row: row.into(),
            quantity: "ms".into(),
            before: 10.0,
            now: 12.0,
            worse_by,
            noise: 0.05,
        };
        let report = BaselineReport {
            file: "a.json".into(),
            version: "0.1.0".into(),
            compared: 9,
            not_judged: 2,
            typical_change: Some(-0.012),
            regressions: vec![change("stairs, near", 0.2)],
            improvements: vec![change("stairs, far", -0.1)],
            missing: (0..14).map(|k| format!("m{k}")).collect(),
            new: 3,
            ..BaselineReport::default()
        };
        let text = crate::bench::table::lines(&parts(&report)).join("\n");
        for part in [
            "baseline a.json (skylit 0.1.0): 9 results compared, 1 worse, 1 better beyond noise; 2 of single measurements are not judged",
            "typically 1.2 % better",
            "stairs, near              ms     10.00  12.00  20.0 % worse  5.0 %",
            "10.0 % better",
            "not in this run (14):",
            "m11\n    and 2 more",
            "3 results are not in the baseline",
        ] {
            assert!(text.contains(part), "{part}:\n{text}");
        }
    }
}
