//! A stub for Open Image Denoise in builds without the feature `oidn`: opening it fails.

use crate::error::{Error, Result};

/// Never exists in this build.
pub enum Oidn {}

impl Oidn {
    /// # Errors
    /// Always [`Error::Device`].
    pub fn open() -> Result<Self> {
        Err(Error::Device(
            "Open Image Denoise is not in this build: build with --features oidn, or use --denoise filter".into(),
        ))
    }

    /// Version of the library.
    pub fn version(&self) -> &str {
        match *self {}
    }

    /// Denoises an image; see the module of builds with the feature.
    pub fn denoise(&self, _: [u32; 2], _: &[f32], _: &[f32], _: &[f32]) -> Result<Vec<f32>> {
        match *self {}
    }
}
