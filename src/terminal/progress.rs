//! A progress bar on stderr, for work that takes longer than a second.

use std::borrow::Cow;
use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::terminal::console::Console;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// A bar that appears once the work has lasted for a second, and only where a person can see it.
pub struct Progress {
    label: Cow<'static, str>,
    start: Instant,
    visible: bool,
    // units that are done, and all
    at: (u64, u64),
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Progress of the work that starts now.
    pub fn new(label: &'static str, console: &Console) -> Self {
        Self {
            label: label.into(),
            start: Instant::now(),
            visible: !console.json && !console.quiet && stderr().is_terminal(),
            at: (0, 1),
            bar: None,
        }
    }

    /// `done` of `total` units are finished.
    pub fn set(&mut self, done: u64, total: u64) {
        self.at = (done, total);
        if self.start.elapsed() >= PATIENCE {
            self.draw();
        }
    }

    /// What is done from here on. It is shown at once: it may take long, and nothing else is said meanwhile.
    pub fn phase(&mut self, label: impl Into<Cow<'static, str>>) {
        self.label = label.into();
        self.draw();
    }

    /// Runs what writes to the terminal, with the bar out of the way.
    pub fn suspend<R>(&self, write: impl FnOnce() -> R) -> R {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    fn draw(&mut self) {
        if !self.visible {
            return;
        }
        let (done, total) = self.at;
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(10));
            // a template that does not parse would be a slip of ours: the plain style does as well
            if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent}%{left}") {
                bar.set_style(style.with_key("left", left).progress_chars("=> "));
            }
            bar.with_elapsed(self.start.elapsed())
        });
        if bar.message() != self.label {
            bar.set_message(self.label.clone());
        }
        bar.set_length(total);
        bar.set_position(done);
    }
}

/// The time that is left, once there is anything to tell it from.
fn left(state: &ProgressState, out: &mut dyn Write) {
    if state.pos() > 0 {
        // into a buffer of the bar's
        let _ = write!(out, " {:#} left", HumanDuration(state.eta()));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
