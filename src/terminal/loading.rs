//! Progress of loading a scene.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use crate::scene::load::LoadProgress;
use crate::terminal::console::Console;
use crate::terminal::progress::Progress;

/// Loads a scene by `load`, which hears what to call after each part, and shows what is done. A
/// file is read and its meshes are repaired without a word, so the bar is drawn by its thread.
pub fn with_progress<R>(source: &str, console: &Console, load: impl FnOnce(&(dyn Fn(LoadProgress) + Sync)) -> R) -> R {
    if console.json || console.quiet {
        return load(&|_| ());
    }
    let name = Path::new(source).file_name().unwrap_or_default().to_string_lossy();
    let shown = Mutex::new(Progress::of_silent_work(format!("loading {name}"), console));
    load(&|progress| {
        // how many images an .obj has is not known before
        let Some(of) = progress.of else { return };
        shown.lock().unwrap_or_else(PoisonError::into_inner).set(progress.done as u64, of.max(1) as u64);
    })
}
