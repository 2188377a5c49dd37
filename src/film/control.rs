//! How long work talks to whoever started it.

use super::accumulate;
use crate::error::Result;

/// How a long piece of work talks to whoever started it.
pub trait Control {
    /// `done` of `total` units are finished. Called a few times a second.
    fn progress(&mut self, done: u64, total: u64) {
        let _ = (done, total);
    }

    /// An image has reached a number of samples that was asked for ([`super::schedule::FilmOptions::intervals`]), and is not finished.
    ///
    /// # Errors
    /// What goes wrong with it ends the work.
    fn interval(&mut self, image: &accumulate::Accumulated) -> Result<()> {
        let _ = image;
        Ok(())
    }

    /// Something that the user should know and that is no failure, in a line.
    fn warning(&mut self, text: &str) {
        let _ = text;
    }

    /// Asked between submissions. `Ok(true)`: stop here and keep what there is; an error (usually
    /// [`crate::Error::Interrupted`]): stop and keep nothing.
    fn should_stop(&mut self) -> Result<bool> {
        Ok(false)
    }
}

/// Never stops, shows nothing.
pub struct NoControl;

impl Control for NoControl {}
