//! Options of loading, and the count of loads in progress.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::confine::Confine;
use crate::memory::Budget;

/// Options of loading a scene.
#[derive(Clone, Copy)]
pub struct LoadOptions<'a> {
    /// Whether images are decoded. Without them materials have no textures, and
    /// [`crate::scene::LoadReport::skipped_images`] says what was left out.
    pub textures: bool,
    /// Called after each image that was decoded, from several threads.
    pub progress: &'a (dyn Fn(ImagesDecoded) + Sync),
    /// Where the files that a scene refers to have to lie. Those elsewhere are an error, and are
    /// not opened.
    pub confine: Confine<'a>,
    /// Scene of a glTF file, by its name or, where none is called that, its number; `None`: the one
    /// that the file names, or else its first.
    pub scene: Option<&'a str>,
}

/// Images decoded so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImagesDecoded {
    /// Number of images that are decoded.
    pub done: usize,
    /// Number of all images; `None` for an .obj, of which it is not known before.
    pub of: Option<usize>,
}

impl Default for LoadOptions<'_> {
    fn default() -> Self {
        Self { textures: true, progress: &|_| (), confine: Confine::Nowhere, scene: None }
    }
}

/// The inputs that all readers of a scene and its files share.
#[derive(Clone, Copy)]
pub(super) struct Loading<'a> {
    pub options: LoadOptions<'a>,
    pub budget: &'a Budget,
}

/// Number of files that are being loaded.
static IN_PROGRESS: AtomicUsize = AtomicUsize::new(0);

/// Returns true while a scene or an environment is being loaded, in any thread. A load does not ask
/// whether it is to stop: it writes nothing, and whoever wants to stop may end the process.
pub fn is_in_progress() -> bool {
    IN_PROGRESS.load(Ordering::Relaxed) > 0
}

/// A guard that counts a load as long as it lasts.
pub(super) struct InProgress;

impl InProgress {
    pub fn begin() -> Self {
        IN_PROGRESS.fetch_add(1, Ordering::Relaxed);
        Self
    }
}

impl Drop for InProgress {
    fn drop(&mut self) {
        IN_PROGRESS.fetch_sub(1, Ordering::Relaxed);
    }
}
