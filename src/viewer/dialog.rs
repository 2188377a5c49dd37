//! Windows that ask the user for something.

use super::baking::BakeWanted;

/// A window that asks for something.
#[derive(Clone, Debug, PartialEq)]
pub enum Dialog {
    /// For a scene: a file or `builtin:NAME`.
    Open(String),
    /// For the name of an image file.
    Save(String),
    /// For a file of settings to read.
    LoadSettings(String),
    /// For a file of settings to write.
    SaveSettings(String),
    /// For the output of `skylit export`.
    Export(String),
    /// For the output of `skylit render`, and its settings.
    Render(String, RenderWanted),
    /// For the output of `skylit bake`, and its settings.
    Bake(String, BakeWanted),
}

/// Numbers that `skylit render` is asked for. Of each motion it has the numbers that apply to it.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderWanted {
    pub motion: RenderedMotion,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples per pixel; of a still.
    pub spp: u32,
    /// Frames; of a turntable.
    pub frames: u32,
    /// Frames per second.
    pub fps: f64,
}

/// The motion in the frames of `skylit render`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderedMotion {
    /// Nothing: one image of the moment that is shown.
    Nothing,
    /// The camera, around the moment that is shown.
    Turntable,
    /// The animation.
    Animation,
}

impl Dialog {
    /// The text that is typed into the window.
    pub fn text_mut(&mut self) -> &mut String {
        match self {
            Self::Open(text)
            | Self::Save(text)
            | Self::LoadSettings(text)
            | Self::SaveSettings(text)
            | Self::Export(text)
            | Self::Render(text, _)
            | Self::Bake(text, _) => text,
        }
    }
}
