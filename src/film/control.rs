//! Callbacks of long-running work.

use super::accumulate;
use crate::error::Result;

/// Callbacks of long-running work: progress, interim images, warnings and stop requests.
pub trait Control {
    /// `done` of `total` units are finished. Called a few times a second.
    fn progress(&mut self, done: u64, total: u64) {
        let _ = (done, total);
    }

    /// Called when an unfinished image reaches a requested sample count
    /// ([`super::schedule::FilmOptions::intervals`]).
    ///
    /// # Errors
    /// An error ends the work.
    fn interval(&mut self, image: &accumulate::Accumulated) -> Result<()> {
        let _ = image;
        Ok(())
    }

    /// Reports a warning, one line.
    fn warning(&mut self, text: &str) {
        let _ = text;
    }

    /// Reports in a line that the finished image is all but black or white, a warning.
    fn brightness(&mut self, text: &str) {
        self.warning(text);
    }

    /// Called between submissions. `Ok(true)`: stop and keep the result so far; an error (usually
    /// [`crate::Error::Interrupted`]): stop and keep nothing.
    fn should_stop(&mut self) -> Result<bool> {
        Ok(false)
    }
}

/// Ignores all callbacks and never stops the work.
pub struct NoControl;

impl Control for NoControl {}
