//! A progress bar on stderr, for work that takes longer than a second.

use std::borrow::Cow;
use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::terminal::console::Console;

/// Time after which the bar appears.
const PATIENCE: Duration = Duration::from_secs(1);

/// A progress bar that appears after one second, and only if stderr is a terminal.
pub struct Progress {
    label: Cow<'static, str>,
    start: Instant,
    visible: bool,
    // completed units, and all units
    at: (u64, u64),
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Progress of the work that starts now.
    pub fn new(label: impl Into<Cow<'static, str>>, console: &Console) -> Self {
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

    /// Sets the label and shows it immediately, because the next update may take long.
    pub fn phase(&mut self, label: impl Into<Cow<'static, str>>) {
        self.label = label.into();
        self.draw();
    }

    /// Hides the bar while `write` writes to the terminal.
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
            // if the template did not parse, the default style would do
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

/// Appends the estimated remaining time, once there is progress to extrapolate.
fn left(state: &ProgressState, out: &mut dyn Write) {
    if state.pos() > 0 {
        // writing to the bar's buffer does not fail
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
