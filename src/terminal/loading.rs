//! Progress of loading a scene.

use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::scene::load::LoadProgress;
use crate::terminal::console::Console;
use crate::terminal::progress::Progress;

/// Time between two looks at what is done.
const TICK: Duration = Duration::from_millis(100);

/// Loads a scene by `load`, which hears what to call after each part, and shows what is done from
/// the first second on. A file is read and its meshes are repaired without a word, so the bar is
/// shown by a thread of its own; where there can be none, there is no bar.
pub fn with_progress<R>(source: &str, console: &Console, load: impl FnOnce(&(dyn Fn(LoadProgress) + Sync)) -> R) -> R {
    if console.json || console.quiet {
        return load(&|_| ());
    }
    let name = Path::new(source).file_name().unwrap_or_default().to_string_lossy();
    let at = Mutex::new((0, 1));
    let (sender, end) = channel::<()>();
    std::thread::scope(|scope| {
        // dropped where loading ends, also by a panic, and the thread ends with it
        let _sender = sender;
        let at = &at;
        let show = move || {
            let mut progress = Progress::new(format!("loading {name}"), console);
            while end.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                let (done, of) = *at.lock().unwrap_or_else(PoisonError::into_inner);
                progress.set(done, of);
            }
        };
        let _ = std::thread::Builder::new().name("progress".into()).spawn_scoped(scope, show);
        load(&|progress| {
            // how many images an .obj has is not known before
            let Some(of) = progress.of else { return };
            *at.lock().unwrap_or_else(PoisonError::into_inner) = (progress.done as u64, of.max(1) as u64);
        })
    })
}
