//! Kinds of image files.

use std::path::Path;

use crate::error::{Error, Result};

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
