//! Lines that a command prints while it works through a list: one for each item as soon as it is
//! done, above the progress of all.

use super::console::Console;
use super::interrupt;
use super::progress::Progress;
use crate::error::Result;
use crate::film::Control;

/// Lines above a progress bar.
pub struct Lines {
    console: Console,
    progress: Progress,
}

impl Lines {
    /// `label`: what the progress bar says is done.
    pub fn new(label: &'static str, console: Console) -> Self {
        Self { console, progress: Progress::new(label, &console) }
    }

    /// Says what is being done.
    pub fn phase(&mut self, name: &'static str) {
        self.progress.phase(name);
    }

    /// Says how much is done.
    pub fn set(&mut self, done: usize, total: usize) {
        self.progress.set(done as u64, total as u64);
    }

    /// Prints a line.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if it cannot be printed, [`crate::Error::Interrupted`] after
    /// Ctrl-C.
    pub fn print(&mut self, line: &str) -> Result<()> {
        self.progress.suspend(|| self.console.line(line))?;
        interrupt::check()
    }
}

impl Control for Lines {
    fn should_stop(&mut self) -> Result<bool> {
        interrupt::check().map(|()| false)
    }
}
