//! Progress on stderr: a bar on a terminal, for work that takes longer than a second; else, as in
//! the log of a build server, a line from time to time.

use std::borrow::Cow;
use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::terminal::console::{Console, note, visible};

/// Time after which the bar appears.
const PATIENCE: Duration = Duration::from_secs(1);
/// Variable of the environment that replaces [`LINE_SECONDS`]; 0: no lines.
const LINE_VARIABLE: &str = "SKYLIT_PROGRESS_SECONDS";
/// Minimum time between two lines.
const LINE_SECONDS: f64 = 10.0;
/// A line follows at the latest after this many times the minimum time, however little is done.
const MAX_WAIT: u32 = 6;
/// Share of the work that is worth a line.
const LINE_SHARE: f64 = 0.1;

/// A progress bar that appears after one second if stderr is a terminal, else lines.
pub struct Progress {
    label: Cow<'static, str>,
    start: Instant,
    visible: bool,
    /// Lines in place of the bar.
    lines: Option<LinePace>,
    // completed units, and all units
    at: (u64, u64),
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Progress of the work that starts now.
    pub fn new(label: impl Into<Cow<'static, str>>, console: &Console) -> Self {
        let wanted = !console.json && !console.quiet;
        Self {
            label: label.into(),
            start: Instant::now(),
            visible: wanted && stderr().is_terminal(),
            lines: (wanted && !stderr().is_terminal()).then(LinePace::from_environment).flatten(),
            at: (0, 1),
            bar: None,
        }
    }

    /// `done` of `total` units are finished.
    pub fn set(&mut self, done: u64, total: u64) {
        self.at = (done, total);
        self.line();
        if self.start.elapsed() >= PATIENCE {
            self.draw();
        }
    }

    /// Sets the label and shows it immediately, because the next update may take long.
    pub fn phase(&mut self, label: impl Into<Cow<'static, str>>) {
        self.label = label.into();
        self.line();
        self.draw();
    }

    /// Hides the bar while `write` writes to the terminal.
    pub fn suspend<R>(&self, write: impl FnOnce() -> R) -> R {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Prints a line, if it is time for one.
    fn line(&mut self) {
        let Self { lines: Some(pace), at: (done, total), .. } = self else { return };
        let (elapsed, share) = (self.start.elapsed(), *done as f64 / (*total).max(1) as f64);
        if pace.is_due(elapsed, share) {
            note(&line_text(&self.label, elapsed, share));
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
        let label = visible(&self.label, &[]);
        if bar.message() != label {
            bar.set_message(label);
        }
        bar.set_length(total);
        bar.set_position(done);
    }
}

/// When lines are printed: not more often than `interval`, and then once another tenth of the work
/// is done, or after a longer wait.
struct LinePace {
    interval: Duration,
    // of the last line: the time, and the share that was done
    last: (Duration, f64),
}

impl LinePace {
    fn from_environment() -> Option<Self> {
        let given = std::env::var(LINE_VARIABLE).ok().and_then(|v| v.trim().parse::<f64>().ok());
        let seconds = given.unwrap_or(LINE_SECONDS);
        Duration::try_from_secs_f64(seconds).ok().filter(|d| !d.is_zero()).map(Self::new)
    }

    fn new(interval: Duration) -> Self {
        Self { interval, last: (Duration::ZERO, 0.0) }
    }

    fn is_due(&mut self, elapsed: Duration, share: f64) -> bool {
        let waited = elapsed.saturating_sub(self.last.0);
        let is_due =
            waited >= self.interval && (share - self.last.1 >= LINE_SHARE || waited >= self.interval * MAX_WAIT);
        // what is done is soon reported otherwise
        let is_due = is_due && share < 1.0;
        if is_due {
            self.last = (elapsed, share);
        }
        is_due
    }
}

/// `rendering: 30 % after 12 s, about 28 s left`.
fn line_text(label: &str, elapsed: Duration, share: f64) -> String {
    let seconds = elapsed.as_secs_f64();
    let left = if share > 0.0 {
        format!(", about {} left", duration_text(seconds * (1.0 - share) / share))
    } else {
        String::new()
    };
    format!("{label}: {:.0} % after {}{left}", 100.0 * share, duration_text(seconds))
}

fn duration_text(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_neither_frequent_nor_rare() {
        let seconds = Duration::from_secs_f64;
        let mut pace = LinePace::new(seconds(10.0));
        // (time, share done, a line is due)
        for (time, share, due) in [
            (1.0, 0.5, false),
            (9.9, 0.6, false),
            (10.0, 0.61, true),
            (19.0, 0.9, false),
            (20.0, 0.65, false),
            (69.0, 0.66, false),
            (70.0, 0.66, true),
            (80.0, 0.77, true),
            (95.0, 1.0, false),
        ] {
            assert_eq!(pace.is_due(seconds(time), share), due, "{time} s");
        }
        assert_eq!(line_text("rendering", seconds(12.0), 0.3), "rendering: 30 % after 12 s, about 28 s left");
        assert_eq!(line_text("loading", seconds(240.0), 0.0), "loading: 0 % after 4 min");
        assert_eq!(duration_text(7200.0), "2.0 h");
    }
}
