//! Signals. Ctrl-C and SIGTERM: the first asks for a clean stop, the second ends the process at
//! once. Work that asks nobody while it lasts, as building a hierarchy does, is given up soon after
//! the first ([`Abandonable`]). A file that exceeds the limit for files (`ulimit -f`) is an error
//! of its write.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::threads::end_process;
use crate::scene::load;
use crate::terminal::progress::Progress;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static INSTALL: Once = Once::new();
/// Number of [`Abandonable`] that live, and whether any is to print a record.
static ABANDONABLE: Mutex<(usize, bool)> = Mutex::new((0, false));
/// Time that abandonable work has to answer a request to stop.
const PATIENCE: Duration = Duration::from_millis(600);

/// Work that may be given up at any point: it writes nothing, or files that appear whole. If it has
/// not ended a moment after a request to stop, the process ends as an interrupted one does.
///
/// It is over where it is dropped, or ended because files are written of which there have to be all
/// or none.
#[must_use]
pub struct Abandonable {
    has_ended: AtomicBool,
}

impl Abandonable {
    /// Begins such work. `json`: an interrupted process prints a record.
    pub fn begin(json: bool) -> Self {
        let mut all = abandonable();
        *all = (all.0 + 1, json);
        Self { has_ended: AtomicBool::new(false) }
    }

    /// From here on the work is not given up.
    pub fn end(&self) {
        if !self.has_ended.swap(true, Ordering::Relaxed) {
            abandonable().0 -= 1;
        }
    }
}

impl Drop for Abandonable {
    fn drop(&mut self) {
        self.end();
    }
}

fn abandonable() -> MutexGuard<'static, (usize, bool)> {
    ABANDONABLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the process as an interrupted one, without waiting for what other threads do. `json`: it
/// prints a record.
pub fn end_interrupted(json: bool) -> ! {
    let (message, code) = (Error::Interrupted.to_string(), Error::Interrupted.exit_code());
    super::console::error(&message);
    if json {
        // nothing can be done about a stdout that fails now
        let _ = super::console::json(&serde_json::json!({ "error": message, "exit_code": code }));
    }
    end_process(code)
}

/// Ends the process if abandonable work has not ended after [`PATIENCE`].
fn abandon_later() {
    let wait = || {
        std::thread::sleep(PATIENCE);
        // whoever ends the work meanwhile waits for this lock, and says nothing twice
        let all = abandonable();
        if all.0 > 0 {
            end_interrupted(all.1);
        }
    };
    // without a further thread the work ends when it asks, or by a second request
    let _ = std::thread::Builder::new().name("interrupt".into()).spawn(wait);
}

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
                end_interrupted(abandonable().1);
            }
            if REQUESTED.swap(true, Ordering::Relaxed) {
                end_process(Error::Interrupted.exit_code());
            }
            abandon_later();
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
