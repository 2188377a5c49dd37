//! Kinds of image files, and of animations.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files;

/// A file that holds all frames of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationFormat {
    /// Animated PNG.
    Apng,
    /// H.264, without alpha.
    Mp4,
    /// VP9.
    WebM,
    /// A palette of 256 colours.
    Gif,
}

impl AnimationFormat {
    /// The kind that the extension of `path` names, if it is one.
    pub fn from_path(path: &Path) -> Option<Self> {
        let kinds = [("apng", Self::Apng), ("mp4", Self::Mp4), ("webm", Self::WebM), ("gif", Self::Gif)];
        kinds.into_iter().find(|(extension, _)| files::has_extension(path, extension)).map(|(_, kind)| kind)
    }
}

/// Returns true if the name is that of a file that holds all frames of a sequence.
pub fn is_animation(path: &Path) -> bool {
    AnimationFormat::from_path(path).is_some()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR: every channel, metadata.
    Exr,
    /// PNG: the colour channels, 8 or 16 bits.
    Png,
    /// JPEG: the colour channels, 8-bit sRGB, lossy.
    Jpeg,
    /// WebP: the colour channels, 8-bit sRGB, lossless.
    WebP,
}

impl ImageFormat {
    /// The kind that the extension of `path` names.
    ///
    /// # Errors
    /// [`Error::Usage`] for an extension of another kind.
    pub fn from_path(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            Some("jpg" | "jpeg") => Ok(Self::Jpeg),
            Some("webp") => Ok(Self::WebP),
            _ => Err(Error::Usage(format!(
                "{}: unknown kind of image: the name must end in .exr, .png, .jpg or .webp",
                path.display()
            ))),
        }
    }

    /// Returns true if a file holds nothing but the integers that a display shows.
    pub fn is_picture(self) -> bool {
        self != Self::Exr
    }
}
