//! Callbacks of long-running work.

use super::accumulate;
use crate::error::Result;

/// Callbacks of long-running work: progress, interim images, warnings and stop requests.
pub trait Control {
    /// `done` of `total` units are finished. Called a few times a second.
    fn progress(&mut self, done: u64, total: u64) {
        let _ = (done, total);
    }

    /// The image has reached one of the requested sample counts ([`super::schedule::FilmOptions::intervals`]) and is not finished.
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

    /// Reports that the finished image is all but black or white, one line. A warning, unless the image is only measured.
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
