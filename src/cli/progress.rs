//! A progress bar on stderr, for work that takes longer than a second.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::console::Console;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// A bar that appears once the work has lasted for a second, and only where a person can see it.
pub struct Progress {
    label: &'static str,
    start: Instant,
    visible: bool,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Progress of the work that starts now.
    pub fn new(label: &'static str, console: &Console) -> Self {
        Self { label, start: Instant::now(), visible: !console.json && !console.quiet && stderr().is_terminal(), bar: None }
    }

    /// `done` of `total` units are finished.
    pub fn set(&mut self, done: u64, total: u64) {
        if !self.visible || self.start.elapsed() < PATIENCE {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(10));
            // a template that does not parse would be a slip of ours: the plain style does as well
            if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent}% {eta} left") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.with_message(self.label).with_elapsed(self.start.elapsed())
        });
        bar.set_length(total);
        bar.set_position(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
