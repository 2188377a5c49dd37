//! Reports a panic, which is a bug, in one line and with an exit code of its own instead of a stack
//! trace.

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::sync::Mutex;

/// Exit code of a process that panicked, which is a bug in skylit.
pub const EXIT_CODE: u8 = 70;

/// Message of the first panic; later ones (of other threads) usually follow from it.
static FIRST: Mutex<Option<String>> = Mutex::new(None);

/// Makes panics quiet: [`catch`] returns the message.
pub fn install() {
    set_hook(Box::new(|info| {
        let payload = info.payload();
        let what =
            payload.downcast_ref::<&str>().copied().or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        let what = what.unwrap_or("unknown reason");
        let place = info.location().map(|l| format!(" at {}:{}", l.file(), l.line())).unwrap_or_default();
        let message = format!("internal error: {what}{place}; this is a bug in skylit, please report it");
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0") {
            eprintln!("{}", std::backtrace::Backtrace::force_capture());
        }
        if let Ok(mut first) = FIRST.lock() {
            first.get_or_insert(message);
        }
    }));
}

/// Runs `f` and catches a panic; `Err` is the line to report.
pub fn catch<T>(f: impl FnOnce() -> T) -> Result<T, String> {
    // only the message is used after a panic
    catch_unwind(AssertUnwindSafe(f)).map_err(|_| {
        let first = FIRST.lock().ok().and_then(|mut m| m.take());
        super::console::one_line(
            &first.unwrap_or_else(|| "internal error; this is a bug in skylit, please report it".into()),
        )
    })
}
