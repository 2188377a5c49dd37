//! Signals. Ctrl-C and SIGTERM: the first asks for a clean stop, the second ends the process at
//! once. A file that exceeds the limit for files (`ulimit -f`) is an error of its write.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::film::Control;
use crate::scene::load;

use crate::terminal::progress::Progress;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static INSTALL: Once = Once::new();

/// Installs the signal handler. Without it, signals end the process as usual.
pub fn install() {
    INSTALL.call_once(|| {
        // the handler would be in place without the thread that hears of signals
        if crate::gpu::threads::room(1) == 0 {
            return;
        }
        // a failure leaves the system's own behaviour, which is good enough
        let _ = ctrlc::set_handler(|| {
            // loading asks nobody, and leaves nothing behind
            let is_loading = load::is_in_progress();
            if is_loading {
                super::console::error(&Error::Interrupted.to_string());
            }
            if REQUESTED.swap(true, Ordering::Relaxed) || is_loading {
                std::process::exit(i32::from(Error::Interrupted.exit_code()));
            }
        });
    });
}

/// Lets a write beyond the limit for files (`ulimit -f`) fail as one to a full disk does, in place
/// of a signal (SIGXFSZ) that ends the process: in this thread and those that it starts.
pub fn block_file_size_signal() {
    #[cfg(unix)]
    {
        use nix::sys::signal::{SigSet, Signal};
        // a failure leaves the system's own behaviour: the process ends, and no file has its name
        // yet
        let _ = SigSet::from(Signal::SIGXFSZ).thread_block();
    }
}

/// Did the user ask to stop?
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Returns [`Error::Interrupted`] if the user asked to stop.
pub fn check() -> Result<()> {
    if requested() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Shows the progress of long work and stops it on Ctrl-C.
pub struct ProgressControl {
    /// The progress bar.
    pub progress: Progress,
    /// On Ctrl-C, keep the partial result instead of failing.
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

/// Stops work on Ctrl-C without showing its progress: for work that is one of many steps of the
/// progress bar.
pub struct SilentControl;

impl Control for SilentControl {
    fn should_stop(&mut self) -> Result<bool> {
        check().map(|()| false)
    }
}
