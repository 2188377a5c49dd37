//! The results as a page: a table of what fails, and one for each section.

use std::path::{Path, PathBuf};

use super::{Check, SECTIONS, Summary, Verdict};
use crate::error::Result;
use crate::report::{self, Cell, Page, Part, Row, Section, Status, Table};

/// Writes the page into a folder, and returns its path. `command`: the command that was typed.
pub fn write(summary: &Summary, command: &str, dir: &Path) -> Result<PathBuf> {
    let mut sections = Vec::new();
    let failures: Vec<&Check> = summary.failures().collect();
    if !failures.is_empty() {
        sections.push(section("What fails".into(), String::new(), &failures));
    }
    for part in SECTIONS {
        let checks: Vec<&Check> = summary.checks.iter().filter(|c| c.section == part.name).collect();
        if !checks.is_empty() {
            sections.push(section(part.title.into(), format!("{}.", capital(part.about)), &checks));
        }
    }
    let subject = summary.scene.clone().unwrap_or_else(|| "built-in scenes".into());
    let count = |verdict| summary.count(verdict);
    let facts = [
        ("Device", summary.device.clone()),
        ("Driver", summary.driver.clone()),
        ("Checks", summary.checks.len().to_string()),
        ("Time", format!("{:.0} s", summary.seconds)),
    ];
    let page = Page {
        title: format!("Numerical stress suite: {subject}"),
        summary: format!(
            "{} checks hold and {} fail; {} figures are reported without a bound, and {} do not apply here.",
            count(Verdict::Holds),
            count(Verdict::Fails),
            count(Verdict::Reported),
            count(Verdict::NotApplicable)
        ),
        command: command.to_owned(),
        facts: facts.map(|(k, v)| (k.to_owned(), v)).to_vec(),
        warnings: summary.warnings.clone(),
        sections,
    };
    report::write(dir, &page)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|c| c.to_uppercase().collect::<String>() + letters.as_str()).unwrap_or_default()
}

fn section(title: String, about: String, checks: &[&Check]) -> Section {
    let mut table = Table::new(&["check", "tracer", "verdict", "figure", "bound", "what it means", "seconds"]);
    for check in checks {
        let (word, status) = word(check.verdict);
        let mut verdict = Cell::from(word);
        if let Some(status) = status {
            verdict = verdict.with_status(status);
        }
        let figure = if check.value.is_nan() { Cell::from("") } else { Cell::number(check.value, check.figure()) };
        table = table.row(Row::new([
            check.name.as_str().into(),
            check.tracer_name().into(),
            verdict,
            figure,
            check.bound_text().as_str().into(),
            check.sentence.as_str().into(),
            check.seconds.into(),
        ]));
    }
    let fails = checks.iter().any(|c| c.verdict == Verdict::Fails);
    let parts = [(!about.is_empty()).then_some(Part::Text(about)), Some(Part::Table(table))];
    Section {
        status: Some(if fails { Status::Bad } else { Status::Good }),
        ..Section::new(title, parts.into_iter().flatten().collect())
    }
}

/// A verdict in a word, with its colour.
pub fn word(verdict: Verdict) -> (&'static str, Option<Status>) {
    match verdict {
        Verdict::Holds => ("holds", Some(Status::Good)),
        Verdict::Fails => ("fails", Some(Status::Bad)),
        Verdict::NotApplicable => ("not applicable", None),
        Verdict::Reported => ("reported", None),
    }
}
