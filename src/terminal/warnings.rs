//! Warnings, a line each.

use super::console::{Console, one_line};

/// Warnings: printed at once in text mode, and collected for the JSON record.
pub struct Warnings {
    console: Console,
    /// The warnings so far, one line each.
    pub list: Vec<String>,
}

impl Warnings {
    /// An empty list of warnings.
    pub fn new(console: Console) -> Self {
        Self { console, list: Vec::new() }
    }

    /// Prints and collects a warning.
    pub fn add(&mut self, text: &str) {
        let line = one_line(text);
        self.console.warning(&line);
        self.list.push(line);
    }
}
