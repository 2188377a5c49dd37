//! Output of frames: numbered files, or an animation.

use std::path::PathBuf;

use crate::error::Result;
use crate::gpu::Buffer;
use crate::output::apng::{self, Animation, ApngWriter, Delay};
use crate::output::png::{self, Colour};
use crate::output::{self, Image, ImageFormat, frames};

/// The files that frames are written to.
pub struct FrameFiles {
    images: Vec<PathBuf>,
    pictures: Vec<PathBuf>,
    animations: Vec<ApngWriter>,
    colour: Colour,
}

impl FrameFiles {
    /// Starts the animations, which appear when [`FrameFiles::finish`] is called. `colour`: colour type of 8-bit files.
    pub fn create(outputs: &[PathBuf], size: [u32; 2], frames: u32, fps: f64, colour: Colour) -> Result<Self> {
        let (animations, files): (Vec<_>, Vec<_>) = outputs.iter().cloned().partition(|p| apng::is_apng(p));
        let (mut images, mut pictures) = (Vec::new(), Vec::new());
        for path in files {
            if ImageFormat::of(&path)? == ImageFormat::Png { pictures.push(path) } else { images.push(path) }
        }
        let delay = Delay::of_rate(fps)?;
        let start = |p: &PathBuf| ApngWriter::create(p, Animation { size, colour, frames, delay });
        Ok(Self { images, pictures, animations: animations.iter().map(start).collect::<Result<_>>()?, colour })
    }

    /// Writes a frame: its channels to .exr files, and its display ([`crate::renderer::Frames::displayed`]) to 8-bit files and animations.
    pub fn add(&mut self, number: u32, [width, height]: [u32; 2], image: Option<&Image>, shown: Option<&Buffer>) -> Result<()> {
        if let Some(image) = image {
            for path in &self.images {
                output::save(image, &frames::numbered(path, u64::from(number))?)?;
            }
        }
        if let Some(shown) = shown {
            let mut bytes = Vec::new();
            let channels = self.colour.channels();
            shown.read_with(0, 4 * u64::from(width) * u64::from(height), 4, |_, words| {
                bytes.extend(words.chunks_exact(4).flat_map(|word| &word[..channels]));
            })?;
            for path in &self.pictures {
                let path = frames::numbered(path, u64::from(number))?;
                match self.colour {
                    Colour::Grey => png::write_grey(&path, &bytes, width, height)?,
                    Colour::Rgb => png::write_rgb(&path, &bytes, width, height)?,
                }
            }
            for animation in &mut self.animations {
                animation.add_bytes(&bytes)?;
            }
        }
        Ok(())
    }

    /// Finishes the animations.
    pub fn finish(self) -> Result<()> {
        self.animations.into_iter().try_for_each(ApngWriter::finish)
    }
}
