//! Animations: files that hold all frames of a sequence.

use std::path::Path;

use super::AnimationFormat;
use super::apng::{self, ApngWriter, Delay};
use super::png::Colour;
use super::video::VideoWriter;
use crate::error::Result;

/// An animation: what its frames have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Animation {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Channels of a frame.
    pub colour: Colour,
    /// The number of frames, at least 1.
    pub frames: u32,
    /// Frames a second.
    pub fps: f64,
}

/// An animation being written. [`AnimationWriter::finish`] makes the file; dropped before, none is
/// left.
pub enum AnimationWriter {
    Apng(Box<ApngWriter>),
    Video(Box<VideoWriter>),
}

impl AnimationWriter {
    /// Starts an animation that will be `path`.
    ///
    /// # Errors
    /// Those of [`ApngWriter::create`] and [`VideoWriter::create`].
    pub fn create(path: &Path, animation: Animation) -> Result<Self> {
        let Animation { size, colour, frames, fps } = animation;
        if AnimationFormat::from_path(path).is_some_and(|format| format != AnimationFormat::Apng) {
            return Ok(Self::Video(Box::new(VideoWriter::create(path, size, colour, fps)?)));
        }
        let animation = apng::Animation { size, colour, frames, delay: Delay::of_rate(fps)? };
        Ok(Self::Apng(Box::new(ApngWriter::create(path, animation)?)))
    }

    /// Adds a frame of 8-bit sRGB values, rows from the top.
    ///
    /// # Errors
    /// Those of [`ApngWriter::add_bytes`] and [`VideoWriter::add_bytes`].
    pub fn add_bytes(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            Self::Apng(apng) => apng.add_bytes(bytes),
            Self::Video(video) => video.add_bytes(bytes),
        }
    }

    /// Finishes the animation and moves the file to its path.
    ///
    /// # Errors
    /// Those of [`ApngWriter::finish`] and [`VideoWriter::finish`].
    pub fn finish(self) -> Result<()> {
        match self {
            Self::Apng(apng) => apng.finish(),
            Self::Video(video) => video.finish(),
        }
    }
}
