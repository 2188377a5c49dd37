//! Warnings, a line each.

use super::console::{Console, one_line};

/// Warnings: shown to people at once, and kept for the record that programs get.
pub struct Warnings {
    console: Console,
    /// One line each.
    pub list: Vec<String>,
}

impl Warnings {
    /// None yet.
    pub fn new(console: Console) -> Self {
        Self { console, list: Vec::new() }
    }

    /// Shows and keeps a warning.
    pub fn add(&mut self, text: &str) {
        let line = one_line(text);
        self.console.warning(&line);
        self.list.push(line);
    }
}

/// What the loader of a scene warns of, a sentence each.
pub fn warnings_of(scene: &crate::scene::Scene) -> Vec<String> {
    let report = &scene.report;
    let dropped =
        (report.degenerate_triangles > 0).then(|| format!("dropped {} degenerate triangles", report.degenerate_triangles));
    report.warnings.iter().cloned().chain(dropped).collect()
}
