//! Ctrl-C and SIGTERM: the first asks for a clean stop, the second ends the process at once.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::film::Control;

use crate::terminal::progress::Progress;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static INSTALL: Once = Once::new();

/// Starts to listen. Without it signals end the process as usual.
pub fn install() {
    INSTALL.call_once(|| {
        // a failure leaves the system's own behaviour, which is good enough
        let _ = ctrlc::set_handler(|| {
            if REQUESTED.swap(true, Ordering::Relaxed) {
                std::process::exit(i32::from(Error::Interrupted.exit_code()));
            }
        });
    });
}

/// Did the user ask to stop?
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Fails when the user asked to stop.
pub fn check() -> Result<()> {
    if requested() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Connects long work to the keyboard and to the progress bar.
pub struct ProgressControl {
    /// Where progress is shown.
    pub progress: Progress,
    /// Ctrl-C keeps what there is instead of failing.
    pub keep_partial: bool,
}

impl Control for ProgressControl {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.set(done, total);
    }

    fn should_stop(&mut self) -> Result<bool> {
        if self.keep_partial { Ok(requested()) } else { check().map(|()| false) }
    }
}

/// Listens to the keyboard, and shows nothing: for work whose own count is not that of the bar.
pub struct SilentControl;

impl Control for SilentControl {
    fn should_stop(&mut self) -> Result<bool> {
        check().map(|()| false)
    }
}
