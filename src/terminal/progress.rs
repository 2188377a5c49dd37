//! Progress on stderr: a bar on a terminal, for work that takes longer than a moment; else, as in
//! the log of a build server, a line from time to time.
//!
//! A thread draws the bar, so that it moves also in stages that report nothing ([`stage`]): their
//! names and shares stand beside what the work is called.

use std::borrow::Cow;
use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::stage;
use crate::terminal::console::{Console, note, visible};

/// Time after which the bar appears.
const PATIENCE: Duration = Duration::from_millis(90);
/// Time between two looks at what is done.
const TICK: Duration = Duration::from_millis(100);
/// Variable of the environment that replaces [`LINE_SECONDS`]; 0: no lines.
const LINE_VARIABLE: &str = "SKYLIT_PROGRESS_SECONDS";
/// Minimum time between two lines.
const LINE_SECONDS: f64 = 10.0;
/// A line follows at the latest after this many times the minimum time, however little is done.
const MAX_WAIT: u32 = 6;
/// Share of the work that is worth a line.
const LINE_SHARE: f64 = 0.1;

/// A progress bar that appears after a moment if stderr is a terminal, else lines.
pub struct Progress {
    shown: Arc<Mutex<Shown>>,
    /// Thread that draws, and what ends it where it is dropped; `None` where nothing is to be
    /// drawn, or there can be no thread.
    ticker: Option<(Sender<()>, JoinHandle<()>)>,
}

/// The part of a progress that the thread draws.
struct Shown {
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
        Self::start(label, console, false)
    }

    /// As [`Progress::new`], for work that does not report by itself when it is time for a line:
    /// lines are printed by the thread, too.
    pub fn of_silent_work(label: impl Into<Cow<'static, str>>, console: &Console) -> Self {
        Self::start(label, console, true)
    }

    fn start(label: impl Into<Cow<'static, str>>, console: &Console, prints_lines: bool) -> Self {
        let wanted = !console.json && !console.quiet;
        let is_terminal = stderr().is_terminal();
        let shown = Arc::new(Mutex::new(Shown {
            label: label.into(),
            start: Instant::now(),
            visible: wanted && is_terminal,
            lines: (wanted && !is_terminal).then(LinePace::from_environment).flatten(),
            at: (0, 1),
            bar: None,
        }));
        let ticks = wanted && (is_terminal || prints_lines);
        let ticker = ticks.then(|| Self::start_ticker(shown.clone(), prints_lines)).flatten();
        Self { shown, ticker }
    }

    fn start_ticker(shown: Arc<Mutex<Shown>>, prints_lines: bool) -> Option<(Sender<()>, JoinHandle<()>)> {
        let (sender, end) = channel::<()>();
        let show = move || {
            while end.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
                if prints_lines {
                    shown.line();
                }
                shown.draw_in_time();
            }
        };
        let thread = std::thread::Builder::new().name("progress".into()).spawn(show).ok()?;
        Some((sender, thread))
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// `done` of `total` units are finished.
    pub fn set(&mut self, done: u64, total: u64) {
        let mut shown = self.shown();
        shown.at = (done, total);
        shown.line();
        shown.draw_in_time();
    }

    /// Sets the label and shows it immediately, because the next update may take long.
    pub fn phase(&mut self, label: impl Into<Cow<'static, str>>) {
        let mut shown = self.shown();
        shown.label = label.into();
        shown.line();
        shown.draw();
    }

    /// Hides the bar while `write` writes to the terminal.
    pub fn suspend<R>(&self, write: impl FnOnce() -> R) -> R {
        match &self.shown().bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }
}

impl Shown {
    /// Prints a line, if it is time for one.
    fn line(&mut self) {
        let Self { lines: Some(pace), at: (done, total), .. } = self else { return };
        let (elapsed, share) = (self.start.elapsed(), *done as f64 / (*total).max(1) as f64);
        if pace.is_due(elapsed, share) {
            note(&line_text(&self.label, elapsed, share));
        }
    }

    fn draw_in_time(&mut self) {
        if self.start.elapsed() >= PATIENCE {
            self.draw();
        }
    }

    fn draw(&mut self) {
        if !self.visible {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr_with_hz(10));
            // if the template did not parse, the default style would do
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} [{bar:40}] {percent}% {elapsed}{left}") {
                bar.set_style(style.with_key("left", left).progress_chars("=> "));
            }
            bar.with_elapsed(self.start.elapsed())
        });

        // a stage of the work, in place of the work itself, whose own share stands still meanwhile
        let stage = stage::current();
        let (done, total) = match stage.as_ref().and_then(|s| s.share) {
            Some(share) => ((share * STAGE_STEPS as f64) as u64, STAGE_STEPS),
            None => self.at,
        };
        let label = match stage {
            Some(stage) => Cow::Owned(format!("{}: {}", self.label, stage.name)),
            None => Cow::Borrowed(&*self.label),
        };
        let label = visible(&label, &[]);
        if bar.message() != label {
            bar.set_message(label);
            // the time that is left is that of this work
            bar.reset_eta();
        }
        bar.set_length(total);
        bar.set_position(done);
        bar.tick();
    }
}

/// Steps that the share of a stage is shown in.
const STAGE_STEPS: u64 = 1000;

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
        if let Some((sender, thread)) = self.ticker.take() {
            drop(sender);
            // it draws, and cannot fail in a way that matters here
            let _ = thread.join();
        }
        if let Some(bar) = &self.shown().bar {
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
