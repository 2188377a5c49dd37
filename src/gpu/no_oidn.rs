//! What stands for Open Image Denoise in a build without the feature `oidn`: it cannot be opened.

use crate::error::{Error, Result};

/// There is none.
pub enum Oidn {}

impl Oidn {
    /// # Errors
    /// Always: [`Error::Device`], with what helps.
    pub fn open() -> Result<Self> {
        Err(Error::Device(
            "Open Image Denoise is not in this build: build with --features oidn, or use --denoise filter".into(),
        ))
    }

    /// Of the library.
    pub fn version(&self) -> &str {
        match *self {}
    }

    /// See the module of builds with the feature.
    pub fn denoise(&self, _: [u32; 2], _: &[f32], _: &[f32], _: &[f32]) -> Result<Vec<f32>> {
        match *self {}
    }
}
