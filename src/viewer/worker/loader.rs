//! Loads a scene on a thread of its own, its geometry first: ambient occlusion needs no images, and
//! of many scenes they take the longest.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::scene::load::{self, LoadOptions, LoadPart, LoadProgress};
use crate::viewer::request::{Event, EventSender, Mailbox};

/// Scene or images that have been loaded.
pub enum Loaded {
    /// Everything but the images, which follow.
    Geometry(Scene),
    /// The whole scene.
    Scene(Scene),
}

/// A scene that is being loaded.
pub struct Loader {
    parts: Receiver<Result<Loaded>>,
    thread: Option<JoinHandle<()>>,
    /// A part is there to be taken, or the thread has ended.
    is_ready: Arc<AtomicBool>,
    /// Nobody waits any more.
    is_cancelled: Arc<AtomicBool>,
}

impl Loader {
    /// Starts to load a file or `builtin:NAME`. `gltf_scene`: which of the file's scenes;
    /// `options`: how scenes are loaded. Progress is sent as events; `mailbox` is woken for every
    /// part.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when there can be no further thread.
    pub fn start(
        source: &str,
        gltf_scene: Option<&str>,
        options: LoadOptions<'static>,
        mailbox: &Arc<Mailbox>,
        events: &EventSender,
    ) -> Result<Self> {
        let (sender, parts) = sync_channel(2);
        let [is_ready, is_cancelled] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let job = Job {
            source: source.to_owned(),
            gltf_scene: gltf_scene.map(str::to_owned),
            options,
            parts: sender,
            wake: Wake { mailbox: mailbox.clone(), is_ready: is_ready.clone() },
            is_cancelled: is_cancelled.clone(),
            events: events.clone(),
        };
        let thread = std::thread::Builder::new()
            .name("loader".into())
            .spawn(move || job.run())
            .map_err(|e| Error::OutOfMemory(format!("the thread that loads cannot be started: {e}")))?;
        Ok(Self { parts, thread: Some(thread), is_ready, is_cancelled })
    }

    /// The next part, if it is there within `time`.
    ///
    /// # Errors
    /// Those of [`load::load`].
    ///
    /// # Panics
    /// When loading does.
    pub fn next(&mut self, time: Duration) -> Option<Result<Loaded>> {
        self.is_ready.store(false, Ordering::Relaxed);
        match self.parts.recv_timeout(time) {
            Ok(part) => Some(part),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                    std::panic::resume_unwind(panic);
                }
                None
            }
        }
    }

    /// Returns true if no part follows.
    pub fn has_ended(&self) -> bool {
        self.thread.is_none()
    }

    /// Returns true if there is a part to be taken, or was.
    pub fn is_ready(&self) -> bool {
        self.is_ready.load(Ordering::Relaxed)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        // the thread ends with the file that it reads, which nobody waits for
        self.is_cancelled.store(true, Ordering::Relaxed);
    }
}

struct Job {
    source: String,
    gltf_scene: Option<String>,
    options: LoadOptions<'static>,
    parts: SyncSender<Result<Loaded>>,
    is_cancelled: Arc<AtomicBool>,
    events: EventSender,
    // dropped last, also by a panic
    wake: Wake,
}

impl Job {
    fn run(self) {
        let part = match self.load(false) {
            Ok(scene) if scene.report.skipped_images == 0 => Ok(Loaded::Scene(scene)),
            part => part.map(Loaded::Geometry),
        };
        let is_complete = !matches!(part, Ok(Loaded::Geometry(_)));
        self.send(part);
        if !is_complete && !self.is_cancelled.load(Ordering::Relaxed) {
            self.send(self.load(true).map(Loaded::Scene));
        }
    }

    fn load(&self, textures: bool) -> Result<Scene> {
        let name = Path::new(&self.source).file_name().unwrap_or_default().to_string_lossy();
        let progress = |at: LoadProgress| {
            if !self.is_cancelled.load(Ordering::Relaxed) {
                let total = at.of.map_or_else(String::new, |n| format!(" of {n}"));
                let share = at.of.map(|n| at.done as f32 / n.max(1) as f32);
                let what = match at.part {
                    LoadPart::Geometry => "parts of its geometry",
                    LoadPart::Images => "images",
                };
                self.events.send(Event::Loading(format!("loading {name}: {}{total} {what}", at.done), share));
            }
        };
        load::load_with(
            &self.source,
            &LoadOptions { textures, progress: &progress, scene: self.gltf_scene.as_deref(), ..self.options },
        )
    }

    fn send(&self, part: Result<Loaded>) {
        // it may be that nobody waits any more
        let _ = self.parts.send(part);
        self.wake.wake();
    }
}

struct Wake {
    mailbox: Arc<Mailbox>,
    is_ready: Arc<AtomicBool>,
}

impl Wake {
    fn wake(&self) {
        self.is_ready.store(true, Ordering::Relaxed);
        self.mailbox.change(|_| ());
    }
}

impl Drop for Wake {
    fn drop(&mut self) {
        self.wake();
    }
}
