//! The preview of the dialog *Bake*: a bake of few texels and samples into a file of its own, and a
//! picture of that model from where the view looks.

use std::path::PathBuf;
use std::time::Duration;

use super::baking::BakeWanted;
use super::renders::Render;

/// Width and height of its textures, texels, and samples, at most.
const MAX_SIZE: u32 = 256;
const MAX_SPP: u32 = 8;
/// Time between two looks at the program that runs.
const POLL: Duration = Duration::from_millis(100);

/// The numbers of a preview of a bake.
pub fn quick(wanted: &BakeWanted) -> BakeWanted {
    let (size, spp) = (wanted.size.min(MAX_SIZE), wanted.spp.min(MAX_SPP));
    BakeWanted { size, spp, is_denoised: true, ..wanted.clone() }
}

/// A preview that is made or shown.
pub struct BakePreview {
    /// The numbers that were asked for.
    pub wanted: BakeWanted,
    program: PathBuf,
    /// Arguments of `skylit render`, which shows the model.
    render: Vec<String>,
    /// The picture.
    picture: PathBuf,
    stage: PreviewStage,
    /// Where the model and the picture are until the preview is closed.
    folder: Option<tempfile::TempDir>,
}

/// How far a preview is.
enum PreviewStage {
    /// The model is baked.
    Baking(Render),
    /// The picture is rendered.
    Rendering(Render),
    Shown(egui::TextureHandle),
    /// A sentence that says why there is no picture.
    Failed(String),
}

/// The part of a preview that the dialog shows.
pub enum Shown<'a> {
    /// Words on what is under way.
    Progress(String),
    Picture(&'a egui::TextureHandle),
    /// A sentence that says why there is no picture.
    Failure(&'a str),
}

impl BakePreview {
    /// Starts the bake. `arguments`: makes those of `skylit bake` and of `skylit render`, given the
    /// names of the model and of the picture.
    ///
    /// # Errors
    /// Those of making a folder and of starting a program.
    pub fn start(
        program: PathBuf,
        wanted: &BakeWanted,
        arguments: impl FnOnce(&str, &str) -> [Vec<String>; 2],
    ) -> std::io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let [model, picture] = ["preview.glb", "preview.png"].map(|name| folder.path().join(name));
        let names = [&model, &picture].map(|path| path.to_string_lossy().into_owned());
        let [bake, render] = arguments(&names[0], &names[1]);
        let stage = PreviewStage::Baking(Render::start(&program, "bake", &bake, &names[0])?);
        Ok(Self { wanted: wanted.clone(), program, render, picture, stage, folder: Some(folder) })
    }

    /// Looks at the program that runs, and starts the next one when it has ended.
    pub fn watch(&mut self, context: &egui::Context) {
        let (PreviewStage::Baking(running) | PreviewStage::Rendering(running)) = &mut self.stage else { return };
        let Some((said, _)) = running.ended() else {
            context.request_repaint_after(POLL);
            return;
        };
        let has_succeeded = running.has_succeeded();
        self.stage = match &self.stage {
            _ if !has_succeeded => PreviewStage::Failed(said),
            PreviewStage::Baking(_) => {
                let output = self.picture.to_string_lossy();
                match Render::start(&self.program, "render", &self.render, &output) {
                    Ok(render) => PreviewStage::Rendering(render),
                    Err(e) => PreviewStage::Failed(format!("cannot start skylit render: {e}")),
                }
            }
            _ => self.load(context),
        };
        context.request_repaint();
    }

    /// Reads the picture.
    fn load(&self, context: &egui::Context) -> PreviewStage {
        match image::open(&self.picture) {
            Ok(picture) => {
                let picture = picture.into_rgba8();
                let size = [picture.width() as usize, picture.height() as usize];
                let pixels = egui::ColorImage::from_rgba_unmultiplied(size, picture.as_raw());
                PreviewStage::Shown(context.load_texture("bake preview", pixels, egui::TextureOptions::LINEAR))
            }
            Err(e) => PreviewStage::Failed(format!("the picture cannot be read: {e}")),
        }
    }

    /// Returns what the dialog shows of it.
    pub fn shown(&self) -> Shown<'_> {
        match &self.stage {
            PreviewStage::Baking(running) | PreviewStage::Rendering(running) => {
                let share = running.progress().map(|(share, _)| format!(" {:.0} %", 100.0 * share));
                Shown::Progress(format!("{}{}", running.verbs()[0], share.unwrap_or_default()))
            }
            PreviewStage::Shown(picture) => Shown::Picture(picture),
            PreviewStage::Failed(said) => Shown::Failure(said),
        }
    }
}

impl Drop for BakePreview {
    fn drop(&mut self) {
        let stage = std::mem::replace(&mut self.stage, PreviewStage::Failed(String::new()));
        if let PreviewStage::Baking(mut running) | PreviewStage::Rendering(mut running) = stage {
            running.cancel();
            // its folder is removed when nothing is written into it any more
            let folder = self.folder.take();
            std::thread::spawn(move || {
                while running.ended().is_none() {
                    std::thread::sleep(POLL);
                }
                drop(folder);
            });
        }
    }
}
