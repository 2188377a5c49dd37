//! The file dialog of the system: the desktop portal's, or zenity's where there is no portal.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::task::Poll;

use super::baking::BakePlace;
use super::dialog::Dialog;

/// The system's dialog while it is open. It runs on a thread of its own, so that the window stays
/// alive.
pub struct Browsing {
    dialog: Dialog,
    chosen: Receiver<PathBuf>,
}

impl Browsing {
    /// Opens the system's dialog for what `dialog` asks for. `wake` is called when it closes.
    pub fn start(mut dialog: Dialog, wake: impl FnOnce() + Send + 'static) -> Self {
        let (title, kinds): (_, &[(&str, &[&str])]) = match &dialog {
            Dialog::Open(_) => {
                ("Open a scene", &[("Scenes", &["gltf", "glb", "obj", "brhan"]), ("Environments", &["hdr", "exr"])])
            }
            Dialog::Save(_) => {
                ("Save the image", &[("Image as shown", &["png", "jpg", "webp"]), ("All channels", &["exr"])])
            }
            Dialog::LoadSettings(_) => ("Load settings", &[("Settings", &["json"])]),
            Dialog::SaveSettings(_) => ("Save settings", &[("Settings", &["json"])]),
            Dialog::Export(_) => ("Export the scene", &[("glTF", &["glb", "gltf"])]),
            Dialog::Render(..) => {
                ("Render this view", &[("Images", &["png", "exr", "jpg", "webp", "apng", "mp4", "webm", "gif"])])
            }
            Dialog::Bake(_, wanted) if wanted.place == BakePlace::Image => {
                ("Bake this scene", &[("Images", &["png", "exr"])])
            }
            Dialog::Bake(..) => ("Bake this scene", &[("glTF", &["glb", "gltf"])]),
        };
        let name = dialog.text_mut().clone();
        let saves = !matches!(dialog, Dialog::Open(_) | Dialog::LoadSettings(_));
        let (sender, chosen) = channel();
        let show = move || {
            let mut system = rfd::FileDialog::new().set_title(title);
            for (kind, extensions) in kinds {
                system = system.add_filter(*kind, extensions);
            }
            let path = if saves { system.set_file_name(name).save_file() } else { system.pick_file() };
            if let Some(path) = path {
                // it may be that the window is gone
                let _ = sender.send(path);
            }
            drop(sender);
            wake();
        };
        // without a further thread it is as if the dialog was closed
        let _ = std::thread::Builder::new().name("dialog".into()).spawn(show);
        Self { dialog, chosen }
    }

    /// Returns the dialog with the chosen path in it, or `None` when it was closed without a
    /// choice.
    pub fn poll(&self) -> Poll<Option<Dialog>> {
        match self.chosen.try_recv() {
            Ok(path) => {
                let mut dialog = self.dialog.clone();
                *dialog.text_mut() = path.to_string_lossy().into_owned();
                Poll::Ready(Some(dialog))
            }
            Err(TryRecvError::Empty) => Poll::Pending,
            Err(TryRecvError::Disconnected) => Poll::Ready(None),
        }
    }
}
