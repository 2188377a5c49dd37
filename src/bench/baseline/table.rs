//! The comparison with a baseline in plain text.

use super::{BaselineReport, Change, RULE};
use crate::bench::table::{Block, header};
use crate::report::format_number;

/// Names of missing results that are printed; the record has all.
const MAX_NAMES: usize = 12;

/// All of it.
pub fn blocks(report: &BaselineReport) -> Vec<Block> {
    let mut blocks = vec![
        Block::gap(),
        Block::line(format!(
            "baseline {} (skylit {}): {} results compared, {} worse, {} better beyond noise{}",
            report.file,
            report.version,
            report.compared,
            report.regressions.len(),
            report.improvements.len(),
            if report.not_judged > 0 {
                format!("; {} of single measurements are not judged", report.not_judged)
            } else {
                String::new()
            }
        )),
        Block::line(format!("  {RULE}")),
    ];
    if let Some(typical) = report.typical_change {
        blocks.push(Block::line(format!("  repeated results are typically {}", relative(typical))));
    }
    for (name, title, changes) in [
        ("Worse beyond noise", "worse", &report.regressions),
        ("Worse beyond noise, of peers", "worse, of peers", &report.worse_peers),
        ("Better beyond noise", "better", &report.improvements),
    ] {
        if changes.is_empty() {
            continue;
        }
        let mut rows = vec![header(&[title, "", "baseline", "now", "", "noise"])];
        rows.extend(changes.iter().map(|c| {
            let noise = format!("{:.1} %", 100.0 * c.noise);
            vec![
                c.row.clone(),
                c.quantity.to_owned(),
                format_number(c.before),
                format_number(c.now),
                relative(c.worse_by),
                noise,
            ]
        }));
        blocks.push(Block::Table { title: name, rows, left: 2 });
    }
    if !report.missing.is_empty() {
        blocks.push(Block::line(format!("  in the baseline, but not in this run ({}):", report.missing.len())));
        blocks.extend(report.missing.iter().take(MAX_NAMES).map(|name| Block::line(format!("    {name}"))));
        if report.missing.len() > MAX_NAMES {
            blocks.push(Block::line(format!("    and {} more (--json names all)", report.missing.len() - MAX_NAMES)));
        }
    }
    if report.new > 0 {
        blocks.push(Block::line(format!("  {} results are not in the baseline", report.new)));
    }
    blocks
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
        let change =
            |row: &str, worse_by| Change { row: row.into(), quantity: "ms", before: 10.0, now: 12.0, worse_by, noise: 0.05 };
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
        let text = crate::bench::table::lines(&blocks(&report)).join("\n");
        for part in [
            "baseline a.json (skylit 0.1.0): 9 results compared, 1 worse, 1 better beyond noise; 2 of single measurements are not judged",
            "typically 1.2 % better",
            "stairs, near  ms     10.00  12.00  20.0 % worse  5.0 %",
            "10.0 % better",
            "not in this run (14):",
            "m11\n    and 2 more",
            "3 results are not in the baseline",
        ] {
            assert!(text.contains(part), "{part}:\n{text}");
        }
    }
}
